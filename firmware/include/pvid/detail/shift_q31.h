/* Shifts of signed numbers, rounded; for the fixed-point core and the functions that `pvid model build` writes. Not
 * API. */
#ifndef PVID_DETAIL_SHIFT_Q31_H
#define PVID_DETAIL_SHIFT_Q31_H

#include <stdint.h>

/* Greatest integer not above x 2^-s, s <= 63, any x. Only these two functions shift a signed number right: C99
 * leaves the result for negative numbers to the compiler, and every compiler for the targets repeats the sign.
 * MISRA deviation: 10.1, checked by the assertion below. */
static inline int64_t pvid_floor_shift_q31(int64_t x, uint32_t s)
{
    return x >> s;
}

typedef char pvid_shift_repeats_the_sign[((-5 >> 1) == -3) ? 1 : -1];

/* The same for 32 bits, s <= 31. */
static inline int32_t pvid_floor_shift_32_q31(int32_t x, uint32_t s)
{
    return x >> s;
}

/* x 2^-s rounded half up; any s >= 0, x < INT64_MAX. */
static inline int64_t pvid_round_shift_q31(int64_t x, uint32_t s)
{
    if (s == 0u) {
        return x;
    }
    return (s > 63u) ? 0 : pvid_floor_shift_q31(pvid_floor_shift_q31(x, s - 1u) + 1, 1);
}

#endif
