/* Reflections (Householder): x - v (v^T x) with |v|^2 = 2, v in Q30. Private to the core. */
#ifndef PVID_WEAK_REFLECTION_Q31_H
#define PVID_WEAK_REFLECTION_Q31_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/scaled_q31.h"

/* A block is a column whose largest entry has 26 bits, or 25 with more than 43 entries.
 *
 * x[n] 2^(returned) = the same before; x becomes a block. */
int32_t pvid_weak_block_q31(size_t n, int32_t x[]);

/* A block x[n] becomes the v of the reflection that leaves of it its first entry alone; 0
 * stays 0: no reflection. */
void pvid_weak_reflector_of_q31(size_t n, int32_t x[]);

/* Reflects x[n], which was a block before the reflections so far. */
void pvid_weak_reflect_q31(const int32_t v[], size_t n, int32_t x[]);

#endif
