/* Accuracy of p from S and the residuals, in integers. Private to the core. */
#ifndef PVID_SOLVE_ASSESS_Q31_H
#define PVID_SOLVE_ASSESS_Q31_H

#include "solve/state_q31.h"

/* s^2 of a row: residual sum of squares over degrees of freedom, at least the variance by the sensors' noise; row_sd^2
 * if there are none. Divided by 4^exponent as the sums are. */
pvid_scaled_q31 pvid_estimator_variance_q31(const pvid_estimator_q31 *self);

/* Sets the variance >= 0 of the current group's rows by the sensors' noise [units of Y's integer squared]. Call it when
 * the group is complete, before its solve begins. */
void pvid_estimator_set_expected_q31(pvid_estimator_q31 *self, pvid_scaled_q31 variance);

/* row_sd^2 as that. */
pvid_scaled_q31 pvid_estimator_expected_variance_q31(const pvid_estimator_q31 *self);

/* Weight, residual and the variances they give. */
void pvid_estimator_residual_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve,
                                 pvid_estimate_q31 *estimate);

/* s += wide^2 / start_sd^2. */
void pvid_estimator_widen_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve);

/* Column a of U^-1 and its length. */
void pvid_estimator_invert_q31(pvid_estimator_solve_q31 *solve, size_t a);

/* Standard error of p[a] and its correlation with those before it, from wide^2 (S + H)^-1. */
void pvid_estimator_errors_q31(const pvid_estimator_q31 *self, const pvid_estimator_solve_q31 *solve, size_t a,
                               pvid_estimate_q31 *estimate);

#endif
