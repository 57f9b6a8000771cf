/* A column of a test function chi is sum_k chi psi of terms factor D^m[channel] with the derivatives moved to chi: it
 * is a combination of the parts of
 *
 *   sum over terms  factor (-1)^m (i omega_h)^m S_h[channel]
 *
 * over their standard deviations, without what the test functions leave out (white_f32.c). The products of a term have
 * 61 bits and an exponent of their own; they are added with that of the largest, then rounded to a block. */
#include "fourier/columns_q31.h"

#include <string.h>

#include "fourier/direction_q31.h"
#include "fourier/white_q31.h"
#include "number/integer_q31.h"
#include "number/scaled_q31.h"

#define SUM_BITS 45 /* of the largest product; 2^16 of them fit */
#define KEPT_BITS 20
#define SQUARE_DOWN 16u

/* Parts of S_h that a term takes for the real and the imaginary part, and their signs: (-i omega)^m is 1, -i omega,
 * -omega^2, i omega^3, ... */
typedef struct {
    size_t part[2];
    bool is_negative[2];
} turn;

static turn turn_of(uint8_t order)
{
    const bool turned = (order % 2u) != 0u;
    const bool negative = ((order + 1u) % 4u) >= 2u;
    const turn result = {{turned ? 1u : 0u, turned ? 0u : 1u}, {turned ? !negative : negative, negative}};
    return result;
}

/* factor h^order / sqrt(D_h) */
static pvid_scaled_q31 weight_of(pvid_scaled_q31 factor, uint8_t order, size_t h, pvid_scaled_q31 scale)
{
    int64_t power = 1;
    for (size_t i = 0; i < order; i++) {
        power *= (int64_t)h;
    }
    return pvid_scaled_times_q31(pvid_scaled_times_q31(factor, scale), pvid_scaled_of_q31(power, 0));
}

/* Bits of the value of a product before its exponent. */
static int32_t length_of(pvid_scaled_q31 weight, int32_t s)
{
    return (int32_t)pvid_bit_length_q31(pvid_magnitude_q31(s)) + 30 + weight.e;
}

/* A term at harmonic h: `adds` its products to the column, else finds the longest. */
static void take_term(pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design,
                      const pvid_fourier_white_q31 *white, const pvid_fourier_window_q31 *window, size_t t, size_t h,
                      bool adds)
{
    const pvid_fourier_term_q31 term = design->model->term[t];
    const size_t rows = pvid_fourier_rows_q31(design);
    const turn turned = turn_of(term.order);
    const pvid_scaled_q31 weight = weight_of(design->factor[t], term.order, h, white->scale[h]);
    const size_t parts = ((h > 0u) && ((white->cosines + h) <= rows)) ? 2u : 1u;
    for (size_t part = 0; (part < parts) && (weight.m != 0); part++) {
        const int32_t s = window->s[term.channel][h][turned.part[part]];
        if (s == 0) {
            continue;
        }
        if (adds) {
            const int64_t product = pvid_product_q31(turned.is_negative[part] ? -s : s, weight.m);
            const size_t row = (part == 0u) ? h : ((white->cosines + h) - 1u);
            self->sum[row] += pvid_scale_q31(product, (self->longest - SUM_BITS) - weight.e);
        } else {
            const int32_t length = length_of(weight, s);
            self->longest = (length > self->longest) ? length : self->longest;
        }
    }
}

/* For each harmonic: what is longest; then for each: the sums; then the block. */
void pvid_fourier_columns_make_q31(pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design,
                                   const pvid_fourier_white_q31 *white, const pvid_fourier_window_q31 *window,
                                   size_t place, size_t first, size_t end, size_t part)
{
    const size_t harmonics = white->cosines;
    if (part == 0u) {
        memset(self->sum, 0, sizeof self->sum);
        self->longest = INT32_MIN;
    }
    if (part < (2u * harmonics)) {
        const bool adds = part >= harmonics;
        for (size_t t = first; t < end; t++) {
            take_term(self, design, white, window, t, adds ? (part - harmonics) : part, adds);
        }
        return;
    }
    const int32_t exponent = pvid_fourier_block_q31(self->sum, 0, pvid_fourier_rows_q31(design), self->x[place]);
    const int32_t unit = (self->longest == INT32_MIN) ? 0 : (self->longest - SUM_BITS);
    self->exponent[place] = (int16_t)pvid_clamp_q31((int64_t)unit + exponent, INT16_MAX);
}

uint64_t pvid_fourier_columns_square_q31(const pvid_fourier_design_q31 *design, const int32_t x[])
{
    uint64_t square = 0;
    for (size_t i = 0; i < pvid_fourier_rows_q31(design); i++) {
        square += (uint64_t)pvid_square_q31(x[i]) >> SQUARE_DOWN;
    }
    return square;
}

bool pvid_fourier_columns_keep_q31(const pvid_fourier_design_q31 *design, uint64_t whole, int32_t x[])
{
    const size_t rows = pvid_fourier_rows_q31(design);
    const uint64_t left = pvid_fourier_columns_square_q31(design, x);
    int64_t wide[PVID_FOURIER_ROWS_Q31];
    if ((left == 0u) || (left <= (whole >> KEPT_BITS))) {
        memset(x, 0, rows * sizeof x[0]);
        return false;
    }
    for (size_t i = 0; i < rows; i++) {
        wide[i] = x[i];
    }
    (void)pvid_fourier_block_q31(wide, 0, rows, x);
    pvid_fourier_normalise_q31(0, rows, x);
    return true;
}
