#include "weak/reflection_q31.h"

#include "number/integer_q31.h"
#include "number/scaled_q31.h"

/* Bits of a column's largest entry, one less with more than MANY entries. Its length times sqrt(2), and with it the
 * result of v^T x, is then below 2^31 - 2^17 less the largest v, 2^30.5: products of v are short ones. */
#define BITS 26
#define MANY 43u

int32_t pvid_weak_block_q31(size_t n, int32_t x[])
{
    uint32_t all = 0;
    for (size_t i = 0; i < n; i++) {
        all |= (uint32_t)((x[i] < 0) ? -x[i] : x[i]);
    }
    if (all == 0u) {
        return 0;
    }
    const int32_t exponent = (int32_t)pvid_bit_length_q31(all) - ((n <= MANY) ? BITS : (BITS - 1));
    if (exponent > 0) {
        for (size_t i = 0; i < n; i++) {
            x[i] = pvid_floor_shift_32_q31(x[i], (uint32_t)exponent);
        }
    } else if (exponent < 0) {
        const int32_t factor = (int32_t)1 << (uint32_t)-exponent;
        for (size_t i = 0; i < n; i++) {
            x[i] *= factor;
        }
    } else {
        /* it is one */
    }
    return exponent;
}

void pvid_weak_reflector_of_q31(size_t n, int32_t x[])
{
    int64_t square = 0;
    for (size_t i = 0; i < n; i++) {
        square += pvid_short_square_q31(x[i]);
    }
    if (square == 0) {
        return;
    }
    const pvid_scaled_q31 inverse = pvid_inverse_root_q31(pvid_scaled_of_q31(square, 0));
    const uint32_t shift = (uint32_t)(-(inverse.e + 30));
    const int64_t first = pvid_round_shift_q31(pvid_short_product_q31(x[0], inverse.m), shift);
    const int64_t size = pvid_clamp_q31((first < 0) ? -first : first, PVID_ONE_Q30);
    /* u = x / |x|, v = (u + e_0) / sqrt(1 + u_0) */
    const pvid_scaled_q31 half = pvid_inverse_root_q31(pvid_scaled_of_q31(PVID_ONE_Q30 + size, -30));
    const int32_t both = (int32_t)pvid_floor_shift_q31(PVID_ONE_Q30 + size, 1);
    for (size_t i = 1; i < n; i++) {
        const int32_t u = (int32_t)pvid_round_shift_q31(pvid_short_product_q31(x[i], inverse.m), shift);
        x[i] = (int32_t)pvid_round_shift_q31(pvid_short_product_q31(u, half.m), 30);
    }
    const int32_t top = (int32_t)pvid_round_shift_q31(pvid_short_product_q31(both, half.m), 29);
    x[0] = (first < 0) ? -top : top;
}

/* Partial sums are within |v| |x|, results within |x|. */
void pvid_weak_reflect_q31(const int32_t v[], size_t n, int32_t x[])
{
    int64_t sum = 0;
    for (size_t i = 0; i < n; i++) {
        sum += pvid_short_product_q31(v[i], x[i]);
    }
    const int32_t along = (int32_t)pvid_round_shift_q31(sum, 30);
    for (size_t i = 0; i < n; i++) {
        x[i] -= (int32_t)pvid_floor_shift_q31(pvid_short_product_q31(v[i], along), 30);
    }
}
