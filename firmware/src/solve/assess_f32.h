/* How far p can be trusted, from S and the residuals: pure functions, for both engines. Private to the core. */
#ifndef PVID_ASSESS_F32_H
#define PVID_ASSESS_F32_H

#include "solve/cholesky_f32.h"
#include "solve/state_f32.h"

/* Whether S - margin Sn is positive definite, Sn the information of noise of the given variance alone: S contains
 * more information than noise. True if the model has no `noise`. s: upper triangle of C^T M C [n_p][n_p]. Cost: a
 * factorisation. */
bool pvid_estimator_is_above_noise_f32(const pvid_estimator_f32 *self, const float s[][PVID_MAX_P], float variance,
                                       float weight);

/* Whether p is within the dead zone of estimator.h; force: F [n_p]; factor: of S + H0; variance: of the residuals.
 * False for NaN. Cost: a solve. */
bool pvid_estimator_is_in_dead_zone_f32(const pvid_estimator_f32 *self, const pvid_cholesky_f32 *factor,
                                        const float force[], float variance);

/* Where p is absurd a residual sum overflows or is no number; so far up no standard error made of it does. */
#define PVID_RESIDUAL_MAX 1.0e30f

/* s^2 of a row: the residual sum of squares, yy + energy but no less than `floor`, over degrees of freedom; row_sd^2
 * while there are none. */
float pvid_estimator_variance_f32(const pvid_estimator_f32 *self, const float sums[], float energy, float floor);

/* Degrees of freedom of the residuals in these sums. */
static inline float pvid_estimator_freedom_f32(const pvid_estimator_f32 *self, const float sums[])
{
    return sums[self->model->n_moments + self->model->n_theta + 1u] - (float)self->model->n_p;
}

/* Sets the variance that the sensors' noise gives the rows of the current group; call it when the group is
 * complete, before its solve begins. For models without their own project, as the next two. */
void pvid_estimator_set_expected_f32(pvid_estimator_f32 *self, float variance);

/* Residual variance of all rows in these sums over its expectation; 0 without degrees of freedom, or if rounding
 * dominates the residuals. */
float pvid_estimator_misfit_f32(const pvid_estimator_f32 *self, const float sums[]);

/* Whether rounding may dominate the residual sum because p has moved far with these sums. */
bool pvid_estimator_is_rounded_f32(const pvid_estimator_f32 *self);

/* estimate->kappa and least_pivot from S, the upper triangle s. */
void pvid_estimator_find_kappa_f32(const pvid_estimator_f32 *self, const float s[][PVID_MAX_P],
                                   pvid_estimate_f32 *estimate);

/* Factors S / wide + 1 / start_sd^2, times wide; s is used up. Returns whether it could be done. */
bool pvid_estimator_factor_wide_f32(const pvid_estimator_f32 *self, float s[][PVID_MAX_P], float wide,
                                    pvid_cholesky_f32 *factor);

/* Multiplies estimate->covariance, the inverse of that factor, by `wide` and takes its roots; the start's standard
 * deviations if `known` is false or the result is not finite. */
void pvid_estimator_scale_f32(const pvid_estimator_f32 *self, float wide, bool known, pvid_estimate_f32 *estimate);

#endif
