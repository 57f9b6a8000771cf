/* The loop over a differentiator's window, outwards from its centre. Private to the core.
 *
 * Inlined: unused orders cost nothing.
 */
#ifndef PVID_DIFFERENTIATOR_F32_H
#define PVID_DIFFERENTIATOR_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/differentiator.h"

/* ---- sums of blocks: tail[0 .. block - 1] holds the last samples, then the sum in use and the one begun anew; `step`
 * floats from one to the next ---- */

#define PVID_BLOCK_SUMS 2u /* places after the samples of a block */

/* Takes a sample in the place `at` of the oldest and returns the sum of the last `block` samples. */
static inline float pvid_block_sum_f32(float tail[], size_t step, size_t block, size_t at, float sample)
{
    float *sums = &tail[block * step];
    const float updated = sums[0] + (sample - tail[at * step]);
    const float anew = sums[step] + sample;
    const bool complete = (at + 1u) == block;
    const float sum = complete ? anew : updated;
    tail[at * step] = sample;
    sums[0] = sum;
    sums[step] = complete ? 0.0f : anew;
    return sum;
}

/* The place after `at`. */
static inline uint16_t pvid_block_next_f32(size_t block, size_t at)
{
    return (uint16_t)(((at + 1u) == block) ? 0u : (at + 1u));
}

/* ---- the window ---- */

/* Places that a bank needs in a channel's memory: its ring, and its block with its sums. */
uint32_t pvid_fir_places_f32(const pvid_fir_bank_f32 *bank);

/* Checks a bank and a rate as pvid_differentiator_init_f32 does. */
pvid_status pvid_fir_bank_is_valid_f32(const pvid_fir_bank_f32 *bank, float sample_rate_hz);

/* Copies a bank whose block is at least 1. */
void pvid_fir_take_bank_f32(pvid_fir_bank_f32 *own, const pvid_fir_bank_f32 *bank);

/* Stores a sample. Returns whether the window is full. */
static inline bool pvid_fir_push_f32(pvid_differentiator_f32 *self, float sample)
{
    const size_t head = self->head;
    const size_t block = self->bank.block;
    self->history[head] =
        (block > 1u) ? pvid_block_sum_f32(&self->history[self->length], 1, block, self->at, sample) : sample;
    self->at = (block > 1u) ? pvid_block_next_f32(block, self->at) : 0u;
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
