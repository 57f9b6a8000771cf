/* A column of a test function chi is sum_k chi psi of terms factor D^m[channel] with the derivatives moved to chi: it
 * is a combination of the parts of
 *
 *   sum over terms  factor (-1)^m (i omega_h)^m S_h[channel]
 *
 * over their standard deviations, without what the test functions leave out (white_f32.c). The products of a term have
 * 61 bits and an exponent of their own; they are added with that of the largest weight, then rounded to a block. */
#include "fourier/columns_q31.h"

#include <string.h>

#include "fourier/direction_q31.h"
#include "fourier/white_q31.h"
#include "number/integer_q31.h"
#include "number/scaled_q31.h"

#define GUARD 4 /* bits that the products of 61 bits lose at least: 64 of them fit */
#define KEPT_BITS 20
#define SQUARE_DOWN 16u

/* What a term takes for the real and the imaginary part: (-i omega)^m is 1, -i omega, -omega^2, i omega^3, ... */
typedef struct {
    bool turned; /* the imaginary part of S_h for the real part, and the real one for the imaginary part */
    bool re_negative;
    bool im_negative;
} turn;

static turn turn_of(uint8_t order)
{
    const bool turned = (order % 2u) != 0u;
    const bool negative = ((order + 1u) % 4u) >= 2u;
    const turn result = {turned, turned ? !negative : negative, negative};
    return result;
}

/* factor h^order / sqrt(D_h): m 2^e with |m| <= 2^30. */
static pvid_scaled_q31 weight_of(pvid_scaled_q31 factor, uint8_t order, size_t h, pvid_scaled_q31 scale)
{
    int32_t power = 1;
    for (size_t i = 0; i < order; i++) {
        power *= (int32_t)h;
    }
    const int32_t bits = (int32_t)pvid_bit_length_q31((uint64_t)power);
    const int32_t both = (int32_t)pvid_floor_shift_q31(pvid_product_q31(factor.m, scale.m), 30);
    const pvid_scaled_q31 weight = {(int32_t)pvid_floor_shift_q31(pvid_product_q31(both, power), (uint32_t)bits),
                                    factor.e + scale.e + 30 + bits};
    return weight;
}

/* The greatest exponent of the weights of a column, at least `top`. */
static int32_t greatest(const pvid_fourier_design_q31 *design, const pvid_fourier_white_q31 *white, size_t t,
                        int32_t top)
{
    int32_t found = top;
    for (size_t h = 0; h < white->cosines; h++) {
        const pvid_scaled_q31 weight = weight_of(design->factor[t], design->model->term[t].order, h, white->scale[h]);
        found = ((weight.m != 0) && (weight.e > found)) ? weight.e : found;
    }
    return found;
}

/* Adds a term at harmonic h. */
static void take_term(pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design,
                      const pvid_fourier_white_q31 *white, const pvid_fourier_window_q31 *window, size_t t, size_t h)
{
    const pvid_fourier_term_q31 term = design->model->term[t];
    const turn turned = turn_of(term.order);
    const pvid_scaled_q31 weight = weight_of(design->factor[t], term.order, h, white->scale[h]);
    if (weight.m == 0) {
        return;
    }
    const uint32_t shift = (uint32_t)((self->top - weight.e) + GUARD);
    const int32_t *s = window->s[term.channel][h];
    const int32_t re = turned.turned ? s[1] : s[0];
    const int32_t im = turned.turned ? s[0] : s[1];
    self->sum[h] += pvid_round_shift_q31(pvid_product_q31(turned.re_negative ? -re : re, weight.m), shift);
    if ((h > 0u) && ((white->cosines + h) <= pvid_fourier_rows_q31(design))) {
        const int64_t product = pvid_product_q31(turned.im_negative ? -im : im, weight.m);
        self->sum[(white->cosines + h) - 1u] += pvid_round_shift_q31(product, shift);
    }
}

/* The greatest exponent; each harmonic; the block. */
void pvid_fourier_columns_make_q31(pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design,
                                   const pvid_fourier_white_q31 *white, const pvid_fourier_window_q31 *window,
                                   size_t place, size_t first, size_t end, size_t part)
{
    if (part == 0u) {
        memset(self->sum, 0, sizeof self->sum);
        self->top = INT32_MIN;
        for (size_t t = first; t < end; t++) {
            self->top = greatest(design, white, t, self->top);
        }
    } else if (part <= white->cosines) {
        for (size_t t = first; t < end; t++) {
            take_term(self, design, white, window, t, part - 1u);
        }
    } else {
        const int32_t exponent = pvid_fourier_block_q31(self->sum, 0, pvid_fourier_rows_q31(design), self->x[place]);
        const int32_t unit = (self->top == INT32_MIN) ? 0 : (self->top + GUARD);
        self->exponent[place] = (int16_t)pvid_clamp_q31((int64_t)unit + exponent, INT16_MAX);
    }
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
