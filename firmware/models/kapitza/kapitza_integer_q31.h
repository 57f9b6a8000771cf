/* What the strong form's integer code shares: places in a row and in the sums, products in the formats of a solve.
 * Private to the core, inlined. */
#ifndef PVID_KAPITZA_INTEGER_Q31_H
#define PVID_KAPITZA_INTEGER_Q31_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "kapitza_places.h"
#include "number/integer_q31.h"
#include "pvid/kapitza_strong_q31.h"

/* Places in a row; the powers of G descend there, as in the paper. */
enum { PVID_ROW_A = 0, PVID_ROW_E = 1, PVID_ROW_X = 2, PVID_ROW_Z = 6, PVID_ROW_Y = PVID_KAPITZA_ROW_Y };

/* x 2^-s rounded half up, |x| < 2^62, 1 <= s <= 62. */
static inline int64_t pvid_nearest_q31(int64_t x, uint32_t s)
{
    return pvid_floor_shift_q31(x + ((int64_t)1 << (s - 1u)), s);
}

/* A number with 30 bits after the point in the accumulator of a solve, without them. */
static inline int32_t pvid_out_q31(int64_t x)
{
    return (int32_t)pvid_nearest_q31(x, 30);
}

/* a b in the format of a, b in Q30, both as pvid_short_product_q31. */
static inline int32_t pvid_part_q31(int32_t a, int32_t b)
{
    return pvid_out_q31(pvid_short_product_q31(a, b));
}

static inline int32_t pvid_larger_q31(int32_t a, int32_t b)
{
    return (a > b) ? a : b;
}

/* x 2^shift rounded half up, |.| < 2^31 by the caller's choice; shift <= 30. */
static inline int32_t pvid_moved_q31(int32_t x, int32_t shift)
{
    if (shift >= 0) {
        return x * (int32_t)((uint32_t)1 << (uint32_t)shift);
    }
    if (shift < -31) {
        return 0;
    }
    const int32_t above = pvid_floor_shift_32_q31(x, (uint32_t)-shift - 1u); /* its last bit is the half */
    return pvid_floor_shift_32_q31(above, 1) + (int32_t)((uint32_t)above & 1u);
}

#endif
