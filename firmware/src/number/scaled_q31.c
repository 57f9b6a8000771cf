#include "number/scaled_q31.h"

#define DIGITS 30
#define NEWTON_STEPS 4u
#define LEAST ((int64_t)1 << 58) /* product of two numbers of all digits */
#define LONGER ((int64_t)1 << 59)

pvid_scaled_q31 pvid_scaled_of_q31(int64_t x, int32_t exponent)
{
    const int32_t shift = (int32_t)pvid_bit_length_q31(pvid_magnitude_q31(x)) - DIGITS;
    const int64_t m = (shift >= 0) ? pvid_round_shift_q31(x, (uint32_t)shift) : pvid_scale_q31(x, shift);
    const pvid_scaled_q31 result = {(int32_t)m, exponent + shift};
    return result;
}

pvid_scaled_q31 pvid_scaled_plus_q31(pvid_scaled_q31 a, pvid_scaled_q31 b)
{
    if ((a.m == 0) || (b.m == 0)) {
        return (a.m == 0) ? b : a;
    }
    const pvid_scaled_q31 more = (a.e >= b.e) ? a : b;
    const pvid_scaled_q31 less = (a.e >= b.e) ? b : a;
    const int64_t wide = (int64_t)less.m * PVID_ONE_Q30;
    return pvid_scaled_of_q31(
        ((int64_t)more.m * PVID_ONE_Q30) + pvid_round_shift_q31(wide, (uint32_t)(more.e - less.e)), more.e - 30);
}

pvid_scaled_q31 pvid_scaled_times_q31(pvid_scaled_q31 a, pvid_scaled_q31 b)
{
    const int64_t product = pvid_short_product_q31(a.m, b.m);
    const int32_t e = a.e + b.e;
    pvid_scaled_q31 result;
    if (((product >= LONGER) && (product <= (2 * LONGER))) || ((product <= -LONGER) && (product >= (-2 * LONGER)))) {
        result.m = (int32_t)pvid_round_shift_q31(product, 30);
        result.e = e + 30;
    } else if (((product >= LEAST) && (product < LONGER)) || ((product <= -LEAST) && (product > -LONGER))) {
        result.m = (int32_t)pvid_round_shift_q31(product, 29);
        result.e = e + 29;
    } else { /* 0, or a factor of fewer digits */
        result = pvid_scaled_of_q31(product, e);
    }
    return result;
}

pvid_scaled_q31 pvid_scaled_over_q31(pvid_scaled_q31 a, pvid_scaled_q31 b)
{
    const uint64_t quotient = pvid_quotient_q31((uint64_t)pvid_magnitude_q31(a.m) << 30, (uint32_t)b.m); /* towards 0 */
    return pvid_scaled_of_q31((a.m < 0) ? -(int64_t)quotient : (int64_t)quotient, (a.e - b.e) - 30);
}

/* Newton's method for y = 1 / sqrt(x), 1/4 <= x <= 1: y (3 - x y^2) / 2, from a straight line that is 12 % off at most.
 * x in Q30, y in Q29, the rest in Q28. */
pvid_scaled_q31 pvid_inverse_root_q31(pvid_scaled_q31 x)
{
    const bool odd = ((x.e % 2) != 0);
    const int32_t m = odd ? pvid_floor_shift_32_q31(x.m, 1) : x.m;
    const int32_t exponent = x.e + (odd ? 31 : 30);
    int32_t y = 1181116006 - (5 * pvid_floor_shift_32_q31(m, 3)); /* 2.2 - 1.25 x */
    for (uint32_t i = 0; i < NEWTON_STEPS; i++) {
        const int32_t square = 4 * pvid_upper_product_q31(y, y);
        const int32_t part = 4 * pvid_upper_product_q31(m, square);
        y = 8 * pvid_upper_product_q31(y, 805306368 - part); /* 3 in Q28 */
        y = (y >= PVID_ONE_Q30) ? (PVID_ONE_Q30 - 1) : y;
        y = (y < (PVID_ONE_Q30 / 2)) ? (PVID_ONE_Q30 / 2) : y;
    }
    const pvid_scaled_q31 root = {y, -(exponent / 2) - 29};
    return root;
}
