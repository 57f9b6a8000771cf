/* Numbers of any size with 30 bits, what the core alone does with them: the gate compares values beyond the range of an
 * int64. Private to the core. */
#ifndef PVID_NUMBER_SCALED_Q31_H
#define PVID_NUMBER_SCALED_Q31_H

#include <stdbool.h>

#include "number/integer_q31.h"
#include "pvid/scaled_q31.h"

/* a > b, b >= 0: the exponents decide unless they are neighbours. */
static inline bool pvid_scaled_exceeds_q31(pvid_scaled_q31 a, pvid_scaled_q31 b)
{
    if ((a.m <= 0) || (b.m == 0)) {
        return a.m > 0;
    }
    const uint32_t twice_a = (a.e > b.e) ? 1u : 0u;
    const uint32_t twice_b = (b.e > a.e) ? 1u : 0u;
    if ((a.e > (b.e + 1)) || (b.e > (a.e + 1))) {
        return a.e > b.e;
    }
    return ((uint32_t)a.m << twice_a) > ((uint32_t)b.m << twice_b);
}

/* 1 / sqrt(x) within 2^-25 of it, x.m of 30 digits and positive; its m is 2^29 to 2^30 - 1. */
pvid_scaled_q31 pvid_inverse_root_q31(pvid_scaled_q31 x);

/* a 2^exponent. */
static inline pvid_scaled_q31 pvid_scaled_shifted_q31(pvid_scaled_q31 a, int32_t exponent)
{
    const pvid_scaled_q31 result = {a.m, a.e + exponent};
    return result;
}

/* a in one word: 20 bits, and an exponent within +-1000; 0 below that. */
static inline int32_t pvid_scaled_packed_q31(pvid_scaled_q31 a)
{
    if ((a.m == 0) || (a.e < -1000)) {
        return 0;
    }
    return (pvid_floor_shift_32_q31(a.m, 11) * 2048) + (((a.e < 1000) ? a.e : 1000) + 1024);
}

static inline pvid_scaled_q31 pvid_scaled_unpacked_q31(int32_t word)
{
    const int32_t m = pvid_floor_shift_32_q31(word, 11);
    const pvid_scaled_q31 result = {m * 2048, (int32_t)((uint32_t)word & 2047u) - 1024};
    return result;
}

/* a as an integer of `bits` bits after the point, rounded half up, saturated at +-PVID_WIDE. */
static inline int64_t pvid_scaled_fixed_q31(pvid_scaled_q31 a, int32_t bits)
{
    return pvid_scale_q31(a.m, -(a.e + bits));
}

#endif
