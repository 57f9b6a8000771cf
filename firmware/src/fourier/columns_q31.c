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
#define PRODUCT_DOWN 33u
#define KEPT_BITS 20
#define SQUARE_DOWN 16u

static int32_t exponent_of(const pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design, size_t t)
{
    return design->factor[t].e - (int32_t)self->lift[design->model->term[t].channel];
}

void pvid_fourier_columns_begin_q31(pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design, size_t kind,
                                    const pvid_fourier_window_q31 *window)
{
    const pvid_fourier_model_q31 *model = design->model;
    const pvid_fourier_kind *own = &model->kind[kind];
    const size_t parts = pvid_fourier_sums_rows_q31(design);
    const size_t columns = (size_t)own->thetas + 1u + own->nuisances;
    for (size_t k = 0; k < model->channels; k++) {
        const uint32_t length = pvid_bit_length_q31(window->bits[k]);
        const bool full = (length == 0u) || (length > (uint32_t)SUM_BITS);
        self->lift[k] = (uint8_t)(full ? 0u : ((uint32_t)SUM_BITS - length));
    }
    for (size_t j = 0; j < columns; j++) {
        self->exponent[j] = INT16_MIN;
        for (size_t i = 0; i < parts; i++) {
            self->x[j][i] = 0;
        }
    }
    for (size_t t = own->first; t < own->end; t++) {
        const int32_t e = exponent_of(self, design, t);
        int16_t *top = &self->exponent[model->term[t].column];
        if ((design->factor[t].m != 0) && (e > *top)) {
            *top = (int16_t)e;
        }
    }
}

/* (-i omega)^m is 1, -i omega, -omega^2, i omega^3, ...: from the imaginary part of S_h to the real part of a column
 * and from the real one to the imaginary one if m is odd. */
void pvid_fourier_columns_take_q31(pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design, size_t kind,
                                   const pvid_fourier_white_q31 *white, const pvid_fourier_window_q31 *window, size_t h)
{
    const pvid_fourier_kind *own = &design->model->kind[kind];
    const size_t harmonics = white->cosines;
    const bool has_sine = (h > 0u) && ((harmonics + h) <= pvid_fourier_sums_rows_q31(design));
    int32_t weight[PVID_MAX_POWER + 1]; /* of the orders */
    weight[0] = white->scale[h].m;
    for (size_t m = 1; m < design->power; m++) {
        weight[m] = (int32_t)pvid_floor_shift_q31(pvid_product_q31(weight[m - 1u], (int32_t)h * white->rate), 30);
    }
    for (size_t t = own->first; t < own->end; t++) {
        const pvid_fourier_term_q31 term = design->model->term[t];
        const int32_t below = self->exponent[term.column] - exponent_of(self, design, t);
        const int32_t *s = window->s[term.channel][h];
        if ((design->factor[t].m != 0) && (below < SUM_BITS)) { /* else nothing is left of it */
            const int32_t whole =
                (int32_t)pvid_floor_shift_q31(pvid_product_q31(weight[term.order], design->factor[t].m), 30);
            const int32_t w = pvid_floor_shift_32_q31(whole, (uint32_t)below);
            const int32_t up = (int32_t)((uint32_t)1 << self->lift[term.channel]);
            const bool turned = (term.order % 2u) != 0u;
            const int32_t re = (turned ? s[1] : s[0]) * up;
            const int32_t im = (turned ? s[0] : s[1]) * up;
            const int32_t of_re = ((term.order % 4u) >= 2u) ? -w : w;
            const int32_t of_im = (((term.order + 1u) % 4u) >= 2u) ? -w : w;
            int32_t *x = &self->x[term.column][h];
            x[0] += (int32_t)pvid_floor_shift_q31(pvid_product_q31(re, of_re), PRODUCT_DOWN);
            if (has_sine) {
                x[harmonics - 1u] += (int32_t)pvid_floor_shift_q31(pvid_product_q31(im, of_im), PRODUCT_DOWN);
            }
        }
    }
}

void pvid_fourier_columns_end_q31(pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design,
                                  const pvid_fourier_white_q31 *white, size_t place)
{
    const int32_t top = self->exponent[place];
    const int32_t exponent = pvid_fourier_block_q31(pvid_fourier_sums_rows_q31(design), self->x[place]);
    const int32_t unit = (top == INT16_MIN) ? 0 : (top + white->exponent + 30 + (int32_t)PRODUCT_DOWN);
    self->exponent[place] = (int16_t)pvid_clamp_q31((int64_t)unit + exponent, INT16_MAX);
    pvid_fourier_white_remove_q31(white, design, self->x[place]);
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
