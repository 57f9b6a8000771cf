/* A step of p from the normal equations: whether it is allowed, its size, its limits. Pure: the results depend on the
 * arguments alone. Private to the core, inlined. */
#ifndef PVID_STEP_Q31_H
#define PVID_STEP_Q31_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "solve/assess_q31.h"
#include "solve/cholesky_q31.h"
#include "solve/state_q31.h"

/* A step. The caller sets p, which may be the p of the equations. */
typedef struct {
    int32_t *p;   /* [n_p] p after the step, within its bounds */
    int64_t size; /* largest |dp/p| before step_limit, Q22 */
    bool limited; /* shortened to step_limit */
    bool bounded; /* a parameter was stopped at its bound */
} pvid_solution_q31;

/* Sufficient excitation of p[0]: the share kappa of its diagonal entry of S + H0 that no other parameter can explain is
 * large enough, and exceeds the prior information. */
static inline bool pvid_step_is_excited_q31(const pvid_system_q31 *system, const pvid_solve_settings_q31 *settings)
{
    const int32_t kappa = system->factor.first_pivot;
    const int64_t prior = pvid_scale_q31(system->first_prior, 2 * system->g[0]);
    const bool own = pvid_round_shift_q31((int64_t)kappa * system->q[0][0], 31) >= prior;
    return (kappa >= settings->kappa_min) && (own || (settings->kappa_min == 0));
}

/* Whether p is within the dead zone of estimator.h: decrement = F^T (S + H0)^-1 F <= dead_zone^2 correlation s^2, in
 * the unit of the sums. expected: as in pvid_assess_variance_q31. */
static inline bool pvid_step_is_in_dead_zone_q31(const pvid_residual_q31 *sums, const pvid_solve_settings_q31 *settings,
                                                 pvid_scaled_q31 expected, pvid_scaled_q31 decrement)
{
    const pvid_scaled_q31 found = pvid_assess_variance_q31(sums, settings, expected);
    const pvid_scaled_q31 configured = pvid_assess_row_variance_q31(settings, sums->exponent);
    const pvid_scaled_q31 noise = pvid_scaled_exceeds_q31(found, configured) ? configured : found;
    const pvid_scaled_q31 wide = pvid_scaled_times_q31(noise, pvid_scaled_of_q31(settings->correlation, -16));
    const pvid_scaled_q31 zone = pvid_scaled_of_q31((int64_t)settings->dead_zone * settings->dead_zone, -32);
    return !pvid_scaled_exceeds_q31(decrement, pvid_scaled_times_q31(zone, wide));
}

/* Relative size of the step dp: over p for positive parameters, else over start_sd; Q22. */
static inline int64_t pvid_step_size_q31(const pvid_solve_settings_q31 *settings, const int32_t p[], const int64_t dp[])
{
    int64_t size = 0;
    for (size_t a = 0; a < settings->n_p; a++) {
        const bool positive = (((uint32_t)settings->positive >> a) & 1u) != 0u;
        const int32_t reference = positive ? p[a] : settings->start_sd[a];
        const uint64_t part = pvid_magnitude_q31(dp[a]) << PVID_SIZE_BITS;
        const int64_t own = (int64_t)pvid_quotient_q31(part, (uint32_t)reference);
        size = (own > size) ? own : size;
    }
    return size;
}

/* p + dp, shortened to the step limit, within the bounds; |dp| <= 2^40. Cost: n_p + 1 divisions of 64 bits. Source:
 * theory.md 4, equation (6). */
static inline void pvid_step_take_q31(const pvid_solve_settings_q31 *settings, const int32_t p[], const int64_t dp[],
                                      pvid_solution_q31 *solution)
{
    const int64_t limit = (int64_t)settings->step_limit << (PVID_SIZE_BITS - 16);
    const int64_t size = pvid_step_size_q31(settings, p, dp);
    const bool limited = size > limit;
    const int32_t factor = (size > limit) ? (int32_t)pvid_clamp_q31((limit << 31) / size, INT32_MAX) : 0;
    solution->size = size;
    solution->limited = limited;
    solution->bounded = false;
    for (size_t a = 0; a < settings->n_p; a++) {
        int64_t x = p[a] + (limited ? pvid_times_q31(dp[a], factor) : dp[a]);
        if (x > settings->upper[a]) {
            x = settings->upper[a];
            solution->bounded = true;
        }
        if (x < settings->lower[a]) {
            x = settings->lower[a];
            solution->bounded = true;
        }
        solution->p[a] = (int32_t)x;
    }
}

#endif
