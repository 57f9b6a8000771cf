/* What the parts of the estimator share: the solve at once, the solve in stages, the assessment. Private to the core.
 */
#ifndef PVID_ESTIMATOR_F32_H
#define PVID_ESTIMATOR_F32_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "solve/cholesky_f32.h"
#include "number/count.h"
#include "number/finite_f32.h"
#include "pvid/estimator.h"

static inline bool pvid_is_positive_f32(const pvid_model_f32 *model, size_t i)
{
    return ((model->positive >> i) & 1u) != 0u;
}

/* Whether B and yy are kept relative to the estimate; see estimator.h. */
static inline bool pvid_is_relative_f32(const pvid_model_f32 *model)
{
    return model->project == NULL;
}

/* Leading parameters that the gates look at. */
static inline uint8_t pvid_excited_parameters_f32(const pvid_model_f32 *model)
{
    return (model->n_gated > 0u) ? model->n_gated : model->n_p;
}

/* How far a step goes in parameter a, as a part of what it is measured by: its own value where it is positive, else the
 * standard deviation of its start. As bits: those of |x| order as |x| does, infinity and NaN last. */
static inline uint32_t pvid_estimator_relative_step_f32(const pvid_estimator_f32 *self, size_t a, float step)
{
    const float *reference = pvid_is_positive_f32(self->model, a) ? self->p : self->start_sd;
    return pvid_bits_f32(step / reference[a]) & 0x7FFFFFFFu;
}

/* The farthest of all parameters; not finite if dp is not. */
static inline float pvid_estimator_step_size_f32(const pvid_estimator_f32 *self, const float dp[])
{
    uint32_t largest = 0;
    for (size_t a = 0; a < self->model->n_p; a++) {
        const uint32_t relative_step = pvid_estimator_relative_step_f32(self, a, dp[a]);
        largest = (relative_step > largest) ? relative_step : largest;
    }
    return pvid_from_bits_f32(largest);
}

/* Where a step leads in parameter a, within its bounds. */
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

/* Part of a step of this size that is taken. */
static inline float pvid_estimator_step_factor_f32(pvid_estimator_f32 *self, float size)
{
    if (size > self->step_limit) {
        pvid_count_up(&self->counters.limited);
        return self->step_limit / size;
    }
    return 1.0f;
}

/* p[n_p] = where the step dp leads: shortened to the step limit, within the bounds. */
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

/* Whether the data speak of p[0]: what of its information no other parameter can imitate is a part
 * kappa of its diagonal entry, and more than the start brought along. */
static inline bool pvid_estimator_is_excited_f32(const pvid_estimator_f32 *self, float kappa, float diagonal)
{
    const bool own = (kappa * diagonal) >= (2.0f * self->prior[0]);
    return (kappa >= self->kappa_min) && (own || !(self->kappa_min > 0.0f));
}

/* Counts a group; whether a solve is due. */
static inline bool pvid_estimator_is_due_f32(pvid_estimator_f32 *self)
{
    self->phase++;
    if (self->phase < self->divider) {
        return false;
    }
    self->phase = 0;
    return true;
}

/* pvid_estimator_step_f32 for a model with functions of its own, of which innovate's answers at p are known (they are
 * asked for while g < 1). */
pvid_reason pvid_estimator_step_innovation_f32(pvid_estimator_f32 *self, const float n[], float y, float e,
                                               const float gradient[]);

/* A solve of a model that projects its sums by itself: at the end of a group, or once more. */
pvid_reason pvid_estimator_solve_sums_f32(pvid_estimator_f32 *self, bool ends_group);

/* Whether S - margin Sn, Sn the information that noise of the given variance alone would make, is still
 * positive: what the data say goes beyond what noise says. True where the model does not know Sn.
 * s: upper triangle of C^T M C [n_p][n_p]. Cost: a factorisation. */
bool pvid_estimator_is_above_noise_f32(const pvid_estimator_f32 *self, const float s[][PVID_MAX_P], float variance,
                                       float weight);

/* Whether p is within the dead zone of estimator.h: force is F [n_p], factor that of S + H0, variance that of the
 * residuals. False for what is no number. Cost: a solve. */
bool pvid_estimator_is_in_dead_zone_f32(const pvid_estimator_f32 *self, const pvid_cholesky_f32 *factor,
                                        const float force[], float variance);

/* Where p is absurd a residual sum overflows or is no number; so far up no standard error made of it does. */
#define PVID_RESIDUAL_MAX 1.0e30f

/* s^2 of a row: residual sum of squares, with what rounding may have taken from it, over degrees of freedom; no less
 * than the sensors' noise explains, and row_sd^2 while there are no degrees of freedom. */
float pvid_estimator_variance_f32(const pvid_estimator_f32 *self, const float sums[], float energy);

/* Takes note of the variance that the sensors' noise gives the rows taken in since the last group's end; call it when
 * all of a group are, and before its solve begins. For models without functions of their own, as the next two. */
void pvid_estimator_set_expected_f32(pvid_estimator_f32 *self, float variance);

/* Residual variance of all rows in these sums over the variance that was told for them; 0 while there are no degrees of
 * freedom, or where no digit of the residuals is left. */
float pvid_estimator_misfit_f32(const pvid_estimator_f32 *self, const float sums[]);

/* Whether rounding may be all there is in the residual sum: p has come a long way with these sums. */
bool pvid_estimator_is_rounded_f32(const pvid_estimator_f32 *self);

/* estimate->kappa and least_pivot from S, the upper triangle s. */
void pvid_estimator_find_kappa_f32(const pvid_estimator_f32 *self, const float s[][PVID_MAX_P],
                                   pvid_estimate_f32 *estimate);

/* Factors S / wide + 1 / start_sd^2, times wide; s is used up. Returns whether it could be done. */
bool pvid_estimator_factor_wide_f32(const pvid_estimator_f32 *self, float s[][PVID_MAX_P], float wide,
                                    pvid_cholesky_f32 *factor);

/* Scales estimate->covariance, that factor's inverse, by `wide` and takes its roots; what the start said where `known`
 * is false or the result not finite. */
void pvid_estimator_scale_f32(const pvid_estimator_f32 *self, float wide, bool known, pvid_estimate_f32 *estimate);

/* Whether init has accepted a configuration. */
static inline bool pvid_estimator_is_ready_f32(const pvid_estimator_f32 *self)
{
    const bool ready = (self != NULL) && (self->model != NULL);
    PVID_ASSERT(ready);
    return ready;
}

#endif
