/* The system S dp = F of the fixed-point estimator, made of the sums. Private to the core. */
#ifndef PVID_SOLVE_SYSTEM_Q31_H
#define PVID_SOLVE_SYSTEM_Q31_H

#include "solve/state_q31.h"

/* (sd 2^exponent / start_sd)^2 = prior 2^-(returned), prior of 31 bits; 0 < sd < 2^31. */
int32_t pvid_square_ratio_q31(int32_t sd, int32_t exponent, int32_t start_sd, int32_t *prior);

/* s minus noise_margin times the information of noise of solve->variance. */
void pvid_system_without_noise_q31(const pvid_estimator_q31 *self, const pvid_estimator_solve_q31 *solve,
                                   int64_t rest[][PVID_MAX_P]);

/* h: powers of two that bring M's diagonal into [2^28, 2^30). */
void pvid_system_exponents_q31(const pvid_information_q31 *information, const pvid_model_q31 *model, int16_t h[]);

/* m: the packed M with these exponents, its rows from `row` on, a few; returns the next row. */
size_t pvid_system_scale_rows_q31(const pvid_information_q31 *information, const pvid_model_q31 *model,
                                  const int16_t h[], size_t row, int32_t m[]);

/* The row that it returns. */
size_t pvid_system_rows_end_q31(const pvid_model_q31 *model, size_t row);

/* Bits that entries of C and steps of theta have less than 29, so that sums over theta do not overflow. */
int32_t pvid_system_guard_bits_q31(size_t n_theta);

/* c and f: C at p, its rows scaled as M's, the largest entry of a column of 29 bits less the guard bits. */
void pvid_system_jacobian_q31(const pvid_estimator_q31 *self, const int16_t h[], int32_t c[], int16_t f[]);

/* Row a of s = C^T M C from its diagonal entry on, `start` the first non-zero of column a; returns that of the next. */
size_t pvid_system_project_q31(const pvid_model_q31 *model, const int32_t m[], const int32_t c[], size_t start,
                               int64_t s[]);

/* H0 = prior 2^-prior_exponent in the unit of s. */
int64_t pvid_system_prior_q31(int32_t prior, int32_t prior_exponent, int32_t f);

/* q: s equilibrated for the Cholesky factorisation, q_ab = s_ab 2^-(g_a + g_b). */
void pvid_system_equilibrate_q31(uint8_t n_p, const int64_t s[][PVID_MAX_P], int16_t g[], int32_t q[][PVID_MAX_P]);

/* Equilibrates s, which may be that of the system, and begins its factor. */
void pvid_system_begin_factor_q31(pvid_system_q31 *system, uint8_t n_p, const int64_t s[][PVID_MAX_P]);

/* Eliminates a few parameters of the factor of q, from the last: part 0, then 1 .. */
#define PVID_PIVOTS_PER_PART 2u
void pvid_system_eliminate_q31(pvid_system_q31 *system, size_t n_p, size_t part);

/* Calls of pvid_system_scale_rows_q31 that scale all of M. */
size_t pvid_system_row_stages_q31(const pvid_model_q31 *model);

#endif
