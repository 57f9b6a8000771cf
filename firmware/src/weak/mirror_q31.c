#include "weak/mirror_q31.h"

#include "number/integer_q31.h"

#define NEWTON_STEPS 4u

int32_t pvid_weak_block_q31(size_t n, int32_t x[])
{
    uint32_t all = 0;
    for (size_t i = 0; i < n; i++) {
        all |= (uint32_t)((x[i] < 0) ? -x[i] : x[i]);
    }
    if (all == 0u) {
        return 0;
    }
    const int32_t exponent = (int32_t)pvid_bit_length_q31(all) - PVID_WEAK_COLUMN_BITS_Q31;
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

/* Newton's method for y = 1 / sqrt(x), 1/4 <= x <= 1: y (3 - x y^2) / 2, from a straight line that is 12 % off at most.
 * x in Q30, y in Q29, the rest in Q28. */
pvid_scaled_q31 pvid_weak_inverse_root_q31(pvid_scaled_q31 x)
{
    const bool odd = ((x.e % 2) != 0);
    const int32_t m = odd ? pvid_floor_shift_32_q31(x.m, 1) : x.m;
    const int32_t exponent = x.e + (odd ? 31 : 30);
    int32_t y = 1181116006 - (5 * pvid_floor_shift_32_q31(m, 3)); /* 2.2 - 1.25 x */
    for (uint32_t i = 0; i < NEWTON_STEPS; i++) {
        const int32_t square = (int32_t)pvid_floor_shift_q31(pvid_square_q31(y), 30);
        const int32_t part = (int32_t)pvid_floor_shift_q31(pvid_product_q31(m, square), 30);
        y = (int32_t)pvid_floor_shift_q31(pvid_product_q31(y, 805306368 - part), 29); /* 3 in Q28 */
    }
    const pvid_scaled_q31 root = {y, -(exponent / 2) - 29};
    return root;
}

void pvid_weak_mirror_of_q31(size_t n, int32_t x[])
{
    int64_t square = 0;
    for (size_t i = 0; i < n; i++) {
        square += pvid_square_q31(x[i]);
    }
    if (square == 0) {
        return;
    }
    const pvid_scaled_q31 inverse = pvid_weak_inverse_root_q31(pvid_scaled_of_q31(square, 0));
    const uint32_t shift = (uint32_t)(-(inverse.e + 30));
    const int64_t first = pvid_round_shift_q31(pvid_product_q31(x[0], inverse.m), shift);
    const int64_t size = pvid_clamp_q31((first < 0) ? -first : first, PVID_ONE_Q30);
    /* u = x / |x|, v = (u + e_0) / sqrt(1 + u_0) */
    const pvid_scaled_q31 half = pvid_weak_inverse_root_q31(pvid_scaled_of_q31(PVID_ONE_Q30 + size, -30));
    const int32_t both = (int32_t)pvid_floor_shift_q31(PVID_ONE_Q30 + size, 1);
    for (size_t i = 1; i < n; i++) {
        const int32_t u = (int32_t)pvid_round_shift_q31(pvid_product_q31(x[i], inverse.m), shift);
        x[i] = (int32_t)pvid_round_shift_q31(pvid_product_q31(u, half.m), 30);
    }
    const int32_t top = (int32_t)pvid_round_shift_q31(pvid_product_q31(both, half.m), 29);
    x[0] = (first < 0) ? -top : top;
}

/* Partial sums are within |v| |x|, results within |x|. */
void pvid_weak_mirror_q31(const int32_t v[], size_t n, int32_t x[])
{
    int64_t sum = 0;
    for (size_t i = 0; i < n; i++) {
        sum += pvid_product_q31(v[i], x[i]);
    }
    const int32_t along = (int32_t)pvid_round_shift_q31(sum, 30);
    for (size_t i = 0; i < n; i++) {
        x[i] -= (int32_t)pvid_floor_shift_q31(pvid_product_q31(v[i], along), 30);
    }
}
