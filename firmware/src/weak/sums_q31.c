#include "weak/sums_q31.h"

#include <string.h>

#include "number/exact.h"
#include "number/integer_q31.h"
#include "weak/values_q31.h"

#define BLOCK ((size_t)PVID_WEAK_BLOCK_Q31)
#define DOWN 14u
#define FINE_DOWN 22u

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

/* x 2^-s rounded half up, s >= 1. */
static inline int32_t rounded(int32_t x, uint32_t s)
{
    return pvid_floor_shift_32_q31(pvid_floor_shift_32_q31(x, s - 1u) + 1, 1);
}

#if defined(__ARM_ARCH_6M__)
#define OFFSET 16384 /* of an entry's upper half: 2^14 */

/* The sum of four products of 16 by 29 bits without its last 14 bits and with `start`, all of which fits 32 bits, as
 * four products of lower halves do. start: what the entries' offset takes away, and half a unit of the result. One sum
 * after the other: both at once need more registers than there are. */
static inline int32_t products(const int32_t factor[BLOCK], const pvid_weak_entry_q31 x[BLOCK], int32_t start)
{
    int32_t low = 0;
    PVID_UNROLL
    for (size_t j = 0; j < BLOCK; j++) {
        low += factor[j] * (int32_t)x[j].low;
    }
    int32_t sum = pvid_floor_shift_32_q31(low, PVID_WEAK_ENTRY_BITS_Q31) + start;
    PVID_UNROLL
    for (size_t j = 0; j < BLOCK; j++) {
        sum += factor[j] * (int32_t)x[j].high;
    }
    return sum;
}

/* Adds the products with four factors to one part of the sums of all channels, 2^-(14 + shift) of them rounded half up.
 */
static inline void add_products(const int32_t factor[BLOCK], const pvid_weak_entry_q31 *x, size_t channels,
                                uint32_t shift, int32_t *sum)
{
    const int32_t offset = ((factor[0] + factor[1]) + (factor[2] + factor[3])) * OFFSET;
    const int32_t start = ((int32_t)1 << (shift - 1u)) - offset;
    for (size_t left = channels; left > 0u; left--) {
        *sum += pvid_floor_shift_32_q31(products(factor, x, start), shift);
        sum += 2;
        x = &x[BLOCK];
    }
}

/* A sum of four products of 24 by 29 bits, 2^-22 of it rounded down, which fits 32 bits. */
static inline int32_t fine_products(const int32_t factor[BLOCK], const pvid_weak_entry_q31 x[BLOCK])
{
    /* a factor is high 2^12 + low; four products of each fit 32 bits */
    int32_t high = 0;
    int32_t first = 0;
    int32_t second = 0;
    int32_t low = 0;
    PVID_UNROLL
    for (size_t j = 0; j < BLOCK; j++) {
        const int32_t factor_high = pvid_floor_shift_32_q31(factor[j], 12);
        const int32_t factor_low = (int32_t)((uint32_t)factor[j] & 0xFFFu);
        const int32_t x_high = (int32_t)x[j].high - OFFSET;
        const int32_t x_low = (int32_t)x[j].low;
        high += factor_high * x_high;
        first += factor_low * x_high;
        second += factor_high * x_low;
        low += factor_low * x_low;
    }
    const int32_t below = (4 * first) + second + pvid_floor_shift_32_q31(low, 12);
    return (16 * high) + pvid_floor_shift_32_q31(below, 10);
}
#else
/* A sum of four products, 2^-down of it rounded down, which fits 32 bits. */
static inline int32_t long_products(const int32_t factor[BLOCK], const pvid_weak_entry_q31 x[BLOCK], uint32_t down)
{
    int64_t sum = 0;
    PVID_UNROLL
    for (size_t j = 0; j < BLOCK; j++) {
        sum += (int64_t)factor[j] * x[j];
    }
    return (int32_t)pvid_floor_shift_q31(sum, down);
}

/* Adds the products with four factors to one part of the sums of all channels, 2^-(14 + shift) of them rounded half up.
 */
static inline void add_products(const int32_t factor[BLOCK], const pvid_weak_entry_q31 *x, size_t channels,
                                uint32_t shift, int32_t *sum)
{
    for (size_t left = channels; left > 0u; left--) {
        *sum += rounded(long_products(factor, x, DOWN), shift);
        sum += 2;
        x = &x[BLOCK];
    }
}

static inline int32_t fine_products(const int32_t factor[BLOCK], const pvid_weak_entry_q31 x[BLOCK])
{
    return long_products(factor, x, FINE_DOWN);
}
#endif

/* The same of factors of 24 bits, 2^-(22 + shift). */
static inline void add_fine_products(const int32_t factor[BLOCK], const pvid_weak_entry_q31 *x, size_t channels,
                                     uint32_t shift, int32_t *sum)
{
    for (size_t left = channels; left > 0u; left--) {
        *sum += rounded(fine_products(factor, x), shift);
        sum += 2;
        x = &x[BLOCK];
    }
}

/* Adds the products with every h-th factor to one part of the sums of all channels. Rounded, not cut off: what is lost
 * must not have a mean. */
static void add_part(const PVID_TABLE int32_t *factor, size_t h, const pvid_weak_entry_q31 *x, size_t channels,
                     const pvid_weak_design_q31 *design, int32_t *sum)
{
    const int32_t c[BLOCK] = {factor[0], factor[h], factor[2u * h], factor[3u * h]};
    if (design->fine) {
        add_fine_products(c, x, channels, design->sum_shift, sum);
    } else {
        add_products(c, x, channels, design->sum_shift, sum);
    }
}

/* The block to the sums of harmonic h, whose first step is at `angle` of the circle. The table goes on far enough
 * behind the circle for three quarters of it and a block. */
static void add_block(pvid_weak_sums_q31 *self, const pvid_weak_design_q31 *design, size_t h)
{
    const size_t summed = PVID_COUNT(PVID_EXACT_CHANNELS, pvid_weak_summed_q31(design->model));
    const size_t turn = 2u * (size_t)design->hop;
    const pvid_weak_entry_q31 *x = &self->block[PVID_MAX_BLOCKS - 1u - self->filling][0][0];
    int32_t (*sum)[2] = self->sum[self->target][h];
    const PVID_TABLE int32_t *cosine = &design->circle[self->angle];
    if (self->start == 0u) {
        memset(sum, 0, summed * sizeof sum[0]);
    }
    add_part(cosine, h, x, summed, design, &sum[0][RE]);
    if (h > 0u) {
        add_part(&cosine[turn - (turn / 4u)], h, x, summed, design, &sum[0][IM]);
    }
    const size_t next = (size_t)self->angle + self->start;
    self->angle = (uint16_t)((next >= turn) ? (next - turn) : next);
}

/* The end of the first half's integrals of a channel: I^n, n = 1 or 2, that of 1 in the unit of the channel. */
static int32_t edge_of(const pvid_weak_values_q31 *values, const pvid_weak_channel *channel, size_t first, size_t n,
                       int32_t hop, uint32_t lift)
{
    if (channel->integrand == PVID_WEAK_NONE) {
        const int32_t once = (channel->fold == 1u) ? (2 * hop) : (24 * hop);
        return (int32_t)((uint32_t)((n == 2u) ? (once * hop) : once) << lift);
    }
    return values->edge[first][n - 1u][channel->integrand];
}

/* I^n at the end of the first half times B_h, 2^-shift of it; of a shift below 32 the last bits are 0. */
static inline int32_t shifted(int32_t end, int32_t b, uint32_t shift)
{
    const int32_t upper = pvid_upper_product_q31(end, b);
    return (shift >= 32u) ? pvid_floor_shift_32_q31(upper, shift - 32u)
                          : (upper * (int32_t)((uint32_t)1 << (32u - shift)));
}

/* S_h = A_h + (-1)^h B_h, which may take the place of A_h; the integrals of B are shifted to the start of A: by I^fold,
 * and by I^1 t where fold is 2. */
static void join(const pvid_weak_sums_q31 *self, const pvid_weak_design_q31 *design, const pvid_weak_values_q31 *values,
                 size_t h, uint8_t length[], int32_t s[][2])
{
    const pvid_weak_model_q31 *model = design->model;
    const size_t first = (size_t)self->target ^ 1u;
    const int32_t (*a)[2] = self->sum[first][h];
    const int32_t (*b)[2] = self->sum[self->target][h];
    const size_t summed = PVID_COUNT(PVID_EXACT_CHANNELS, pvid_weak_summed_q31(model));
    const bool even = (h % 2u) == 0u;
    for (size_t k = 0; k < summed; k++) {
        const pvid_weak_channel *channel = &model->channel[k];
        const pvid_weak_format_q31 *format = &design->format[k];
        int32_t re = b[k][RE];
        int32_t im = b[k][IM];
        int32_t shift_re = 0;
        int32_t shift_im = 0;
        if (channel->fold > 0u) {
            const int32_t end = edge_of(values, channel, first, channel->fold, design->hop, format->lift);
            shift_re = shifted(end, b[channel->plain][RE], format->plain);
            shift_im = shifted(end, b[channel->plain][IM], format->plain);
        }
        if (channel->fold > 1u) {
            const int32_t once = edge_of(values, channel, first, 1, design->hop, format->lift);
            shift_re += shifted(once, b[channel->ramp][RE], format->ramp);
            shift_im += shifted(once, b[channel->ramp][IM], format->ramp);
        }
        if (even) {
            re = pvid_floor_shift_32_q31(a[k][RE] + re, format->own) + shift_re;
            im = pvid_floor_shift_32_q31(a[k][IM] + im, format->own) + shift_im;
        } else {
            re = pvid_floor_shift_32_q31(a[k][RE] - re, format->own) - shift_re;
            im = pvid_floor_shift_32_q31(a[k][IM] - im, format->own) - shift_im;
        }
        s[k][RE] = re;
        s[k][IM] = im;
        length[k] = (uint8_t)pvid_bit_length_q31((uint32_t)((re < 0) ? -re : re) | (uint32_t)((im < 0) ? -im : im));
    }
}

void pvid_weak_sums_item_q31(pvid_weak_sums_q31 *self, const pvid_weak_design_q31 *design,
                             const pvid_weak_values_q31 *values, pvid_weak_window_q31 *window)
{
    const uint8_t harmonics = pvid_weak_harmonics_q31(design);
    if (self->item < harmonics) {
        add_block(self, design, self->item);
    } else {
        const size_t h = (size_t)self->item - harmonics;
        window->half = (uint8_t)(self->target ^ 1u);
        join(self, design, values, h, window->length[h], pvid_weak_window_sums_q31(self, window)[h]);
    }
    self->item++;
    self->left--;
}
