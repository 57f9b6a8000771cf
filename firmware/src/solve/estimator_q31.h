/* What the parts of the fixed-point estimator share: the system S dp = F, and the parameters' own. Private to the core.
 */
#ifndef PVID_PRIVATE_ESTIMATOR_Q31_H
#define PVID_PRIVATE_ESTIMATOR_Q31_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "solve/cholesky_q31.h"
#include "solve/information_q31.h"
#include "number/integer_q31.h"
#include "pvid/estimator_q31.h"

#define PVID_CLAMP_LIMIT (2 * PVID_SUM_LIMIT) /* of |b|, rr and their change by a step */
#define PVID_ROW_SD_BITS 8                    /* format of row_sd beyond Y's */
#define PVID_SIZE_BITS 22                     /* of the size of a step: |dp| in it still is an int64 */
#define PVID_S_BITS 32                        /* of the unit of s; see pvid_estimator_solve_q31 */
#define PVID_ZERO_EXPONENT_Q31 (-200)         /* exponent of 0: never the largest */

static inline bool pvid_is_positive_q31(const pvid_model_q31 *model, size_t i)
{
    return ((model->positive >> i) & 1u) != 0u;
}

/* Bits of |x|, or PVID_ZERO_EXPONENT_Q31. */
static inline int32_t pvid_length_q31(int64_t x)
{
    return (x == 0) ? PVID_ZERO_EXPONENT_Q31 : (int32_t)pvid_bit_length_q31(pvid_magnitude_q31(x));
}

/* One past the last non-zero of the column of C that starts at `start`. */
static inline size_t pvid_column_end_q31(const pvid_model_q31 *model, size_t start)
{
    size_t k = start;
    while ((k < model->n_c) && (model->c_column[k] == model->c_column[start])) {
        k++;
    }
    return k;
}

static inline const int64_t *pvid_b_of_q31(const pvid_information_q31 *information)
{
    return &information->sums[((size_t)information->n_sums - 2u) - information->n_theta];
}

/* (sd 2^exponent / start_sd)^2 = prior 2^-(returned), prior of 31 bits; 0 < sd < 2^31. */
int32_t pvid_square_ratio_q31(int32_t sd, int32_t exponent, int32_t start_sd, int32_t *prior);

/* *e = Y - N^T theta of a row; returns whether N, Y and e fit, that is whether the row may be added. |e| < 2^45. */
bool pvid_estimator_innovation_q31(const pvid_estimator_q31 *self, const int32_t n[], int32_t y, int64_t *e);

/* The same, and term[n_theta]: each N_i theta_i, |term| <= 2^40. */
bool pvid_estimator_terms_q31(const pvid_estimator_q31 *self, const int32_t n[], int32_t y, int64_t term[], int64_t *e);

/* Takes a row in that fits, with its innovation e and e^2. */
void pvid_estimator_add_row_q31(pvid_estimator_q31 *self, const int32_t n[], int32_t e, int64_t square);

/* Sets theta = f(p) and its mantissas and shifts for rows. */
void pvid_estimator_set_theta_q31(pvid_estimator_q31 *self, const int64_t theta[]);

/* s^2 of a row: residual sum of squares over degrees of freedom, no less than the sensors' noise explains, row_sd^2
 * while there are none; divided by 4^exponent as the sums are. */
pvid_scaled_q31 pvid_estimator_variance_q31(const pvid_estimator_q31 *self);

/* Sets the variance >= 0 that the sensors' noise gives the rows of the current group [units of Y's integer
 * squared]; call it when the group is complete, before its solve begins. */
void pvid_estimator_set_expected_q31(pvid_estimator_q31 *self, pvid_scaled_q31 variance);

/* row_sd^2 as that. */
pvid_scaled_q31 pvid_estimator_expected_variance_q31(const pvid_estimator_q31 *self);

/* ---- the parts of an assessment ---- */

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

/* ---- the system ---- */

/* s minus the margin times the information in C^T M C of noise of solve->variance. */
void pvid_system_without_noise_q31(const pvid_estimator_q31 *self, const pvid_estimator_solve_q31 *solve,
                                   int64_t rest[][PVID_MAX_P]);

/* h: powers of two that scale M's diagonal to [2^28, 2^30). */
void pvid_system_exponents_q31(const pvid_information_q31 *information, int16_t h[]);

/* m: the packed M with these exponents, its rows from `row` on, a few; returns the next row. */
size_t pvid_system_scale_rows_q31(const pvid_information_q31 *information, const int16_t h[], size_t row, int32_t m[]);

/* c and f: C at p, its rows scaled as M's, the largest entry of a column of 29 bits. */
void pvid_system_jacobian_q31(const pvid_estimator_q31 *self, const int16_t h[], int32_t c[], int16_t f[]);

/* Row a of s = C^T M C from its diagonal entry on, `start` the first non-zero of column a; returns that of the next. */
size_t pvid_system_project_q31(const pvid_model_q31 *model, const int32_t m[], const int32_t c[], size_t start,
                               int64_t s[]);

/* H0 = prior 2^-prior_exponent in the unit of s. */
int64_t pvid_system_prior_q31(int32_t prior, int32_t prior_exponent, int32_t f);

/* q: s with an equilibrated diagonal for Cholesky, q_ab = s_ab 2^-(g_a + g_b). */
void pvid_system_equilibrate_q31(uint8_t n_p, const int64_t s[][PVID_MAX_P], int16_t g[], int32_t q[][PVID_MAX_P]);

/* Calls of pvid_system_scale_rows_q31 that scale all of M. */
size_t pvid_system_row_stages_q31(size_t n_theta);

/* Whether init has accepted a configuration. */
static inline bool pvid_estimator_is_ready_q31(const pvid_estimator_q31 *self)
{
    const bool ready = (self != NULL) && (self->model != NULL);
    PVID_ASSERT(ready);
    return ready;
}

#endif
