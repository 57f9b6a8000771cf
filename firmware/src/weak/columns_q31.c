/* A column of a test function chi is sum_k chi psi of terms factor D^m[channel] with the derivatives moved to chi: it
 * is a combination of the parts of
 *
 *   sum over terms  factor (-1)^m (i omega_h)^m S_h[channel]
 *
 * over their standard deviations. Of each term and harmonic the sums and the factor are shifted up to 30 bits; all are
 * added in the unit of the largest of the column. Products lose 33 of their bits, so that 15 of them fit. */
#include "weak/columns_q31.h"

#include <string.h>

#include "number/integer_q31.h"
#include "number/unroll.h"
#include "weak/reflection_q31.h"
#include "weak/white_q31.h"

#define SUM_BITS 30
#define PRODUCT_DOWN 33u
#define KEPT_BITS 20
#define SQUARE_DOWN 16u

/* Bits that the sums of a channel at a harmonic are shifted up; 0 <= length <= 31. */
static uint32_t lift_of(uint32_t length)
{
    return (length > (uint32_t)SUM_BITS) ? 0u : ((uint32_t)SUM_BITS - length);
}

/* Whether a channel is the constant, whose sums are 2 hop at h = 0 and 0 elsewhere. */
static bool is_constant(const pvid_weak_design_q31 *design, size_t channel)
{
    return design->model->channel[channel].gain == PVID_WEAK_NONE;
}

static uint32_t length_of(const pvid_weak_design_q31 *design, const uint8_t length[], size_t channel, size_t h)
{
    if (is_constant(design, channel)) {
        return (h == 0u) ? pvid_bit_length_q31(2u * (uint64_t)design->hop) : 0u;
    }
    return length[channel];
}

/* A harmonic of the sums in the columns. */
typedef struct {
    size_t h;
    int32_t exponent; /* of 1 / sqrt(D_h) */
    int32_t bits;     /* of h */
} harmonic;

static harmonic harmonic_of(const pvid_weak_white_q31 *white, size_t h)
{
    const harmonic own = {h, white->scale[h].e, (int32_t)pvid_byte_length_q31(h)};
    return own;
}

/* Whether a term contains a harmonic at all; *exponent: of its part there, *lift: of its sums. */
PVID_ALWAYS_INLINE bool exponent_of(const pvid_weak_design_q31 *design, size_t t, const harmonic *own,
                                    const uint8_t lengths[], int32_t *exponent, uint32_t *lift)
{
    const pvid_weak_term_q31 *term = &design->model->term[t];
    const pvid_scaled_q31 *factor = &design->factor[t];
    const uint32_t length = length_of(design, lengths, term->channel, own->h);
    if ((length == 0u) || ((own->h == 0u) && (term->order > 0u)) || (factor->m == 0)) {
        return false;
    }
    *lift = lift_of(length);
    *exponent = (factor->e - (int32_t)*lift) + own->exponent + ((int32_t)term->order * own->bits);
    return true;
}

void pvid_weak_columns_begin_q31(pvid_weak_columns_q31 *self, const pvid_weak_design_q31 *design, size_t kind)
{
    const pvid_weak_kind *own = &design->model->kind[kind];
    const size_t columns = (size_t)own->thetas + 1u + own->nuisances;
    const size_t parts = pvid_weak_sums_rows_q31(design);
    for (size_t j = 0; j < columns; j++) {
        self->exponent[j] = INT32_MIN;
        for (size_t i = 0; i < parts; i++) {
            self->x[j][i] = 0;
        }
    }
}

void pvid_weak_columns_scan_q31(pvid_weak_columns_q31 *self, const pvid_weak_design_q31 *design, size_t kind,
                                const pvid_weak_white_q31 *white, const uint8_t length[], size_t h)
{
    const pvid_weak_kind *own = &design->model->kind[kind];
    const harmonic at = harmonic_of(white, h);
    for (size_t t = own->first; t < own->end; t++) {
        int32_t exponent = 0;
        uint32_t lift = 0;
        int32_t *top = &self->exponent[design->model->term[t].column];
        if (exponent_of(design, t, &at, length, &exponent, &lift) && (exponent > *top)) {
            *top = exponent;
        }
    }
}

/* (-i omega)^m is 1, -i omega, -omega^2, i omega^3, ...: from the imaginary part of S_h to the real part of a column
 * and from the real one to the imaginary one if m is odd. */
void pvid_weak_columns_take_q31(pvid_weak_columns_q31 *self, const pvid_weak_design_q31 *design, size_t kind,
                                const pvid_weak_white_q31 *white, const uint8_t length[], const int32_t sums[][2],
                                size_t h)
{
    const pvid_weak_kind *own = &design->model->kind[kind];
    const size_t harmonics = white->cosines;
    const bool has_sine = (h > 0u) && ((harmonics + h) <= pvid_weak_sums_rows_q31(design));
    int32_t weight[PVID_MAX_POWER + 1]; /* of the orders */
    weight[0] = white->scale[h].m;
    for (size_t m = 1; m < design->power; m++) {
        weight[m] = pvid_weak_white_times_q31(weight[m - 1u], h);
    }
    const harmonic at = harmonic_of(white, h);
    for (size_t t = own->first; t < own->end; t++) {
        const pvid_weak_term_q31 term = design->model->term[t];
        int32_t exponent = 0;
        uint32_t lift = 0;
        if (!exponent_of(design, t, &at, length, &exponent, &lift)) {
            continue;
        }
        const int32_t below = self->exponent[term.column] - exponent;
        if (below < SUM_BITS) { /* else nothing is left of it */
            const int32_t constant[2] = {2 * (int32_t)design->hop, 0};
            const int32_t *s = is_constant(design, term.channel) ? constant : sums[term.channel];
            const int32_t whole =
                (int32_t)pvid_floor_shift_q31(pvid_short_product_q31(weight[term.order], design->factor[t].m), 30);
            const int32_t w = pvid_floor_shift_32_q31(whole, (uint32_t)below);
            const int32_t up = (int32_t)((uint32_t)1 << lift);
            const bool turned = (term.order % 2u) != 0u;
            const int32_t re = (turned ? s[1] : s[0]) * up;
            const int32_t im = (turned ? s[0] : s[1]) * up;
            const int32_t of_re = ((term.order % 4u) >= 2u) ? -w : w;
            const int32_t of_im = (((term.order + 1u) % 4u) >= 2u) ? -w : w;
            int32_t *x = &self->x[term.column][h];
            x[0] += pvid_floor_shift_32_q31(pvid_upper_product_q31(re, of_re), PRODUCT_DOWN - 32u);
            if (has_sine) {
                x[harmonics - 1u] += pvid_floor_shift_32_q31(pvid_upper_product_q31(im, of_im), PRODUCT_DOWN - 32u);
            }
        }
    }
}

void pvid_weak_columns_end_q31(pvid_weak_columns_q31 *self, const pvid_weak_design_q31 *design,
                               const pvid_weak_white_q31 *white, size_t place)
{
    const int32_t top = self->exponent[place];
    const int32_t exponent = pvid_weak_block_q31(pvid_weak_sums_rows_q31(design), self->x[place]);
    const int32_t unit = (top == INT32_MIN) ? 0 : (top + 30 + (int32_t)PRODUCT_DOWN);
    self->exponent[place] = unit + exponent;
    pvid_weak_white_remove_q31(white, design, self->x[place]);
}

uint64_t pvid_weak_columns_square_q31(size_t n, const int32_t x[])
{
    uint64_t square = 0;
    for (size_t i = 0; i < n; i++) {
        square += (uint64_t)pvid_short_square_q31(x[i]) >> SQUARE_DOWN;
    }
    return square;
}

bool pvid_weak_columns_keep_q31(uint64_t whole, size_t n, int32_t x[])
{
    const uint64_t left = pvid_weak_columns_square_q31(n, x);
    if ((left == 0u) || (left <= (whole >> KEPT_BITS))) {
        memset(x, 0, n * sizeof x[0]);
        return false;
    }
    (void)pvid_weak_block_q31(n, x);
    pvid_weak_reflector_of_q31(n, x);
    return true;
}

void pvid_weak_columns_format_q31(pvid_weak_columns_q31 *self, size_t place, size_t first, size_t last, int32_t bits)
{
    const int32_t shift = -((int32_t)self->exponent[place] + bits);
    const uint32_t down = (shift <= 0) ? 0u : (uint32_t)((shift < 63) ? shift : 63);
    const uint32_t up = (shift >= 0) ? 0u : (uint32_t)((shift > -31) ? -shift : 31);
    for (size_t i = first; i < last; i++) {
        const int64_t wide = pvid_round_shift_q31(self->x[place][i], down) * ((int64_t)1 << up);
        self->x[place][i] = (int32_t)pvid_clamp_q31(wide, INT32_MAX);
    }
}
