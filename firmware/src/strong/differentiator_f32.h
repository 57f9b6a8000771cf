/* The loop over a differentiator's window, outwards from its centre. Private to the core.
 *
 * Inlined: unused orders cost nothing.
 */
#ifndef PVID_DIFFERENTIATOR_F32_H
#define PVID_DIFFERENTIATOR_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/differentiator.h"

/* Checks a bank and a rate as pvid_differentiator_init_f32 does. */
pvid_status pvid_fir_bank_is_valid_f32(const pvid_fir_bank_f32 *bank, float sample_rate_hz);

/* Points of a bank's window. */
static inline uint16_t pvid_fir_length_f32(const pvid_fir_bank_f32 *bank)
{
    return (uint16_t)((2u * (uint32_t)bank->half * bank->stride) + 1u);
}

/* Samples of a point. */
static inline uint32_t pvid_fir_block_f32(const pvid_fir_bank_f32 *bank)
{
    return (bank->block > 1u) ? bank->block : 1u;
}

/* Adds a sample to its block. Returns whether the block is complete and the window full. */
static inline bool pvid_fir_push_f32(pvid_differentiator_f32 *self, float sample)
{
    const size_t head = self->head;
    const uint32_t at = self->at;
    self->history[head] = (at == 0u) ? sample : (self->history[head] + sample);
    const bool complete = (at + 1u) >= self->bank.block;
    self->at = (uint16_t)(complete ? 0u : (at + 1u));
    if (!complete) {
        return false;
    }
    self->head = (uint16_t)((head + 1u == self->length) ? 0u : (head + 1u));
    if (self->missing > 0u) {
        self->missing--;
    }
    return self->missing == 0u;
}

/* Places of two samples as far from the centre. */
typedef struct {
    size_t stride;
    size_t length;
    size_t newer;
    size_t older;
} pvid_fir_walk;

/* Both places at the centre of a ring whose oldest point is at `head`: half * stride after it. */
static inline pvid_fir_walk pvid_fir_centre_f32(size_t stride, size_t length, size_t head)
{
    const size_t ahead = head + (length / 2u);
    const size_t centre = (ahead >= length) ? (ahead - length) : ahead;
    const pvid_fir_walk walk = {stride, length, centre, centre};
    return walk;
}

static inline void pvid_fir_outwards(pvid_fir_walk *self)
{
    const size_t newer = self->newer + self->stride;
    self->newer = (newer >= self->length) ? (newer - self->length) : newer;
    self->older = ((self->older < self->stride) ? (self->older + self->length) : self->older) - self->stride;
}

typedef struct {
    float middle; /* centre sample */
    float sum[PVID_ORDERS];
} pvid_fir_sums_f32;

/* The sums of the nearest samples on either side; weight points to the first weight of a bank, whose orders are
 * `half` apart. */
static inline pvid_fir_sums_f32 pvid_fir_begin_f32(const float *weight, size_t half, float middle, float after,
                                                   float before)
{
    const float even = (after - middle) + (before - middle);
    const float odd = after - before;
    const pvid_fir_sums_f32 sums = {middle,
                                    {weight[0] * even, weight[half] * odd, weight[2u * half] * even,
                                     weight[3u * half] * odd, weight[4u * half] * even}};
    return sums;
}

/* Adds the next samples on either side, with the next weights. */
static inline void pvid_fir_add_f32(pvid_fir_sums_f32 *self, const float *weight, size_t half, float after,
                                    float before)
{
    const pvid_fir_sums_f32 more = pvid_fir_begin_f32(weight, half, self->middle, after, before);
    self->sum[0] += more.sum[0];
    self->sum[1] += more.sum[1];
    self->sum[2] += more.sum[2];
    self->sum[3] += more.sum[3];
    self->sum[4] += more.sum[4];
}

/* out[k] [unit/s^k] of the channel that `self` is. */
static inline void pvid_fir_end_f32(const pvid_differentiator_f32 *self, const pvid_fir_sums_f32 *sums,
                                    float out[PVID_ORDERS])
{
    out[0] = (sums->middle + sums->sum[0]) * self->scale[0];
    out[1] = sums->sum[1] * self->scale[1];
    out[2] = sums->sum[2] * self->scale[2];
    out[3] = sums->sum[3] * self->scale[3];
    out[4] = sums->sum[4] * self->scale[4];
}

#endif
