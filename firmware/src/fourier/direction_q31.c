#include "fourier/direction_q31.h"

#include "number/integer_q31.h"

int32_t pvid_fourier_block_q31(int64_t wide[], size_t first, size_t last, int32_t x[])
{
    uint32_t longest = 0;
    for (size_t i = first; i < last; i++) {
        const uint32_t length = pvid_bit_length_q31(pvid_magnitude_q31(wide[i]));
        longest = (length > longest) ? length : longest;
    }
    const int32_t exponent = (longest > 0u) ? ((int32_t)longest - PVID_FOURIER_COLUMN_BITS_Q31) : 0;
    for (size_t i = first; i < last; i++) {
        x[i] = (int32_t)pvid_scale_q31(wide[i], exponent);
    }
    return exponent;
}

/* |x| is at most 8 2^27 and its length does not grow. */
void pvid_fourier_take_off_q31(const int32_t u[], size_t first, size_t last, int32_t x[])
{
    int64_t sum = 0;
    for (size_t i = first; i < last; i++) {
        sum += pvid_product_q31(u[i], x[i]);
    }
    const int32_t along = (int32_t)pvid_clamp_q31(pvid_round_shift_q31(sum, 30), INT32_MAX);
    for (size_t i = first; i < last; i++) {
        const int64_t rest = x[i] - pvid_round_shift_q31(pvid_product_q31(u[i], along), 30);
        x[i] = (int32_t)pvid_clamp_q31(rest, INT32_MAX);
    }
}

void pvid_fourier_normalise_q31(size_t first, size_t last, int32_t x[])
{
    uint64_t square = 0;
    for (size_t i = first; i < last; i++) {
        square += (uint64_t)pvid_square_q31(x[i]);
    }
    if (square == 0u) {
        return;
    }
    const pvid_reciprocal_q31 inverse = pvid_reciprocal_of_q31(pvid_square_root_q31(square));
    for (size_t i = first; i < last; i++) {
        const int64_t part = pvid_round_shift_q31(pvid_product_q31(x[i], inverse.m), 31u - inverse.k);
        x[i] = (int32_t)pvid_clamp_q31(part, PVID_ONE_Q30);
    }
}
