/* A step of p from the normal equations: whether it is allowed, its size, its limits. Pure: the results depend on the
 * arguments alone. Private to the core, inlined.
 *
 *   reason = pvid_step_factor_f32(&system, &settings, &factor);
 *   if (reason == PVID_UPDATED) pvid_step_take_f32(&system, &settings, &factor, pinned, p, rhs, &solution);
 */
#ifndef PVID_STEP_F32_H
#define PVID_STEP_F32_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "number/exact.h"
#include "number/finite_f32.h"
#include "solve/assess_f32.h"
#include "solve/cholesky_f32.h"
#include "solve/constraints_f32.h"
#include "pvid/estimator.h"

/* A step. The caller sets p, which may be the p of the equations; it is written only if a step is taken. */
typedef struct {
    float *p;            /* [n_p] p after the step, within its bounds */
    float size;          /* largest |dp/p| before step_limit; 0 if there is no step */
    pvid_reason reason;  /* PVID_UPDATED, or PVID_HELD_SINGULAR if dp is not finite */
    bool in_dead_zone;   /* p is within the dead zone: no step */
    bool limited;        /* shortened to step_limit */
    bool bounded;        /* a parameter was stopped at its bound, or stays there */
    pvid_p_bits blocked; /* bit a: p[a] is at a bound and dp pulls it outwards: no step */
} pvid_solution_f32;

/* Relative size of a step in parameter a: relative to p if it is a positive parameter, else to start_sd. Returns the
 * bits of the float: the bits of |x| are ordered like |x|, infinity and NaN last. */
static inline uint32_t pvid_step_relative_f32(const pvid_solve_settings_f32 *settings, const float p[], size_t a,
                                              float step)
{
    const bool positive = (((uint32_t)settings->positive >> a) & 1u) != 0u;
    const float *reference = positive ? p : settings->start_sd;
    return pvid_bits_f32(step / reference[a]) & 0x7FFFFFFFu;
}

/* The largest relative step of all parameters; not finite if dp is not. */
static inline float pvid_step_size_f32(const pvid_solve_settings_f32 *settings, const float p[], const float dp[])
{
    uint32_t largest = 0;
    const size_t n_p = PVID_COUNT(PVID_MAX_P, settings->n_p);
    for (size_t a = 0; a < n_p; a++) {
        const uint32_t relative_step = pvid_step_relative_f32(settings, p, a, dp[a]);
        largest = (relative_step > largest) ? relative_step : largest;
    }
    return pvid_from_bits_f32(largest);
}

/* Parameter a after a step, within its bounds; sets *bounded if it is stopped there. */
static inline float pvid_step_bounded_f32(const pvid_solve_settings_f32 *settings, const float p[], size_t a,
                                          float step, bool *bounded)
{
    float x = p[a] + step;
    if (x > settings->upper[a]) {
        x = settings->upper[a];
        *bounded = true;
    }
    if (x < settings->lower[a]) {
        x = settings->lower[a];
        *bounded = true;
    }
    return x;
}

#define PVID_PIN 1048576.0f /* 2^20: what a pinned parameter still takes from another is rounding */

static inline bool pvid_step_is_held_f32(float p, float lower, float upper, float pull)
{
    return ((p <= lower) && (pull < 0.0f)) || ((p >= upper) && (pull > 0.0f));
}

/* Parameters that are at a bound from which `pull` moves them outwards, a bit for each. */
static inline pvid_p_bits pvid_step_outwards_f32(size_t n, const float p[], const float lower[], const float upper[],
                                                 const float pull[])
{
    uint32_t outwards = 0;
    for (size_t a = 0; a < n; a++) {
        outwards |= pvid_step_is_held_f32(p[a], lower[a], upper[a], pull[a]) ? ((uint32_t)1u << a) : 0u;
    }
    return (pvid_p_bits)outwards;
}

static inline bool pvid_step_has_f32(pvid_p_bits bits, size_t a)
{
    return (((uint32_t)bits >> a) & 1u) != 0u;
}

/* Bounds are one-sided constraints. Those that act keep their parameters, a bit for each: F pulls these outwards, or
 * the last solve would have (`blocked`). Their diagonal entry of S is raised, as if they were known, so that the others
 * are solved without them. Source: theory.md 4, (6a). */
static inline pvid_p_bits pvid_step_pin_f32(pvid_system_f32 *system, const pvid_solve_settings_f32 *settings,
                                            const float p[])
{
    const size_t n_p = PVID_COUNT(PVID_MAX_P, settings->n_p);
    const uint32_t outwards = pvid_step_outwards_f32(n_p, p, settings->lower, settings->upper, system->force);
    const pvid_p_bits pinned = (pvid_p_bits)(outwards | settings->blocked);
    for (size_t a = 0; (pinned != 0u) && (a < n_p); a++) {
        system->s[a][a] *= pvid_step_has_f32(pinned, a) ? PVID_PIN : 1.0f;
    }
    return pinned;
}

/* dp = 0 for the pinned parameters. */
static inline void pvid_step_hold_f32(size_t n, pvid_p_bits pinned, float dp[])
{
    for (size_t a = 0; (pinned != 0u) && (a < n); a++) {
        dp[a] = pvid_step_has_f32(pinned, a) ? 0.0f : dp[a];
    }
}

#if PVID_MAX_CONSTRAINTS > 0
/* Factor that ends a part of a step where the first of the tied parameters would leave its bounds: clamped alone, it
 * would leave its constraint. The last of it is rounding, and left to the bounds. */
static inline float pvid_step_room_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings,
                                       const float p[], const float dp[], float part)
{
    float room = 1.0f;
    for (size_t a = 0; (system->ties.count > 0u) && (a < settings->n_p); a++) {
        const float step = part * dp[a];
        const float way = (step < 0.0f) ? (settings->lower[a] - p[a]) : (settings->upper[a] - p[a]);
        const bool leaves = (step < 0.0f) ? (step < way) : (step > way);
        const float own = leaves ? ((way / step) * (1.0f + 2.4e-7f)) : 1.0f;
        room = (own < room) ? own : room;
    }
    return room;
}
#endif

/* Factor that shortens a step of this relative size to the step limit; sets *limited. */
static inline float pvid_step_shortening_f32(const pvid_solve_settings_f32 *settings, float size, bool *limited)
{
    *limited = size > settings->step_limit;
    return *limited ? (settings->step_limit / size) : 1.0f;
}

/* Sufficient excitation of p[0]: the share kappa of its diagonal entry of S + H0 that no other parameter can explain is
 * large enough, and exceeds the prior information. */
static inline bool pvid_step_is_excited_f32(const pvid_solve_settings_f32 *settings, float kappa, float diagonal)
{
    const bool own = (kappa * diagonal) >= (2.0f * settings->prior[0]);
    return (kappa >= settings->kappa_min) && (own || !(settings->kappa_min > 0.0f));
}

/* Whether p is within the dead zone of estimator.h: F^T (S + H0)^-1 F <= dead_zone^2 correlation s^2. False for NaN.
 * settings->dead_zone already contains the square. Cost: a solve. */
static inline bool pvid_step_is_in_dead_zone_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings,
                                                 const pvid_cholesky_f32 *factor)
{
    float x[PVID_MAX_P];
    float square = 0.0f;
    pvid_cholesky_solve_f32(factor, system->force, x);
    for (size_t a = 0; a < settings->n_p; a++) {
        square += system->force[a] * x[a];
    }
    const float variance = pvid_assess_variance_f32(system, settings);
    const float noise = (variance < settings->row_variance) ? variance : settings->row_variance;
    return square <= (settings->dead_zone * (settings->correlation * noise));
}

/* Factors S + H0. Returns PVID_UPDATED if a step is allowed. Fails iff
 *   - a diagonal entry of S + H0 is not a positive normal number or a relative pivot is below PVID_PIVOT_MIN:
 *     PVID_HELD_SINGULAR, or
 *   - p[0] is not sufficiently excited: PVID_HELD_NOT_EXCITED.
 * Cost: a factorisation. */
static inline pvid_reason pvid_step_factor_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings,
                                               pvid_cholesky_f32 *factor)
{
    const bool solvable = pvid_cholesky_factor_f32(factor, settings->n_p, system->s);
    const float kappa = factor->first_pivot;
    if (!solvable) {
        return PVID_HELD_SINGULAR;
    }
    return pvid_step_is_excited_f32(settings, kappa, system->s[0][0]) ? PVID_UPDATED : PVID_HELD_NOT_EXCITED;
}

/* dp = (S + H0)^-1 rhs, 0 for the pinned parameters (a bit for each), shortened to the step limit, and p + dp within
 * the bounds. No step in the dead zone, and none where dp pulls another parameter out of its bound: without it the
 * others would go elsewhere. Fails iff dp is not finite: solution->reason is PVID_HELD_SINGULAR. Cost: a solve, two
 * with a dead zone, n_p + 1 divisions. Source: theory.md 4, (6), (6a). */
static inline void pvid_step_take_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings,
                                      const pvid_cholesky_f32 *factor, pvid_p_bits pinned, const float p[],
                                      const float rhs[], pvid_solution_f32 *solution)
{
    float dp[PVID_MAX_P];
    solution->reason = PVID_UPDATED;
    solution->size = 0.0f;
    solution->limited = false;
    solution->bounded = pinned != 0u;
    solution->blocked = 0;
    solution->in_dead_zone = (PVID_DEAD_ZONE != 0) && (settings->dead_zone > 0.0f) &&
                             pvid_step_is_in_dead_zone_f32(system, settings, factor);
    if (solution->in_dead_zone) {
        return;
    }
    pvid_cholesky_solve_f32(factor, rhs, dp);
    pvid_step_hold_f32(settings->n_p, pinned, dp);
#if PVID_MAX_CONSTRAINTS > 0
    pvid_constraints_complete_f32(&system->ties, settings->n_p, dp);
#endif
    const float size = pvid_step_size_f32(settings, p, dp);
    if (!pvid_finite_f32(size)) {
        solution->reason = PVID_HELD_SINGULAR;
        return;
    }
    solution->size = size;
    const size_t n_p = PVID_COUNT(PVID_MAX_P, settings->n_p);
    if (settings->gain > 0.0f) {
        solution->blocked = pvid_step_outwards_f32(n_p, p, settings->lower, settings->upper, dp);
    }
    if (solution->blocked != 0u) {
        solution->bounded = true;
        return;
    }
    float part = pvid_step_shortening_f32(settings, size, &solution->limited);
#if PVID_MAX_CONSTRAINTS > 0
    part *= pvid_step_room_f32(system, settings, p, dp, part);
#endif
    for (size_t a = 0; a < n_p; a++) {
        solution->p[a] = pvid_step_bounded_f32(settings, p, a, part * dp[a], &solution->bounded);
    }
}

#endif
