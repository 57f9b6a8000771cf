#include "number/uncontracted.h"

/* The engine for models with their own `project`: the sums are B = sum N Y and yy, and a solve is one call. */
#include "solve/direct_f32.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "number/finite_f32.h"
#include "solve/assess_f32.h"
#include "solve/row_f32.h"
#include "solve/step_f32.h"

/* Rounding floor of yy - 2 B^T theta + theta^T M theta, relative to yy: a few ulp of each term. */
#define RESIDUAL_FLOOR 4.8e-7f

/* ---- the solve ---- */

/* s^2 of a row. */
static float variance_of(const pvid_estimator_f32 *self, const float sums[], float energy)
{
    const float yy = sums[self->model->n_moments + self->model->n_theta];
    return pvid_estimator_variance_f32(self, sums, energy, RESIDUAL_FLOOR * yy);
}

pvid_reason pvid_direct_move_f32(pvid_estimator_f32 *self, float gain, const float sums[], float energy,
                                 float s[][PVID_MAX_P], const float force[])
{
    const uint8_t n_p = self->model->n_p;
    float rhs[PVID_MAX_P];
    float dp[PVID_MAX_P];
    pvid_cholesky_f32 factor;
    for (size_t a = 0; a < n_p; a++) {
        rhs[a] = force[a];
        pvid_direct_complete_f32(self, a, gain, s, rhs);
    }
    if (!pvid_cholesky_factor_f32(&factor, n_p, (const float (*)[PVID_MAX_P])s)) {
        return pvid_direct_hold_f32(&self->counters.held_pivot, PVID_HELD_PIVOT);
    }
    if (!pvid_estimator_is_excited_f32(self, factor.first_pivot, s[0][0])) {
        return pvid_direct_hold_f32(&self->counters.held_not_excited, PVID_HELD_NOT_EXCITED);
    }
    if ((self->dead_zone > 0.0f) &&
        pvid_estimator_is_in_dead_zone_f32(self, &factor, force, variance_of(self, sums, energy))) {
        return pvid_direct_hold_f32(&self->counters.at_rest, PVID_UPDATED);
    }
    pvid_cholesky_solve_f32(&factor, rhs, dp);
    const float size = pvid_estimator_step_size_f32(self, dp);
    if (!pvid_finite_f32(size)) {
        return pvid_direct_hold_f32(&self->counters.held_pivot, PVID_HELD_PIVOT);
    }
    pvid_estimator_apply_step_f32(self, dp, size, self->p);
    pvid_count_up(&self->counters.updates);
    return PVID_UPDATED;
}

static pvid_reason solve_at_once(pvid_estimator_f32 *self, float gain, const float sums[])
{
    float s[PVID_MAX_P][PVID_MAX_P];
    float force[PVID_MAX_P];
    const float energy = self->model->project(self->p, sums, &sums[self->model->n_moments], s, force);
    return pvid_direct_move_f32(self, gain, sums, energy, s, force);
}

pvid_reason pvid_direct_solve_f32(pvid_estimator_f32 *self, bool ends_group)
{
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&self->information, sums);
    if (!ends_group) {
        return (self->gain < 1.0f) ? PVID_ACCUMULATED : solve_at_once(self, 1.0f, sums);
    }
    const pvid_reason reason =
        pvid_estimator_is_due_f32(self) ? solve_at_once(self, self->gain, sums) : PVID_ACCUMULATED;
    pvid_information_end_group_f32(&self->information);
    return reason;
}

/* ---- rows ---- */

pvid_reason pvid_direct_take_row_f32(pvid_estimator_f32 *self, const float n[], float y, float e,
                                     const float gradient[], bool ends_group)
{
    const size_t n_theta = self->model->n_theta;
    pvid_reason reason = pvid_row_accept_f32(self, n, y, pvid_row_squares_f32(n_theta, n, y));
    if (reason != PVID_ACCUMULATED) {
        return reason;
    }
    if (self->gain < 1.0f) {
        pvid_row_accumulate_innovation_f32(self, self->model->n_p, gradient, e);
    }
    pvid_count_up(&self->counters.rows);
    float sums[PVID_MAX_SUMS];
    pvid_information_add_f32(&self->information, self->model, n, y, sums);
    if (ends_group) {
        if (pvid_estimator_is_due_f32(self)) {
            reason = solve_at_once(self, self->gain, sums);
        }
        pvid_information_end_group_f32(&self->information);
    }
    return reason;
}

/* ---- the assessment ---- */

void pvid_direct_assess_f32(const pvid_estimator_f32 *self, pvid_estimate_f32 *estimate)
{
    const pvid_model_f32 *model = self->model;
    float sums[PVID_MAX_SUMS];
    float s[PVID_MAX_P][PVID_MAX_P];
    float f[PVID_MAX_P];
    memset(estimate, 0, sizeof *estimate);
    memcpy(estimate->p, self->p, sizeof estimate->p);
    pvid_information_read_f32(&self->information, sums);
    estimate->weight = sums[model->n_moments + model->n_theta + 1u];
    const float energy = model->project(self->p, sums, &sums[model->n_moments], s, f);
    const float variance = variance_of(self, sums, energy);
    const float wide = variance * self->correlation;
    estimate->residual_sd = sqrtf(variance);
    pvid_estimator_find_kappa_f32(self, (const float (*)[PVID_MAX_P])s, estimate);
    pvid_cholesky_f32 factor;
    const bool known = pvid_estimator_factor_wide_f32(self, s, wide, &factor);
    if (known) {
        pvid_cholesky_inverse_f32(&factor, estimate->covariance);
    }
    pvid_estimator_scale_f32(self, wide, known, estimate);
}
