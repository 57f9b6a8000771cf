/* Unit vectors, and columns without their components along them. Private to the core. */
#ifndef PVID_FOURIER_DIRECTION_Q31_H
#define PVID_FOURIER_DIRECTION_Q31_H

#include <stddef.h>
#include <stdint.h>

/* Bits of a column's largest entry: 64 products with a unit vector in Q30 add up in 63 bits. */
#define PVID_FOURIER_COLUMN_BITS_Q31 27

/* x[first..last-1] 2^(returned) = the same before, the largest of PVID_FOURIER_COLUMN_BITS_Q31 bits. */
int32_t pvid_fourier_block_q31(int64_t wide[], size_t first, size_t last, int32_t x[]);

/* x - u (u^T x) over the entries first..last-1; u: length 1 in Q30, or 0. */
void pvid_fourier_take_off_q31(const int32_t u[], size_t first, size_t last, int32_t x[]);

/* u = x over its length, in place, x of PVID_FOURIER_COLUMN_BITS_Q31 bits; 0 stays 0. */
void pvid_fourier_normalise_q31(size_t first, size_t last, int32_t x[]);

#endif
