#include "fourier/sums_q31.h"

#include <string.h>

#include "fourier/values_q31.h"
#include "number/integer_q31.h"
#include "number/unroll.h"

#define BLOCK ((size_t)PVID_FOURIER_BLOCK_Q31)
#define DOWN 14u

enum { RE = 0, IM = 1 };

void pvid_fourier_sums_reset_q31(pvid_fourier_sums_q31 *self, const pvid_fourier_design_q31 *design)
{
    self->filling = 0;
    self->slice = pvid_fourier_harmonics_q31(design);
    self->halves = 0;
}

void pvid_fourier_sums_next_q31(pvid_fourier_sums_q31 *self, const pvid_fourier_design_q31 *design, uint16_t index,
                                uint8_t half)
{
    if ((index % (uint16_t)BLOCK) != (BLOCK - 1u)) {
        return;
    }
    self->filling ^= 1u;
    self->slice = 0;
    self->target = half;
    self->start = (uint16_t)(index - (BLOCK - 1u));
    self->last = index + 1u == design->hop;
    self->joins = self->last && (self->halves > 0u);
    if (self->last) {
        self->halves = (uint8_t)((self->halves < 2u) ? (self->halves + 1u) : 2u);
    }
}

/* Two sums of four products of 16 by 29 bits, 2^-14 of them rounded down, which fit 32 bits. */
#if defined(__ARM_ARCH_6M__)
/* Without a long multiplication: x = high 2^14 + low; four products of each fit 32 bits. */
static inline void add_products(const int32_t cosine[BLOCK], const int32_t sine[BLOCK], const int32_t *x,
                                int32_t sum[2])
{
    int32_t high_re = 0;
    int32_t high_im = 0;
    int32_t low_re = 0;
    int32_t low_im = 0;
    PVID_UNROLL
    for (size_t j = 0; j < BLOCK; j++) {
        const int32_t one = x[j * PVID_MAX_CHANNELS];
        const int32_t high = pvid_floor_shift_32_q31(one, DOWN);
        const int32_t low = (int32_t)((uint32_t)one & 0x3FFFu);
        high_re += cosine[j] * high;
        high_im += sine[j] * high;
        low_re += cosine[j] * low;
        low_im += sine[j] * low;
    }
    sum[RE] = high_re + pvid_floor_shift_32_q31(low_re, DOWN);
    sum[IM] = high_im + pvid_floor_shift_32_q31(low_im, DOWN);
}
#else
static inline void add_products(const int32_t cosine[BLOCK], const int32_t sine[BLOCK], const int32_t *x,
                                int32_t sum[2])
{
    int64_t re = 0;
    int64_t im = 0;
    PVID_UNROLL
    for (size_t j = 0; j < BLOCK; j++) {
        const int32_t one = x[j * PVID_MAX_CHANNELS];
        re += (int64_t)cosine[j] * one;
        im += (int64_t)sine[j] * one;
    }
    sum[RE] = (int32_t)pvid_floor_shift_q31(re, DOWN);
    sum[IM] = (int32_t)pvid_floor_shift_q31(im, DOWN);
}
#endif

/* x 2^-s rounded half up, s >= 1. */
static inline int32_t rounded(int32_t x, uint32_t s)
{
    return pvid_floor_shift_32_q31(pvid_floor_shift_32_q31(x, s - 1u) + 1, 1);
}

/* The block to the sums of harmonic h. */
static void add_block(pvid_fourier_sums_q31 *self, const pvid_fourier_design_q31 *design, size_t h)
{
    const size_t summed = pvid_fourier_summed_q31(design->model);
    const size_t turn = 2u * (size_t)design->hop;
    int32_t (*block)[PVID_MAX_CHANNELS] = self->block[self->filling ^ 1u];
    int32_t (*sum)[2] = self->sum[self->target][h];
    int32_t cosine[BLOCK];
    int32_t sine[BLOCK];
    size_t place = (h * self->start) % turn;
    for (size_t j = 0; j < BLOCK; j++) {
        const size_t quarter = place + (turn - ((size_t)design->hop / 2u));
        cosine[j] = design->circle[place];
        sine[j] = design->circle[(quarter >= turn) ? (quarter - turn) : quarter];
        place = (place + h >= turn) ? ((place + h) - turn) : (place + h);
    }
    if (self->start == 0u) {
        memset(sum, 0, summed * sizeof sum[0]);
    }
    for (size_t k = 0; k < summed; k++) {
        int32_t part[2];
        add_products(cosine, sine, &block[0][k], part);
        sum[k][RE] += rounded(part[RE], design->sum_shift);
        sum[k][IM] += rounded(part[IM], design->sum_shift);
    }
}

/* The end of the first half's integrals of a channel: I^n, n = 1 or 2, that of 1 in the unit of the channel. */
static int32_t edge_of(const pvid_fourier_values_q31 *values, const pvid_fourier_channel *channel, size_t first,
                       size_t n, int32_t hop)
{
    if (channel->integrand == PVID_FOURIER_NONE) {
        if (n == 2u) {
            return 24 * hop * hop;
        }
        return (channel->fold == 1u) ? (2 * hop) : (24 * hop);
    }
    return values->edge[first][n - 1u][channel->integrand];
}

/* S_h = A_h + (-1)^h B_h; the integrals of B are shifted to the start of A: by I^fold, and by I^1 t where fold is 2. */
static void join(const pvid_fourier_sums_q31 *self, const pvid_fourier_design_q31 *design,
                 const pvid_fourier_values_q31 *values, size_t h, pvid_fourier_window_q31 *window)
{
    const pvid_fourier_model_q31 *model = design->model;
    const size_t first = (size_t)self->target ^ 1u;
    const int32_t (*a)[2] = self->sum[first][h];
    const int32_t (*b)[2] = self->sum[self->target][h];
    const size_t summed = pvid_fourier_summed_q31(model);
    for (size_t k = 0; k < summed; k++) {
        const pvid_fourier_channel *channel = &model->channel[k];
        const pvid_fourier_format_q31 format = design->format[k];
        for (size_t part = 0; part < 2u; part++) {
            const int64_t own =
                ((h % 2u) == 0u) ? ((int64_t)a[k][part] + b[k][part]) : ((int64_t)a[k][part] - b[k][part]);
            int64_t shift = 0;
            if (channel->fold > 0u) {
                const int32_t end = edge_of(values, channel, first, channel->fold, design->hop);
                shift += pvid_round_shift_q31(pvid_product_q31(end, b[channel->plain][part]), format.plain);
            }
            if (channel->fold > 1u) {
                const int32_t end = edge_of(values, channel, first, 1, design->hop);
                shift += pvid_round_shift_q31(pvid_product_q31(end, b[channel->ramp][part]), format.ramp);
            }
            const int64_t total = pvid_round_shift_q31(own, format.own) + (((h % 2u) == 0u) ? shift : -shift);
            window->s[k][h][part] = (int32_t)total;
        }
    }
    if (summed < model->channels) { /* a constant */
        window->s[summed][h][RE] = (h == 0u) ? (2 * (int32_t)design->hop) : 0;
        window->s[summed][h][IM] = 0;
    }
}

void pvid_fourier_sums_slice_q31(pvid_fourier_sums_q31 *self, const pvid_fourier_design_q31 *design,
                                 const pvid_fourier_values_q31 *values, pvid_fourier_window_q31 *window)
{
    const size_t h = self->slice;
    add_block(self, design, h);
    if (self->joins) {
        join(self, design, values, h, window);
    }
    self->slice++;
}
