/* Reflections (Householder): x - v (v^T x) with |v|^2 = 2, v in Q30. Private to the core. */
#ifndef PVID_WEAK_MIRROR_Q31_H
#define PVID_WEAK_MIRROR_Q31_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/scaled_q31.h"

/* Bits of a column's largest entry: its length is then below 2^30.2 with 80 entries, and no reflection overflows. */
#define PVID_WEAK_COLUMN_BITS_Q31 27

/* x[n] 2^(returned) = the same before, the largest of PVID_WEAK_COLUMN_BITS_Q31 bits. */
int32_t pvid_weak_block_q31(size_t n, int32_t x[]);

/* 1 / sqrt(x), x.m > 0. */
pvid_scaled_q31 pvid_weak_inverse_root_q31(pvid_scaled_q31 x);

/* x[n] of PVID_WEAK_COLUMN_BITS_Q31 bits becomes the v of the reflection that leaves of it its first entry alone; 0
 * stays 0: no reflection. */
void pvid_weak_mirror_of_q31(size_t n, int32_t x[]);

/* Reflects x[n]. */
void pvid_weak_mirror_q31(const int32_t v[], size_t n, int32_t x[]);

#endif
