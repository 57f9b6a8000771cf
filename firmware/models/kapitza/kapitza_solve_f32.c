#include "number/uncontracted.h"

/* A row and a solve of the strong form, at every tick: its three parameters written out, the same bits in half the
 * instructions. */
#include "kapitza_solve_f32.h"

#include <stddef.h>

#include "kapitza_sums_f32.h"
#include "solve/cholesky_f32.h"
#include "solve/commit.h"
#include "solve/direct_f32.h"
#include "solve/step_f32.h"

static inline float step_size_three(const pvid_solve_settings_f32 *settings, const float p[], const float dp[])
{
    const uint32_t first = pvid_step_relative_f32(settings, p, 0, dp[0]);
    const uint32_t second = pvid_step_relative_f32(settings, p, 1, dp[1]);
    const uint32_t third = pvid_step_relative_f32(settings, p, 2, dp[2]);
    const uint32_t larger = (second > first) ? second : first;
    return pvid_from_bits_f32((third > larger) ? third : larger);
}

static inline void limit_step_three(const pvid_solve_settings_f32 *settings, const float p[], const float dp[],
                                    pvid_solution_f32 *solution)
{
    const float part = pvid_step_shortening_f32(settings, solution->size, &solution->limited);
    solution->p[0] = pvid_step_bounded_f32(settings, p, 0, part * dp[0], &solution->bounded);
    solution->p[1] = pvid_step_bounded_f32(settings, p, 1, part * dp[1], &solution->bounded);
    solution->p[2] = pvid_step_bounded_f32(settings, p, 2, part * dp[2], &solution->bounded);
}

/* pvid_direct_move_f32 for three parameters and no dead zone: the same, written out, so that S, its factor and dp stay
 * in registers. */
static pvid_reason move_three(pvid_estimator_f32 *self, float gain, float s[][PVID_MAX_P], float rhs[])
{
    const pvid_solve_settings_f32 *settings = &self->settings;
    pvid_solution_f32 solution = {.p = self->p};
    float dp[PVID_MAX_P];
    pvid_cholesky_f32 factor;
    pvid_direct_complete_f32(self, 0, gain, s, rhs);
    pvid_direct_complete_f32(self, 1, gain, s, rhs);
    pvid_direct_complete_f32(self, 2, gain, s, rhs);
    if (!pvid_cholesky_factor_three_f32(&factor, (const float (*)[PVID_MAX_P])s)) {
        return pvid_count_held(&self->counters, PVID_HELD_PIVOT);
    }
    if (!pvid_step_is_excited_f32(settings, factor.first_pivot, s[0][0])) {
        return pvid_count_held(&self->counters, PVID_HELD_NOT_EXCITED);
    }
    pvid_cholesky_solve_three_f32(&factor, rhs, dp);
    solution.size = step_size_three(settings, self->p, dp);
    if (!pvid_finite_f32(solution.size)) {
        return pvid_count_held(&self->counters, PVID_HELD_PIVOT);
    }
    limit_step_three(settings, self->p, dp, &solution);
    pvid_count_step(&self->counters, solution.limited, solution.bounded);
    pvid_count_up(&self->counters.updates);
    return PVID_UPDATED;
}

/* With a dead zone: by the sums, written out. */
pvid_reason pvid_kapitza_solve_in_zone_f32(pvid_estimator_f32 *self, const float n[], float y)
{
    pvid_information_f32 *information = &self->information;
    pvid_system_f32 system;
    float sums[PVID_MAX_SUMS];
    pvid_kapitza_accumulate_f32(n, y, information->high, information->low, sums);
    const float rss_minus_yy =
        pvid_kapitza_project_f32(self->p, sums, &sums[PVID_KAPITZA_STRONG_MOMENTS], system.s, system.force);
    pvid_direct_residual_f32(self, sums, rss_minus_yy, &system);
    return pvid_direct_move_f32(self, self->settings.gain, &system);
}

pvid_reason pvid_kapitza_solve_f32(pvid_estimator_f32 *self, const float n[], float y)
{
    if (self->settings.dead_zone > 0.0f) {
        return pvid_kapitza_solve_in_zone_f32(self, n, y);
    }
    float s[PVID_MAX_P][PVID_MAX_P];
    float force[PVID_MAX_P];
    pvid_kapitza_absorb_f32(self->p, n, y, self->information.high, self->information.low, s, force);
    return move_three(self, self->settings.gain, s, force);
}
