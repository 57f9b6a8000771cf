/* A step of p from (S + H0) dp = rhs in three parameters, by L D L^T from the last row up: three divisions and no
 * root. Private to the core, inlined. */
#ifndef PVID_KAPITZA_SOLVE_F32_H
#define PVID_KAPITZA_SOLVE_F32_H

#include <stdbool.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#include "pvid/strong.h"
#include "solve/cholesky_f32.h"
#include "solve/commit.h"

/* S + H0 = L D L^T with L unit upper triangular. */
typedef struct {
    float l01;
    float l02;
    float l12;
    float inverse1; /* of the pivots D */
    float inverse2;
    float pivot0;
} pvid_kapitza_factor_f32;

/* Factors S + H0, s the upper triangle of S. Returns PVID_UPDATED. Fails iff
 *   - a diagonal entry is not a positive normal number, or a pivot is below PVID_PIVOT_MIN of it: PVID_HELD_SINGULAR,
 * or
 *   - p[0] is not sufficiently excited: PVID_HELD_NOT_EXCITED. */
static inline pvid_reason pvid_kapitza_factorise_f32(const pvid_strong_estimator_f32 *self, const float s[6],
                                                     pvid_kapitza_factor_f32 *factor)
{
    const float s00 = s[0] + self->prior[0];
    const float s11 = s[3] + self->prior[1];
    const float s22 = s[5] + self->prior[2];
    /* infinity and NaN of any show in the sum; s11 and s00 that are not positive in their pivots */
    if (!pvid_positive_normal_f32(s22) || !pvid_positive_normal_f32((s00 + s11) + s22)) {
        return PVID_HELD_SINGULAR;
    }
    factor->inverse2 = 1.0f / s22;
    factor->l02 = s[2] * factor->inverse2;
    factor->l12 = s[4] * factor->inverse2;
    const float pivot1 = s11 - (factor->l12 * s[4]);
    if (!pvid_pivot_is_significant_f32(pivot1, s11)) {
        return PVID_HELD_SINGULAR;
    }
    const float c01 = s[1] - (factor->l02 * s[4]);
    factor->inverse1 = 1.0f / pivot1;
    factor->l01 = c01 * factor->inverse1;
    factor->pivot0 = (s00 - (factor->l02 * s[2])) - (factor->l01 * c01);
    if (!pvid_pivot_is_significant_f32(factor->pivot0, s00)) {
        return PVID_HELD_SINGULAR;
    }
    const bool own = factor->pivot0 >= (2.0f * self->prior[0]);
    const float kappa_min = self->config->estimator.kappa_min;
    const bool excited = (factor->pivot0 >= (kappa_min * s00)) && (own || !(kappa_min > 0.0f));
    return excited ? PVID_UPDATED : PVID_HELD_NOT_EXCITED;
}

/* x = (S + H0)^-1 rhs */
static inline void pvid_kapitza_back_f32(const pvid_kapitza_factor_f32 *factor, const float rhs[3], float x[3])
{
    const float z1 = rhs[1] - (factor->l12 * rhs[2]);
    const float z0 = (rhs[0] - (factor->l02 * rhs[2])) - (factor->l01 * z1);
    x[0] = z0 / factor->pivot0;
    x[1] = (z1 * factor->inverse1) - (factor->l01 * x[0]);
    x[2] = ((rhs[2] * factor->inverse2) - (factor->l02 * x[0])) - (factor->l12 * x[1]);
}

/* Negative iff x is beyond a bound of parameter a. */
static inline float pvid_kapitza_slack_f32(const pvid_estimator_config_f32 *config, size_t a, float x)
{
    return (x - config->lower[a]) * (config->upper[a] - x);
}

/* Stops p at its bounds. */
static PVID_COLD void pvid_kapitza_clamp_f32(pvid_strong_estimator_f32 *self)
{
    const pvid_estimator_config_f32 *config = &self->config->estimator;
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        self->p[a] = (self->p[a] > config->upper[a]) ? config->upper[a] : self->p[a];
        self->p[a] = (self->p[a] < config->lower[a]) ? config->lower[a] : self->p[a];
    }
    pvid_count_up(&self->counters.bounded);
}

/* The bits of |x / p[a]|: ordered like the number, infinity and NaN last. */
static inline uint32_t pvid_kapitza_relative_f32(const pvid_strong_estimator_f32 *self, size_t a, float x)
{
    return pvid_bits_f32(x / self->p[a]) & 0x7FFFFFFFu;
}

/* p += dp, shortened to the step limit and kept within the bounds. Fails iff dp is not finite: PVID_HELD_SINGULAR. */
static inline pvid_reason pvid_kapitza_move_f32(pvid_strong_estimator_f32 *self, const float dp[3])
{
    const pvid_estimator_config_f32 *config = &self->config->estimator;
    const uint32_t first = pvid_kapitza_relative_f32(self, 0, dp[0]);
    const uint32_t second = pvid_kapitza_relative_f32(self, 1, dp[1]);
    const uint32_t last = pvid_kapitza_relative_f32(self, 2, dp[2]);
    const uint32_t larger = (second > first) ? second : first;
    const uint32_t size = (last > larger) ? last : larger;
    float part = 1.0f;
    if (size > pvid_bits_f32(config->step_limit)) {
        if (!pvid_finite_f32(pvid_from_bits_f32(size))) {
            return PVID_HELD_SINGULAR;
        }
        part = config->step_limit / pvid_from_bits_f32(size);
        pvid_count_up(&self->counters.limited);
    }
    const float p0 = self->p[0] + (part * dp[0]);
    const float p1 = self->p[1] + (part * dp[1]);
    const float p2 = self->p[2] + (part * dp[2]);
    self->p[0] = p0;
    self->p[1] = p1;
    self->p[2] = p2;
    const uint32_t signs =
        (pvid_bits_f32(pvid_kapitza_slack_f32(config, 0, p0)) | pvid_bits_f32(pvid_kapitza_slack_f32(config, 1, p1))) |
        pvid_bits_f32(pvid_kapitza_slack_f32(config, 2, p2));
    if ((signs & 0x80000000u) != 0u) {
        pvid_kapitza_clamp_f32(self);
    }
    pvid_count_up(&self->counters.updates);
    return PVID_UPDATED;
}

#endif
