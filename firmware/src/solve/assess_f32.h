/* Accuracy of p from S and the residuals, for both engines. Private to the core. */
#ifndef PVID_ASSESS_F32_H
#define PVID_ASSESS_F32_H

#include "solve/cholesky_f32.h"
#include "solve/state_f32.h"

/* Returns whether S contains more information than noise: S - noise_margin Sn is positive definite, where Sn is the
 * information of noise of the given variance alone. True if the model has no `noise`. s: upper triangle of C^T M C
 * [n_p][n_p]. Cost: a factorisation. */
bool pvid_estimator_is_above_noise_f32(const pvid_estimator_f32 *self, const float s[][PVID_MAX_P], float variance,
                                       float weight);

/* Whether p is within the dead zone of estimator.h; force: F [n_p]; factor: of S + H0; variance: of the residuals.
 * False for NaN. Cost: a solve. */
bool pvid_estimator_is_in_dead_zone_f32(const pvid_estimator_f32 *self, const pvid_cholesky_f32 *factor,
                                        const float force[], float variance);

/* Upper limit of a residual sum, which may overflow far from the solution: standard errors from it are finite. */
#define PVID_RESIDUAL_MAX 1.0e30f

/* s^2 of a row: the residual sum of squares, at least `floor`, over the degrees of freedom; row_sd^2 if there are none.
 * The residual sum of squares is yy + energy, with energy = theta^T M theta - 2 theta^T B from `project` (model.h), or
 * rr with energy 0. */
float pvid_estimator_variance_f32(const pvid_estimator_f32 *self, const float sums[], float energy, float floor);

/* Degrees of freedom of the residuals in these sums. */
static inline float pvid_estimator_freedom_f32(const pvid_estimator_f32 *self, const float sums[])
{
    return sums[self->model->n_moments + self->model->n_theta + 1u] - (float)self->model->n_p;
}

/* Sets the variance of the current group's rows by the sensors' noise. Call it when the group is complete, before its
 * solve begins. This function and the next two are for models without their own `project`. */
void pvid_estimator_set_expected_f32(pvid_estimator_f32 *self, float variance);

/* Residual variance of all rows in these sums over its expectation; 0 without degrees of freedom, or if rounding
 * dominates the residuals. */
float pvid_estimator_misfit_f32(const pvid_estimator_f32 *self, const float sums[]);

/* Returns whether rounding may dominate rr, because p has moved far since the rows were added. */
bool pvid_estimator_is_rounded_f32(const pvid_estimator_f32 *self);

/* estimate->kappa and least_pivot from S, the upper triangle s. */
void pvid_estimator_find_kappa_f32(const pvid_estimator_f32 *self, const float s[][PVID_MAX_P],
                                   pvid_estimate_f32 *estimate);

/* Factors S + wide / start_sd^2, where wide = correlation s^2; overwrites s. Returns false if this is not possible. */
bool pvid_estimator_factor_wide_f32(const pvid_estimator_f32 *self, float s[][PVID_MAX_P], float wide,
                                    pvid_cholesky_f32 *factor);

/* Multiplies estimate->covariance, the inverse of the factored matrix, by `wide` and writes the standard errors. If
 * `known` is false or a result is not finite, writes the start's standard deviations. */
void pvid_estimator_scale_f32(const pvid_estimator_f32 *self, float wide, bool known, pvid_estimate_f32 *estimate);

#endif
