/* Accuracy of p from the normal equations: residual variance, kappa, standard errors. Pure: the results depend on the
 * arguments alone. Private to the core.
 *
 *   pvid_assess_f32(&system, &settings, &estimate);     in one call; the other functions are its stages
 */
#ifndef PVID_ASSESS_F32_H
#define PVID_ASSESS_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "solve/cholesky_f32.h"
#include "pvid/estimator.h"

/* Upper limit of a residual sum, which may overflow far from the solution: standard errors from it are finite. */
#define PVID_RESIDUAL_MAX 1.0e30f

/* s^2 of a row [units of Y^2]: the residual sum of squares with its rounding, at least `floor`, over the degrees of
 * freedom; row_sd^2 if there is none. Cost: a division. */
float pvid_assess_variance_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings);

/* Residual variance over its expectation, which is `floor` over the degrees of freedom; 0 without degrees of freedom,
 * residuals or expectation. Cost: a division. */
float pvid_assess_misfit_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings);

/* Returns whether S contains more information than noise: S - noise_margin Sn is positive definite, where Sn is the
 * information of noise of this variance in so many rows. noise: that of unit variance and one row, upper triangle.
 * Cost: a factorisation. */
bool pvid_assess_above_noise_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings, float variance,
                                 const float noise[][PVID_MAX_P]);

/* Writes estimate->kappa and least_pivot of S; 0 if S cannot be factored. Cost: a factorisation. */
void pvid_assess_kappa_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings,
                           pvid_estimate_f32 *estimate);

/* S += wide / start_sd^2, with wide = correlation s^2. Cost: n_p divisions. */
void pvid_assess_widen_f32(pvid_system_f32 *system, const pvid_solve_settings_f32 *settings, float wide);

/* Multiplies estimate->covariance, the inverse of that S, by `wide` and writes the standard errors. Writes those
 * of the start if `known` is false or a result is not finite. Cost: n_p square roots. */
void pvid_assess_scale_f32(const pvid_solve_settings_f32 *settings, float wide, bool known,
                           pvid_estimate_f32 *estimate);

/* Writes se, covariance, kappa, least_pivot, residual_sd and weight of the estimate; its other fields are the caller's.
 * All are finite, whatever S, which is overwritten. The covariance is (S / (correlation s^2) + 1 / start_sd^2)^-1.
 * Cost: two factorisations and n_p solves. Source: theory.md 4, equation (7). */
void pvid_assess_f32(pvid_system_f32 *system, const pvid_solve_settings_f32 *settings, pvid_estimate_f32 *estimate);

#endif
