/* A step of p from the solution of (S + H0) dp = rhs: its size, its limits, and whether it is allowed. Private to the
 * core, inlined. */
#ifndef PVID_STEP_F32_H
#define PVID_STEP_F32_H

#include "number/count.h"
#include "number/finite_f32.h"
#include "solve/state_f32.h"

/* Relative size of a step in parameter a: relative to p if it is a positive parameter, else to start_sd. Returns the
 * bits of the float: the bits of |x| are ordered like |x|, infinity and NaN last. */
static inline uint32_t pvid_estimator_relative_step_f32(const pvid_estimator_f32 *self, size_t a, float step)
{
    const float *reference = pvid_is_positive_f32(self->model, a) ? self->p : self->start_sd;
    return pvid_bits_f32(step / reference[a]) & 0x7FFFFFFFu;
}

/* The largest relative step of all parameters; not finite if dp is not. */
static inline float pvid_estimator_step_size_f32(const pvid_estimator_f32 *self, const float dp[])
{
    uint32_t largest = 0;
    for (size_t a = 0; a < self->model->n_p; a++) {
        const uint32_t relative_step = pvid_estimator_relative_step_f32(self, a, dp[a]);
        largest = (relative_step > largest) ? relative_step : largest;
    }
    return pvid_from_bits_f32(largest);
}

/* Parameter a after a step, within its bounds. */
static inline float pvid_estimator_bounded_f32(const pvid_estimator_f32 *self, size_t a, float step, bool *bounded)
{
    float x = self->p[a] + step;
    if (x > self->upper[a]) {
        x = self->upper[a];
        *bounded = true;
    }
    if (x < self->lower[a]) {
        x = self->lower[a];
        *bounded = true;
    }
    return x;
}

/* Factor that shortens a step of this relative size to the step limit. */
static inline float pvid_estimator_step_factor_f32(pvid_estimator_f32 *self, float size)
{
    if (size > self->step_limit) {
        pvid_count_up(&self->counters.limited);
        return self->step_limit / size;
    }
    return 1.0f;
}

/* p[n_p] = the estimator's p after the step dp, shortened to the step limit, within the bounds. */
static inline void pvid_estimator_apply_step_f32(pvid_estimator_f32 *self, const float dp[], float size, float p[])
{
    const float part = pvid_estimator_step_factor_f32(self, size);
    bool bounded = false;
    for (size_t a = 0; a < self->model->n_p; a++) {
        p[a] = pvid_estimator_bounded_f32(self, a, part * dp[a], &bounded);
    }
    if (bounded) {
        pvid_count_up(&self->counters.bounded);
    }
}

/* Sufficient excitation of p[0]: the share kappa of its diagonal entry that no other parameter can explain is
 * large enough, and exceeds the prior information. */
static inline bool pvid_estimator_is_excited_f32(const pvid_estimator_f32 *self, float kappa, float diagonal)
{
    const bool own = (kappa * diagonal) >= (2.0f * self->prior[0]);
    return (kappa >= self->kappa_min) && (own || !(self->kappa_min > 0.0f));
}

/* Counts a group. Returns whether a solve is due. */
static inline bool pvid_estimator_is_due_f32(pvid_estimator_f32 *self)
{
    self->phase++;
    if (self->phase < self->divider) {
        return false;
    }
    self->phase = 0;
    return true;
}

#endif
