/* How far p can be trusted, from S and the residuals: pure functions, for both engines. Private to the core. */
#ifndef PVID_ASSESS_F32_H
#define PVID_ASSESS_F32_H

#include "solve/cholesky_f32.h"
#include "solve/state_f32.h"

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

/* s^2 of a row: the residual sum of squares, yy + energy but no less than `floor`, over degrees of freedom; row_sd^2
 * while there are none. */
float pvid_estimator_variance_f32(const pvid_estimator_f32 *self, const float sums[], float energy, float floor);

/* Degrees of freedom of the residuals in these sums. */
static inline float pvid_estimator_freedom_f32(const pvid_estimator_f32 *self, const float sums[])
{
    return sums[self->model->n_moments + self->model->n_theta + 1u] - (float)self->model->n_p;
}

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

#endif
