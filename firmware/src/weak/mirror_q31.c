#include "weak/mirror_q31.h"

#include "number/integer_q31.h"
#include "number/scaled_q31.h"

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

void pvid_weak_mirror_of_q31(size_t n, int32_t x[])
{
    int64_t square = 0;
    for (size_t i = 0; i < n; i++) {
        square += pvid_square_q31(x[i]);
    }
    if (square == 0) {
        return;
    }
    const pvid_scaled_q31 inverse = pvid_inverse_root_q31(pvid_scaled_of_q31(square, 0));
    /* |x| is 2^26 to 2^30.2: e is -59 to -55 */
    const int32_t up = (int32_t)((uint32_t)1 << (uint32_t)(inverse.e + 59));
    const int32_t first = up * pvid_upper_product_q31(8 * x[0], inverse.m);
    const int32_t size = (first < 0) ? -first : first;
    const int32_t within = (size < PVID_ONE_Q30) ? size : PVID_ONE_Q30;
    /* u = x / |x|, v = (u + e_0) / sqrt(1 + u_0) */
    const pvid_scaled_q31 half = pvid_inverse_root_q31(pvid_scaled_of_q31((int64_t)PVID_ONE_Q30 + within, -30));
    const int32_t both = (PVID_ONE_Q30 / 2) + pvid_floor_shift_32_q31(within, 1);
    for (size_t i = 1; i < n; i++) {
        const int32_t u = up * pvid_upper_product_q31(8 * x[i], inverse.m);
        x[i] = 4 * pvid_upper_product_q31(u, half.m);
    }
    const int32_t top = 8 * pvid_upper_product_q31(both, half.m);
    x[0] = (first < 0) ? -top : top;
}

/* Partial sums are within |v| |x| / 4, four of them within |v| |x|, results within |x|. An upper half is short of its
 * product by half a unit in the mean, which is made up for. */
void pvid_weak_mirror_q31(const int32_t v[], size_t n, int32_t x[])
{
    int32_t sum = (int32_t)(n / 2u);
    for (size_t i = 0; i < n; i++) {
        sum += pvid_upper_product_q31(v[i], x[i]);
    }
    const int32_t along = 4 * sum;
    for (size_t i = 0; i < n; i++) {
        x[i] -= (4 * pvid_upper_product_q31(v[i], along)) + 2;
    }
}
