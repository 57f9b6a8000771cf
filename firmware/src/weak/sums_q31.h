/* Sums of half windows, a block of steps and some harmonics at a time, and their join. Private to the core. */
#ifndef PVID_WEAK_SUMS_Q31_H
#define PVID_WEAK_SUMS_Q31_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/weak_q31.h"

/* H + 1, H = K/2 + n/2. */
static inline uint8_t pvid_weak_harmonics_q31(const pvid_weak_design_q31 *design)
{
    return (uint8_t)((design->functions / 2u) + (design->power / 2u) + 1u);
}

/* S_h of a window [harmonics]: of its own, or in the place of the older half's sums. */
static inline int32_t (*pvid_weak_window_sums_q31(pvid_weak_sums_q31 *sums, pvid_weak_window_q31 *window))
    [PVID_MAX_CHANNELS][2] {
#if PVID_MAX_WINDOWS > 0
        (void)sums;
        return window->s;
#else
        return sums->sum[window->half];
#endif
    }

/* No block, no half. */
void pvid_weak_sums_reset_q31(pvid_weak_sums_q31 *self);

/* Where the first channel of the next step goes: step `index` of a half. */
static inline pvid_weak_entry_q31 *pvid_weak_sums_place_q31(pvid_weak_sums_q31 *self, uint16_t index)
{
    return &self->block[self->filling][0][index % (uint16_t)PVID_WEAK_BLOCK_Q31];
}

/* After they are written. A full block begins to be added; the one before it must be done. A half behind another one
 * completes a window. */
void pvid_weak_sums_next_q31(pvid_weak_sums_q31 *self, const pvid_weak_design_q31 *design, uint16_t index,
                             uint8_t half);

/* The next of `left` items: the block is added to the sums of a harmonic, each in turn, then where it completes a
 * window the halves are joined, each harmonic in turn. With the first block of a half its sums begin anew. */
void pvid_weak_sums_item_q31(pvid_weak_sums_q31 *self, const pvid_weak_design_q31 *design,
                             const pvid_weak_values_q31 *values, pvid_weak_window_q31 *window);

#endif
