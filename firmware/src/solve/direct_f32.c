#include "number/uncontracted.h"

/* The engine for models with their own `project`: the sums are B = sum N Y and yy, and a solve is one call. */
#include "solve/direct_f32.h"

#include <stddef.h>
#include <string.h>

#include "solve/assess_f32.h"
#include "solve/commit.h"
#include "solve/row_f32.h"
#include "solve/step_f32.h"

/* Rounding floor of yy - 2 B^T theta + theta^T M theta, relative to yy: a few ulp of each term. */
#define RESIDUAL_FLOOR 4.8e-7f

/* ---- the solve ---- */

void pvid_direct_residual_f32(const pvid_estimator_f32 *self, const float sums[], float rss_minus_yy,
                              pvid_system_f32 *system)
{
    const float *tail = &sums[self->model->n_moments + self->model->n_theta]; /* yy, weight */
    system->rss = tail[0] + rss_minus_yy;
    system->rounding = self->information.rounding;
    system->floor = RESIDUAL_FLOOR * tail[0];
    system->weight = tail[1];
}

/* The normal equations of these sums. */
static void gather(const pvid_estimator_f32 *self, const float sums[], pvid_system_f32 *system)
{
    const pvid_model_f32 *model = self->model;
    const float rss_minus_yy = model->project(self->p, sums, &sums[model->n_moments], system->s, system->force);
    pvid_direct_residual_f32(self, sums, rss_minus_yy, system);
}

pvid_reason pvid_direct_move_f32(pvid_estimator_f32 *self, float gain, pvid_system_f32 *system)
{
    const pvid_solve_settings_f32 *settings = &self->settings;
    float rhs[PVID_MAX_P];
    pvid_cholesky_f32 factor;
    pvid_solution_f32 solution = {.p = self->p};
    for (size_t a = 0; a < settings->n_p; a++) {
        rhs[a] = system->force[a];
        pvid_direct_complete_f32(self, a, gain, system->s, rhs);
    }
    const pvid_reason reason = pvid_step_factor_f32(system, settings, &factor);
    if (reason != PVID_UPDATED) {
        return pvid_count_held(&self->counters, reason);
    }
    pvid_step_take_f32(system, settings, &factor, self->p, rhs, &solution);
    if (solution.reason != PVID_UPDATED) {
        return pvid_count_held(&self->counters, solution.reason);
    }
    pvid_count_step(&self->counters, solution.limited, solution.bounded);
    pvid_count_up(solution.in_dead_zone ? &self->counters.at_rest : &self->counters.updates);
    return PVID_UPDATED;
}

static pvid_reason solve_at_once(pvid_estimator_f32 *self, float gain, const float sums[])
{
    pvid_system_f32 system;
    gather(self, sums, &system);
    return pvid_direct_move_f32(self, gain, &system);
}

pvid_reason pvid_direct_solve_f32(pvid_estimator_f32 *self, bool ends_group)
{
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&self->information, sums);
    if (!ends_group) {
        return (self->settings.gain < 1.0f) ? PVID_ACCUMULATED : solve_at_once(self, 1.0f, sums);
    }
    const pvid_reason reason = pvid_solve_is_due(&self->phase, self->divider)
                                   ? solve_at_once(self, self->settings.gain, sums)
                                   : PVID_ACCUMULATED;
    pvid_information_end_group_f32(&self->information);
    return reason;
}

/* ---- rows ---- */

pvid_reason pvid_direct_take_row_f32(pvid_estimator_f32 *self, const float n[], float y, float e,
                                     const float gradient[], bool ends_group)
{
    const size_t n_theta = self->model->n_theta;
    pvid_reason reason = pvid_row_accept_f32(self, n_theta, n, y, pvid_row_squares_f32(n_theta, n, y));
    if (reason != PVID_ACCUMULATED) {
        return reason;
    }
    if (self->settings.gain < 1.0f) {
        pvid_row_accumulate_innovation_f32(self, self->model->n_p, gradient, e);
    }
    pvid_count_up(&self->counters.rows);
    float sums[PVID_MAX_SUMS];
    self->model->accumulate(n, y, self->information.high, self->information.low, sums);
    if (ends_group) {
        if (pvid_solve_is_due(&self->phase, self->divider)) {
            reason = solve_at_once(self, self->settings.gain, sums);
        }
        pvid_information_end_group_f32(&self->information);
    }
    return reason;
}

/* ---- the assessment ---- */

void pvid_direct_assess_f32(const pvid_estimator_f32 *self, pvid_estimate_f32 *estimate)
{
    float sums[PVID_MAX_SUMS];
    pvid_system_f32 system;
    pvid_information_read_f32(&self->information, sums);
    gather(self, sums, &system);
    memset(estimate, 0, sizeof *estimate);
    memcpy(estimate->p, self->p, sizeof estimate->p);
    pvid_assess_f32(&system, &self->settings, estimate);
}
