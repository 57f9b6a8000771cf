/* elementary_q31: sine and cosine of any integer in every format, signs, limits, and the same of numbers of any size
 * and either sign. */
#include "prove.h"

#include "contracts.h"

#include "pvid/elementary_q31.h"

static void any_angle(uint32_t bits)
{
    const int32_t sine = pvid_sin_q31(any_i32(INT32_MIN, INT32_MAX), bits);
    /*@ assert -0x40000000 <= sine <= 0x40000000; */
    const int32_t cosine = pvid_cos_q31(any_i32(INT32_MIN, INT32_MAX), bits);
    /*@ assert -0x40000000 <= cosine <= 0x40000000; */
}

static void any_number(int32_t lowest, int32_t highest)
{
    for (int32_t e = -100; e <= 40; e++) {
        const pvid_scaled_q31 a = {any_i32(lowest, highest), e};
        (void)pvid_scaled_sin_q31(a);
        (void)pvid_scaled_cos_q31(a);
        (void)pvid_scaled_sign_q31(a);
        (void)pvid_scaled_magnitude_q31(a);
        const pvid_scaled_q31 above = {any_i32(1, PVID_ONE_Q30), -e};
        const pvid_scaled_q31 below = {any_i32(-PVID_ONE_Q30, -1), e};
        const pvid_scaled_q31 none = {0, e};
        (void)pvid_scaled_quotient_q31(a, above);
        (void)pvid_scaled_quotient_q31(a, below);
        (void)pvid_scaled_quotient_q31(a, none);
    }
}

void main(void)
{
    for (uint32_t bits = 0; bits <= 30u; bits++) {
        any_angle(bits);
    }
    (void)pvid_sign_q31(any_i32(INT32_MIN, INT32_MAX));
    const int32_t soft = pvid_soft_sign_q31(any_i32(-PVID_ONE_Q30, PVID_ONE_Q30), any_i32(1, INT32_MAX));
    /*@ assert -0x40000000 <= soft <= 0x40000000; */
    int32_t limit[3] = {any_i32(0, INT32_MAX), any_i32(0, INT32_MAX), any_i32(0, INT32_MAX)};
    int32_t x[3] = {any_i32(INT32_MIN, INT32_MAX), any_i32(INT32_MIN, INT32_MAX), any_i32(INT32_MIN, INT32_MAX)};
    (void)pvid_within_limits_q31(x, limit, 3);
    any_number(-PVID_ONE_Q30, -1);
    any_number(0, 0);
    any_number(1, PVID_ONE_Q30);
}
