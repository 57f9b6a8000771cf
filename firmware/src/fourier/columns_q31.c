/* A column of a test function chi is sum_k chi psi of terms factor D^m[channel] with the derivatives moved to chi: it
 * is a combination of the parts of
 *
 *   sum over terms  factor (-1)^m (i omega_h)^m S_h[channel]
 *
 * over their standard deviations. The sums of a channel are shifted up to 30 bits, the factors of all terms to the
 * exponent of the largest; products lose 33 of their bits, so that 15 of them fit. */
#include "fourier/columns_q31.h"

#include <string.h>

#include "fourier/mirror_q31.h"
#include "fourier/white_q31.h"
#include "number/integer_q31.h"

#define SUM_BITS 30
#define PRODUCT_DOWN 33
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

/* Bits that the sums of a channel may be shifted up, 0 if there is nothing to shift. */
static uint32_t lift_of(const pvid_fourier_window_q31 *window, size_t channel, size_t harmonics)
{
    uint32_t all = 0;
    for (size_t h = 0; h < harmonics; h++) {
        const int32_t *s = window->s[channel][h];
        all |= (uint32_t)((s[0] < 0) ? -s[0] : s[0]);
        all |= (uint32_t)((s[1] < 0) ? -s[1] : s[1]);
    }
    const uint32_t length = pvid_bit_length_q31(all);
    return ((length == 0u) || (length > (uint32_t)SUM_BITS)) ? 0u : ((uint32_t)SUM_BITS - length);
}

/* x 2^lift weight 2^-33, rounded down. */
static int32_t part_of(bool negative, int32_t x, uint32_t lift, int32_t weight)
{
    const int32_t lifted = x * (int32_t)((uint32_t)1 << lift);
    return (int32_t)pvid_floor_shift_q31(pvid_product_q31(negative ? -lifted : lifted, weight), PRODUCT_DOWN);
}

/* Adds a term whose unit is 2^below of the column's. */
static void take_term(const pvid_fourier_design_q31 *design, const pvid_fourier_white_q31 *white,
                      const pvid_fourier_window_q31 *window, size_t t, uint32_t lift, uint32_t below, int32_t x[])
{
    const pvid_fourier_term_q31 term = design->model->term[t];
    const turn turned = turn_of(term.order);
    const size_t harmonics = white->cosines;
    const size_t sines = pvid_fourier_sums_rows_q31(design) - harmonics;
    const int32_t factor = design->factor[t].m;
    for (size_t h = 0; h < harmonics; h++) {
        const int32_t *s = window->s[term.channel][h];
        const int32_t weight =
            pvid_floor_shift_32_q31(pvid_fourier_white_weight_q31(white, term.order, h, factor), below);
        const int32_t re = turned.turned ? s[1] : s[0];
        const int32_t im = turned.turned ? s[0] : s[1];
        x[h] += part_of(turned.re_negative, re, lift, weight);
        if ((h > 0u) && (h <= sines)) {
            x[(harmonics + h) - 1u] += part_of(turned.im_negative, im, lift, weight);
        }
    }
}

void pvid_fourier_columns_make_q31(pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design,
                                   const pvid_fourier_white_q31 *white, const pvid_fourier_window_q31 *window,
                                   size_t place, size_t first, size_t end)
{
    const size_t parts = pvid_fourier_sums_rows_q31(design);
    int32_t *x = self->x[place];
    uint32_t lift[PVID_FOURIER_TERMS_Q31] = {0};
    int32_t top = INT32_MIN;
    memset(x, 0, parts * sizeof x[0]);
    for (size_t t = first; t < end; t++) {
        lift[t - first] = lift_of(window, design->model->term[t].channel, white->cosines);
        const int32_t e = design->factor[t].e - (int32_t)lift[t - first];
        top = ((design->factor[t].m != 0) && (e > top)) ? e : top;
    }
    for (size_t t = first; t < end; t++) {
        const int32_t below = top - (design->factor[t].e - (int32_t)lift[t - first]);
        if ((design->factor[t].m != 0) && (below < SUM_BITS)) {
            take_term(design, white, window, t, lift[t - first], (uint32_t)below, x);
        }
    }
    const int32_t exponent = pvid_fourier_block_q31(parts, x);
    const int32_t unit = (top == INT32_MIN) ? 0 : (top + white->exponent + 30 + PRODUCT_DOWN);
    self->exponent[place] = (int16_t)pvid_clamp_q31((int64_t)unit + exponent, INT16_MAX);
}

uint64_t pvid_fourier_columns_square_q31(size_t n, const int32_t x[])
{
    uint64_t square = 0;
    for (size_t i = 0; i < n; i++) {
        square += (uint64_t)pvid_square_q31(x[i]) >> SQUARE_DOWN;
    }
    return square;
}

bool pvid_fourier_columns_keep_q31(uint64_t whole, size_t n, int32_t x[])
{
    const uint64_t left = pvid_fourier_columns_square_q31(n, x);
    if ((left == 0u) || (left <= (whole >> KEPT_BITS))) {
        memset(x, 0, n * sizeof x[0]);
        return false;
    }
    (void)pvid_fourier_block_q31(n, x);
    pvid_fourier_mirror_of_q31(n, x);
    return true;
}

void pvid_fourier_columns_format_q31(pvid_fourier_columns_q31 *self, size_t place, size_t first, size_t last,
                                     int32_t bits)
{
    const int32_t shift = -((int32_t)self->exponent[place] + bits);
    const uint32_t down = (shift <= 0) ? 0u : (uint32_t)((shift < 63) ? shift : 63);
    const uint32_t up = (shift >= 0) ? 0u : (uint32_t)((shift > -31) ? -shift : 31);
    for (size_t i = first; i < last; i++) {
        const int64_t wide = pvid_round_shift_q31(self->x[place][i], down) * ((int64_t)1 << up);
        self->x[place][i] = (int32_t)pvid_clamp_q31(wide, INT32_MAX);
    }
}
