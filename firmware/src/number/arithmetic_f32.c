#include "number/uncontracted.h"

#include "pvid/arithmetic.h"

#include <math.h>

#include "number/finite_f32.h"
#include "number/unroll.h"

/* volatile: the compiler must not compute the result itself. */
PVID_COLD uint32_t pvid_arithmetic_faults_f32(void)
{
    uint32_t faults = 0;
    const volatile float a = 1.0f + 1.1920929e-7f; /* 1 + 2^-23 */
    const volatile float minus_rounded_square = -(1.0f + 2.3841858e-7f);
    const volatile float fused = (a * a) + minus_rounded_square; /* 2^-46 if fused, else 0 */
    if (fused > 0.0f) {
        faults |= 1u;
    }
    const volatile float smallest_normal = PVID_LEAST_NORMAL_F32;
    const volatile float half = 0.5f;
    const volatile float subnormal = smallest_normal * half;
    if (pvid_bits_f32(subnormal) != 0x00400000u) {
        faults |= 2u;
    }
    const volatile float one = 1.0f;
    const volatile float tie_to_even = 5.9604645e-8f; /* 2^-24: half an ulp of 1 */
    const volatile float above_tie = 5.9604652e-8f;   /* next float above */
    const volatile float sum_even = one + tie_to_even;
    const volatile float sum_odd = a + tie_to_even;
    const volatile float sum_up = one + above_tie;
    if ((pvid_bits_f32(sum_even) != 0x3F800000u) || (pvid_bits_f32(sum_odd) != 0x3F800002u) ||
        (pvid_bits_f32(sum_up) != 0x3F800001u)) {
        faults |= 4u;
    }
    const volatile float two = 2.0f;
    const volatile float root = sqrtf(two);
    if (pvid_bits_f32(root) != 0x3FB504F3u) {
        faults |= 8u;
    }
    const volatile float three = 3.0f;
    const volatile float third = one / three;
    if (pvid_bits_f32(third) != 0x3EAAAAABu) {
        faults |= 16u;
    }
    /* 2^24 + 1 = 2^24 in either rounding direction (0 or 2 remains), unless the sum is reordered. */
    const volatile float two_to_24 = 16777216.0f;
    const float small = one;
    const float large = two_to_24;
    const volatile float left = (small + large) - large;
    if (pvid_bits_f32(left) == 0x3F800000u) {
        faults |= 32u;
    }
    return faults;
}
