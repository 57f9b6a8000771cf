#include "weak/sums_q31.h"

#include "weak/values_q31.h"
#include "number/integer_q31.h"
#include "number/unroll.h"

#define BLOCK ((size_t)PVID_WEAK_BLOCK_Q31)
#define DOWN 22u

enum { RE = 0, IM = 1 };

void pvid_weak_sums_reset_q31(pvid_weak_sums_q31 *self)
{
    self->filling = 0;
    self->left = 0;
    self->halves = 0;
}

void pvid_weak_sums_next_q31(pvid_weak_sums_q31 *self, const pvid_weak_design_q31 *design, uint16_t index, uint8_t half)
{
    if ((index % (uint16_t)BLOCK) != (BLOCK - 1u)) {
        return;
    }
    const bool last = index + 1u == design->hop;
    const uint8_t harmonics = pvid_weak_harmonics_q31(design);
    self->filling = (uint8_t)(PVID_MAX_BLOCKS - 1u - self->filling);
    self->item = 0;
    self->angle = 0;
    self->target = half;
    self->start = (uint16_t)(index - (BLOCK - 1u));
    self->joins = last && (self->halves > 0u);
    self->left = (uint8_t)(self->joins ? (2u * harmonics) : harmonics);
    if (last) {
        self->halves = (uint8_t)((self->halves < 2u) ? (self->halves + 1u) : 2u);
    }
}

/* A sum of four products of 24 by 29 bits, 2^-22 of it rounded down, which fits 32 bits. */
#if defined(__ARM_ARCH_6M__)
/* Without a long multiplication: a factor is high 2^12 + low, x is high 2^14 + low; four products of each fit 32 bits.
 */
static inline int32_t products(const int32_t factor[BLOCK], const int32_t *x)
{
    int32_t high = 0;
    int32_t first = 0;
    int32_t second = 0;
    int32_t low = 0;
    PVID_UNROLL
    for (size_t j = 0; j < BLOCK; j++) {
        const int32_t one = x[j * PVID_MAX_CHANNELS];
        const int32_t factor_high = pvid_floor_shift_32_q31(factor[j], 12);
        const int32_t factor_low = (int32_t)((uint32_t)factor[j] & 0xFFFu);
        const int32_t x_high = pvid_floor_shift_32_q31(one, 14);
        const int32_t x_low = (int32_t)((uint32_t)one & 0x3FFFu);
        high += factor_high * x_high;
        first += factor_low * x_high;
        second += factor_high * x_low;
        low += factor_low * x_low;
    }
    const int32_t below = (4 * first) + second + pvid_floor_shift_32_q31(low, 12);
    return (16 * high) + pvid_floor_shift_32_q31(below, 10);
}
#else
static inline int32_t products(const int32_t factor[BLOCK], const int32_t *x)
{
    int64_t sum = 0;
    PVID_UNROLL
    for (size_t j = 0; j < BLOCK; j++) {
        sum += (int64_t)factor[j] * x[j * PVID_MAX_CHANNELS];
    }
    return (int32_t)pvid_floor_shift_q31(sum, DOWN);
}
#endif

/* Adds the products with four factors to one part of the sums of all channels, 2^-shift of them rounded half up, or
 * begins these with them. */
static void add_products(const int32_t factor[BLOCK], const int32_t *x, size_t channels, uint32_t shift, bool begins,
                         int32_t *sum)
{
    const int32_t c[BLOCK] = {factor[0], factor[1], factor[2], factor[3]};
    for (size_t left = channels; left > 0u; left--) {
        const int32_t half = pvid_floor_shift_32_q31(products(c, x), shift - 1u);
        *sum = (begins ? 0 : *sum) + pvid_floor_shift_32_q31(half + 1, 1);
        sum += 2;
        x++;
    }
}

/* The block to the sums of harmonic h, whose first step is at `angle` of the circle. */
static void add_block(pvid_weak_sums_q31 *self, const pvid_weak_design_q31 *design, size_t h)
{
    const size_t summed = pvid_weak_summed_q31(design->model);
    const size_t turn = 2u * (size_t)design->hop;
    const size_t three_quarters = turn - ((size_t)design->hop / 2u);
    const int32_t *x = &self->block[PVID_MAX_BLOCKS - 1u - self->filling][0][0];
    int32_t *sum = &self->sum[self->target][h][0][0];
    int32_t cosine[BLOCK];
    int32_t sine[BLOCK];
    size_t place = self->angle;
    for (size_t j = 0; j < BLOCK; j++) {
        const size_t quarter = place + three_quarters;
        cosine[j] = design->circle[place];
        sine[j] = design->circle[(quarter >= turn) ? (quarter - turn) : quarter];
        place = (place + h >= turn) ? ((place + h) - turn) : (place + h);
    }
    add_products(cosine, x, summed, design->sum_shift, self->start == 0u, &sum[RE]);
    if (h > 0u) {
        add_products(sine, x, summed, design->sum_shift, self->start == 0u, &sum[IM]);
    }
    const size_t next = (size_t)self->angle + self->start;
    self->angle = (uint16_t)((next >= turn) ? (next - turn) : next);
}

/* The end of the first half's integrals of a channel: I^n, n = 1 or 2, that of 1 in the unit of the channel. */
static int32_t edge_of(const pvid_weak_values_q31 *values, const pvid_weak_channel *channel, size_t first, size_t n,
                       int32_t hop)
{
    if (channel->integrand == PVID_WEAK_NONE) {
        if (n == 2u) {
            return 24 * hop * hop;
        }
        return (channel->fold == 1u) ? (2 * hop) : (24 * hop);
    }
    return values->edge[first][n - 1u][channel->integrand];
}

/* I^n at the end of the first half times B_h. */
static inline int64_t shifted(int32_t end, int32_t b, uint32_t shift)
{
    return pvid_floor_shift_q31(pvid_product_q31(end, b), shift);
}

/* S_h = A_h + (-1)^h B_h; the integrals of B are shifted to the start of A: by I^fold, and by I^1 t where fold is 2. */
static void join(const pvid_weak_sums_q31 *self, const pvid_weak_design_q31 *design, const pvid_weak_values_q31 *values,
                 size_t h, pvid_weak_window_q31 *window)
{
    const pvid_weak_model_q31 *model = design->model;
    const size_t first = (size_t)self->target ^ 1u;
    const int32_t (*a)[2] = self->sum[first][h];
    const int32_t (*b)[2] = self->sum[self->target][h];
    const size_t summed = pvid_weak_summed_q31(model);
    const bool even = (h % 2u) == 0u;
    for (size_t k = 0; k < summed; k++) {
        const pvid_weak_channel *channel = &model->channel[k];
        const pvid_weak_format_q31 format = design->format[k];
        const bool folds = channel->fold > 0u;
        const bool ramps = channel->fold > 1u;
        const int32_t end = folds ? edge_of(values, channel, first, channel->fold, design->hop) : 0;
        const int32_t once = ramps ? edge_of(values, channel, first, 1, design->hop) : 0;
        uint32_t bits = 0;
        for (size_t part = 0; part < 2u; part++) {
            const int32_t other = b[k][part];
            int64_t shift = folds ? shifted(end, b[channel->plain][part], format.plain) : 0;
            shift += ramps ? shifted(once, b[channel->ramp][part], format.ramp) : 0;
            const int32_t own = pvid_floor_shift_32_q31(a[k][part] + (even ? other : -other), format.own);
            const int32_t total = (int32_t)pvid_clamp_q31(own + (even ? shift : -shift), PVID_ONE_Q30);
            window->s[k][h][part] = total;
            bits |= (uint32_t)((total < 0) ? -total : total);
        }
        window->length[k][h] = (uint8_t)pvid_bit_length_q31(bits);
    }
}

void pvid_weak_sums_item_q31(pvid_weak_sums_q31 *self, const pvid_weak_design_q31 *design,
                             const pvid_weak_values_q31 *values, pvid_weak_window_q31 *window)
{
    const uint8_t harmonics = pvid_weak_harmonics_q31(design);
    if (self->item < harmonics) {
        add_block(self, design, self->item);
    } else {
        join(self, design, values, (size_t)self->item - harmonics, window);
    }
    self->item++;
    self->left--;
}
