/* Sums of the half windows, a block of steps at a time, and their join. Private to the core. */
#ifndef PVID_WEAK_SUMS_F32_H
#define PVID_WEAK_SUMS_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/weak.h"

/* Empty halves; the block that is being added is forgotten. */
void pvid_weak_sums_reset_f32(pvid_weak_sums_f32 *self, uint8_t harmonics);

/* Where the values of the next step belong. */
static inline float *pvid_weak_sums_place_f32(pvid_weak_sums_f32 *self)
{
    return self->block[self->filling][self->index % PVID_WEAK_BLOCK];
}

/* Counts that step, of so many channels. Returns true if it completes a half; index 0 then follows. */
bool pvid_weak_sums_count_f32(pvid_weak_sums_f32 *self, uint16_t hop, size_t channels);

/* Joins the window that the last two halves form, as soon as the last block is added. edge: I^1 and I^2 of the window's
 * first half at its end. */
void pvid_weak_sums_join_f32(pvid_weak_sums_f32 *self, float edge[2][PVID_MAX_INTEGRANDS]);

/* Returns whether a block is being added or a window is being joined. */
static inline bool pvid_weak_sums_is_busy_f32(const pvid_weak_sums_f32 *self, uint8_t harmonics)
{
    return (self->harmonic < harmonics) || (self->joined < harmonics);
}

/* Returns whether a harmonic of a window is to be joined: right behind the addition to it. */
static inline bool pvid_weak_sums_joins_f32(const pvid_weak_sums_f32 *self)
{
    return self->joined < self->harmonic;
}

/* Adds the block to the next harmonic of all channels. */
void pvid_weak_sums_add_f32(pvid_weak_sums_f32 *self, const pvid_weak_design_f32 *design, size_t channels);

/* Joins the next harmonic of all channels to `window`, which may be the older half's sums. */
void pvid_weak_sums_join_one_f32(pvid_weak_sums_f32 *self, const pvid_weak_design_f32 *design, size_t channels,
                                 float dt, float window[][PVID_MAX_CHANNELS][2]);

/* The sums of the joined window, [harmonics]: of their own or in the place of the older half's. */
static inline float (*pvid_weak_window_f32(pvid_weak_f32 *self)) [PVID_MAX_CHANNELS][2] {
#if PVID_MAX_WINDOWS > 0
    return self->finish.work.rows.window;
#else
    return self->sums.sum[self->sums.target ^ 1u];
#endif
}

#endif
