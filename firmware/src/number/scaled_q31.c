#include "number/scaled_q31.h"

#define DIGITS 30
#define LEAST_OF_NORMAL ((uint32_t)1 << 26) /* upper half of the least product of two numbers of all digits */

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
    return pvid_scaled_of_q31(((int64_t)more.m * PVID_ONE_Q30) + pvid_scale_q31(wide, more.e - less.e), more.e - 30);
}

pvid_scaled_q31 pvid_scaled_times_q31(pvid_scaled_q31 a, pvid_scaled_q31 b)
{
    const int64_t product = pvid_short_product_q31(a.m, b.m);
    const uint32_t high = (uint32_t)(pvid_magnitude_q31(product) >> 32);
    if ((high < LEAST_OF_NORMAL) || (high >= (4u * LEAST_OF_NORMAL))) { /* 0, or a factor of fewer or more digits */
        return pvid_scaled_of_q31(product, a.e + b.e);
    }
    const bool longer = high >= (2u * LEAST_OF_NORMAL);
    const int64_t m = longer ? pvid_round_shift_q31(product, 30) : pvid_round_shift_q31(product, 29);
    const pvid_scaled_q31 result = {(int32_t)m, a.e + b.e + (longer ? 30 : 29)};
    return result;
}

pvid_scaled_q31 pvid_scaled_over_q31(pvid_scaled_q31 a, pvid_scaled_q31 b)
{
    const uint64_t quotient = pvid_quotient_q31((uint64_t)pvid_magnitude_q31(a.m) << 30, (uint32_t)b.m); /* towards 0 */
    return pvid_scaled_of_q31((a.m < 0) ? -(int64_t)quotient : (int64_t)quotient, (a.e - b.e) - 30);
}
