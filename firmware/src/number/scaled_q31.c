#include "number/scaled_q31.h"

#define DIGITS 30

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
    return pvid_scaled_of_q31(pvid_product_q31(a.m, b.m), a.e + b.e);
}

pvid_scaled_q31 pvid_scaled_over_q31(pvid_scaled_q31 a, pvid_scaled_q31 b)
{
    return pvid_scaled_of_q31(((int64_t)a.m * PVID_ONE_Q30) / b.m, (a.e - b.e) - 30);
}
