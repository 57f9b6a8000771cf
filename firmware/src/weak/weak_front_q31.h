/* Front end: from counts to signals, to their block sums, to jets at a step. Private to the core. */
#ifndef PVID_WEAK_FRONT_Q31_H
#define PVID_WEAK_FRONT_Q31_H

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "number/exact.h"
#include "pvid/weak_q31.h"

/* Half of the longest compensator of the jets [steps]. */
uint16_t pvid_weak_front_half_q31(const pvid_weak_design_q31 *design);

/* Numbers in the line: block sums of each signal, and the steps for the compensators, twice. */
uint32_t pvid_weak_front_length_q31(const pvid_weak_design_q31 *design);

/* Requires a valid design; offset as in the configuration. */
void pvid_weak_front_init_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design, const int32_t offset[]);

/* Ticks from the first sample after a restart to the instant of the first step. */
uint16_t pvid_weak_front_lead_q31(const pvid_weak_front_q31 *self);

/* An empty line. */
void pvid_weak_front_reset_q31(pvid_weak_front_q31 *self);

/* Adds the readings of a tick, where signals need those of other ticks or are not one a sample. Returns as
 * pvid_weak_front_add_q31. */
bool pvid_weak_front_derive_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design, const int32_t reading[]);

/* At the end of a block: its outputs to the line. Returns true if the line is full: then jet[] contains the step's
 * jets. */
bool pvid_weak_front_step_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design, int32_t jet[]);

/* Behind a block that gave no step: whether its output lies before the first step since a restart; then writes the
 * jets there, as far as the output alone has them: signals unfiltered, 0 of derivatives. `first`: it is the first. */
bool pvid_weak_front_early_q31(const pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design, int32_t jet[],
                               bool *first);

/* A reading about its offset; |offset| <= 2^30, so that one beyond 2^31 stays beyond full scale. */
static inline int32_t pvid_weak_count_q31(int32_t reading, int32_t offset)
{
    return (int32_t)((uint32_t)reading - (uint32_t)offset);
}

/* Whether |count| <= full scale: 0..2 full scale without the sign. */
static inline bool pvid_weak_is_within_q31(int32_t count, int32_t full_scale)
{
    return ((uint32_t)count + (uint32_t)full_scale) <= (2u * (uint32_t)full_scale);
}

/* Adds the readings of a tick, each a signal, to the block. Returns as pvid_weak_front_add_q31. */
static inline bool pvid_weak_front_plain_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design,
                                             uint32_t signals, const int32_t reading[])
{
    int32_t *sums = self->line;
    const int32_t *full_scale = design->full_scale;
    const int32_t *offset = self->offset;
    const size_t count = PVID_COUNT(PVID_EXACT_SIGNALS, signals);
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < count; i++) {
        const int32_t x = pvid_weak_count_q31(reading[i], offset[i]);
        if (!pvid_weak_is_within_q31(x, full_scale[i])) {
            return false;
        }
        const int32_t once = sums[2u * i] + x;
        sums[2u * i] = once;
        sums[(2u * i) + 1u] += once;
    }
    return true;
}

/* The same of at most so many ticks, up to the first with a reading beyond its full scale. Returns of how many. */
static inline uint32_t pvid_weak_front_plain_ticks_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design,
                                                       uint32_t signals, const int32_t readings[], uint32_t most)
{
    const size_t count = PVID_COUNT(PVID_MAX_SAMPLES, signals);
    const int32_t *full_scale = design->full_scale;
    const int32_t *offset = self->offset;
    const int32_t *reading = readings;
    uint32_t left;
    int32_t sums[2 * PVID_MAX_SAMPLES];
    memcpy(sums, self->line, 2u * count * sizeof sums[0]);
    for (left = most; left > 0u; left--) {
        bool within = true;
        PVID_UNROLL_EXACT
        for (size_t i = 0; i < count; i++) {
            within = within && pvid_weak_is_within_q31(pvid_weak_count_q31(reading[i], offset[i]), full_scale[i]);
        }
        if (!within) {
            break;
        }
        PVID_UNROLL_EXACT
        for (size_t i = 0; i < count; i++) {
            sums[2u * i] += pvid_weak_count_q31(reading[i], offset[i]);
            sums[(2u * i) + 1u] += sums[2u * i];
        }
        reading = &reading[count];
    }
    memcpy(self->line, sums, 2u * count * sizeof sums[0]);
    return most - left;
}

/* Adds the readings of a tick to the block. Returns false if one is beyond its full scale; the front end must then be
 * reset. */
static inline bool pvid_weak_front_add_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design,
                                           const int32_t reading[])
{
    if (!self->plain) {
        return pvid_weak_front_derive_q31(self, design, reading);
    }
    return pvid_weak_front_plain_q31(self, design, design->model->signals, reading);
}

#endif
