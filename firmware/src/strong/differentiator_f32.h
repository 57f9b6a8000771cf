/* The loop over a differentiator's window, outwards from its centre. Private to the core.
 *
 * Inlined, so that two channels in step share the loop and the weights' loads, and unused orders cost nothing.
 */
#ifndef PVID_DIFFERENTIATOR_F32_H
#define PVID_DIFFERENTIATOR_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/differentiator.h"

/* Stores a sample. Returns whether the window is full. */
static inline bool pvid_fir_push_f32(pvid_differentiator_f32 *self, float sample)
{
    const size_t head = self->head;
    self->history[head] = sample;
    self->head = (uint16_t)((head + 1u == self->length) ? 0u : (head + 1u));
    if (self->filled < self->length) {
        self->filled++;
    }
    return self->filled == self->length;
}

/* Places of two samples as far from the centre. */
typedef struct {
    size_t stride;
    size_t length;
    size_t newer;
    size_t older;
} pvid_fir_walk;

/* Both places at the centre: half * stride after head, the oldest sample. */
static inline pvid_fir_walk pvid_fir_centre_f32(const pvid_differentiator_f32 *self)
{
    const size_t length = self->length;
    const size_t ahead = self->head + (length / 2u);
    const size_t centre = (ahead >= length) ? (ahead - length) : ahead;
    const pvid_fir_walk walk = {self->bank.stride, length, centre, centre};
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
    out[0] = sums->middle + sums->sum[0];
    out[1] = sums->sum[1] * self->rate_power[0];
    out[2] = sums->sum[2] * self->rate_power[1];
    out[3] = sums->sum[3] * self->rate_power[2];
    out[4] = sums->sum[4] * self->rate_power[3];
}

#endif
