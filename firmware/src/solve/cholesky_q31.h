/* Cholesky factorisation of a small symmetric matrix in Q30, equilibrated by powers of two. Private to the core. */
#ifndef PVID_CHOLESKY_Q31_H
#define PVID_CHOLESKY_Q31_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "number/integer_q31.h"
#include "pvid/estimator_q31.h"

/* A pivot below 2^-20 of its diagonal entry is rounding, not data. */
#define PVID_PIVOT_SHIFT 20u

/* Numbers of a system of more than 8 unknowns have a bit less: sums of n squares and of n - 1 products with 30 bits
 * stay below 2^63. A model's bits depend on its own n, not on PVID_MAX_P. */
static inline uint32_t pvid_spare_bits_q31(uint32_t n)
{
    return ((PVID_MAX_P > 8) && (n > 8u)) ? 1u : 0u;
}

/* Bits of a right-hand side. */
static inline int32_t pvid_rhs_bits_q31(uint32_t n)
{
    return 20 - (int32_t)pvid_spare_bits_q31(n);
}

/* Largest |x| of a solution and of a column of U^-1. A pivot is 2^-22 or more, so that an entry of 1 makes an x of 2^11
 * at most where one pivot is small. */
static inline int32_t pvid_x_max_q31(uint32_t n)
{
    return PVID_ONE_Q30 >> pvid_spare_bits_q31(n);
}

/* e such that diagonal 2^(-2 e) lies in [2^28, 2^30), for diagonal > 0; -15 for 0. */
int32_t pvid_half_exponent_q31(int64_t diagonal);

/* The pivot's test: diagonal in Q30, pivot in Q60. */
bool pvid_pivot_is_significant_q31(int64_t pivot, int32_t diagonal);

/* total 2^-30 times the reciprocal in Q30, within +-limit, limit < 2^31. */
int32_t pvid_divide_q31(int64_t total, pvid_reciprocal_q31 inverse, int32_t limit);

/* The same in steps: begin, then eliminate index j = n - 1 .. 0; `positive` is false after a failure. */
void pvid_cholesky_begin_q31(pvid_cholesky_q31 *self, uint8_t n);
void pvid_cholesky_eliminate_q31(pvid_cholesky_q31 *self, const int32_t s[][PVID_MAX_P], size_t j);

/* The least relative pivot of the factor of s, Q30. */
int32_t pvid_cholesky_least_pivot_q31(const pvid_cholesky_q31 *self, const int32_t s[][PVID_MAX_P]);

/* Factors the n x n matrix with the upper triangle s, diagonal in [2^28, 2^30), the others within +-2^30. Fails
 * (returns false, first_pivot = 0) iff a diagonal entry is below 2^28 or a relative pivot is below
 * 2^-PVID_PIVOT_SHIFT. */
bool pvid_cholesky_factor_q31(pvid_cholesky_q31 *self, uint8_t n, const int32_t s[][PVID_MAX_P]);

/* x[n] = U^-1 rhs, |rhs| < 2^pvid_rhs_bits_q31(n). */
void pvid_cholesky_lower_q31(const pvid_cholesky_q31 *self, const int32_t rhs[], int32_t x[]);

/* x[n] 2^(returned) = S^-1 rhs, |rhs| < INT64_MAX. */
int32_t pvid_cholesky_solve_q31(const pvid_cholesky_q31 *self, const int64_t rhs[], int32_t x[]);

/* out[n] 2^(returned) = x, the largest of `bits` bits, bits <= 30; |x| < INT64_MAX. */
int32_t pvid_to_block_q31(uint32_t n, const int64_t x[], int32_t bits, int32_t out[]);

#endif
