/* A row of the fixed-point estimator, its innovation, and theta. Private to the core. */
#ifndef PVID_SOLVE_ROW_Q31_H
#define PVID_SOLVE_ROW_Q31_H

#include "solve/state_q31.h"

/* *e = Y - N^T theta of a row of the kind with this block (information_q31.h), n of its entries. Returns whether N, Y
 * and e fit, so that the row can be added. |e| < 2^45. */
bool pvid_estimator_innovation_q31(const pvid_estimator_q31 *self, const pvid_block *block, const int32_t n[],
                                   int32_t y, int64_t *e);

/* The same, and term: each N_i theta_i of the kind, |term| <= 2^40. */
bool pvid_estimator_terms_q31(const pvid_estimator_q31 *self, const pvid_block *block, const int32_t n[], int32_t y,
                              int64_t term[], int64_t *e);

/* Adds such a row, which fits, with its innovation e and e^2. */
void pvid_estimator_add_row_q31(pvid_estimator_q31 *self, const pvid_block *block, const int32_t n[], int32_t e,
                                int64_t square);

/* Sets the variance >= 0 of the current group's rows by the sensors' noise [units of Y's integer squared]. Call it when
 * the group is complete, before its solve begins. */
void pvid_estimator_set_expected_q31(pvid_estimator_q31 *self, pvid_scaled_q31 variance);

/* theta[n_theta] = f(p) in the formats of the estimator. */
void pvid_estimator_theta_q31(const pvid_estimator_q31 *self, const int32_t p[], int64_t theta[]);

/* Sets theta = f(p) and its mantissas and shifts for the innovation of rows. */
void pvid_estimator_set_theta_q31(pvid_estimator_q31 *self, const int64_t theta[]);

#endif
