/* Front end: from samples to signals, to their block sums, to jets at a step. Private to the core. */
#ifndef PVID_WEAK_FRONT_F32_H
#define PVID_WEAK_FRONT_F32_H

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "number/exact.h"
#include "number/finite_f32.h"
#include "pvid/weak.h"

/* D. */
static inline uint8_t pvid_weak_decimation(uint8_t decimation)
{
    return (PVID_EXACT != 0) ? (uint8_t)PVID_MAX_DECIMATION : decimation;
}

/* Half of the longest compensator [steps]. */
uint16_t pvid_weak_front_half_f32(const pvid_weak_design_f32 *design);

/* Numbers in the line: block sums of each signal, and the steps for the compensators, twice. */
uint32_t pvid_weak_front_length_f32(const pvid_weak_design_f32 *design);

/* Requires a valid design. */
void pvid_weak_front_init_f32(pvid_weak_front_f32 *self, const pvid_weak_design_f32 *design, float sample_rate_hz);

/* Ticks from the first sample after a restart to the instant of the first step. */
uint16_t pvid_weak_front_lead_f32(const pvid_weak_front_f32 *self);

/* Behind a block that gave no step: whether its output lies before the first step since a restart; then writes the
 * jets there, as far as the output alone has them: signals unfiltered, 0 of derivatives. `first`: it is the first. */
bool pvid_weak_front_early_f32(const pvid_weak_front_f32 *self, const pvid_weak_design_f32 *design, float jet[],
                               bool *first);

/* An empty line. */
void pvid_weak_front_reset_f32(pvid_weak_front_f32 *self);

/* Adds the finite samples of a tick, where signals need samples of other ticks or are not one a sample. */
void pvid_weak_front_derive_f32(pvid_weak_front_f32 *self, const pvid_weak_model_f32 *model, const float sample[]);

/* At the end of a block: its outputs to the line. Returns true if the line is full: then `jet` contains the step's
 * jets.
 */
bool pvid_weak_front_step_f32(pvid_weak_front_f32 *self, const pvid_weak_design_f32 *design, float jet[]);

/* What the bits of a sample without its sign, shifted left by one, are compared with. */
static inline uint32_t pvid_weak_front_limit_f32(float largest)
{
    return (pvid_bits_f32(largest) << 1u) + 1u;
}

/* Returns whether none of this number of samples is beyond its limit: never before init, with no samples or limits. */
static inline bool pvid_weak_front_fits_f32(const uint32_t limit[], uint32_t number, const float sample[])
{
    const size_t count = PVID_COUNT(PVID_MAX_SAMPLES, number);
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < count; i++) {
        if ((pvid_bits_f32(sample[i]) << 1u) >= limit[i]) {
            return false;
        }
    }
    return count > 0u;
}

/* Adds this number of finite samples of a tick to the block's sums. */
static inline void pvid_weak_front_add_f32(float sums[], uint32_t number, const float sample[])
{
    const size_t count = PVID_COUNT(PVID_MAX_SAMPLES, number);
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < count; i++) {
        const float once = sums[2u * i] + sample[i];
        sums[2u * i] = once;
        sums[(2u * i) + 1u] += once;
    }
}

/* Adds those of at most so many ticks, up to the first with one beyond its limit. Returns of how many. */
static inline uint32_t pvid_weak_front_add_ticks_f32(pvid_weak_front_f32 *self, uint32_t number, const float samples[],
                                                     uint32_t most)
{
    const size_t count = PVID_COUNT(PVID_MAX_SAMPLES, number);
    const float *sample = samples;
    uint32_t left;
    uint32_t limit[PVID_MAX_SAMPLES];
    float sums[2 * PVID_MAX_SAMPLES];
    memcpy(limit, self->limit, count * sizeof limit[0]);
    memcpy(sums, self->line, 2u * count * sizeof sums[0]);
    PVID_UNROLL_BY_FOUR
    for (left = most; left > 0u; left--) {
        if (!pvid_weak_front_fits_f32(limit, number, sample)) {
            break;
        }
        pvid_weak_front_add_f32(sums, number, sample);
        sample = &sample[count];
    }
    memcpy(self->line, sums, 2u * count * sizeof sums[0]);
    return most - left;
}

#endif
