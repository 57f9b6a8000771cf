/* From samples to the signals of the refinement at its own rate. Private to the core. */
#ifndef PVID_REFINE_FRONT_F32_H
#define PVID_REFINE_FRONT_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#include "pvid/detail/refine_state.h"

/* Signals of an entry of the ring: inputs, and outputs (NaN: missing). Of a part of a step of Runge-Kutta: inputs at
 * its beginning, its middle and its end, outputs at the end of the step. */
typedef struct {
    float u[PVID_REFINE_ROOM_U];
#if PVID_REFINE_RUNGE_KUTTA
    float middle[PVID_REFINE_ROOM_U];
    float end[PVID_REFINE_ROOM_U];
#endif
    float z[PVID_REFINE_OUTPUTS];
} pvid_refine_signals_f32;

/* Steps of the motion: h seconds, and where they are Runge-Kutta's their parts, and those of one in which a sign may
 * change. */
typedef struct {
    float h;
    uint8_t parts;
    uint8_t fine_parts;
#if PVID_REFINE_OBSERVER
    const float *observer;
#endif
#if PVID_REFINE_TURNING
    const float *turn; /* of the outputs, 0: it does not turn */
#endif
} pvid_refine_steps_f32;

void pvid_refine_front_init_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config);

/* Forgets all samples. */
void pvid_refine_front_reset_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config);

/* A tick: it completed no entry of the ring, or one, or a block of samples with an input that is not finite. */
typedef enum { PVID_REFINE_NOTHING, PVID_REFINE_ENTERED, PVID_REFINE_BROKEN } pvid_refine_entry;

/* The first sample since the restart; the end of a block of samples. */
void pvid_refine_front_refer_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config,
                                 const float sample[]);
pvid_refine_entry pvid_refine_front_end_block_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config,
                                                  const float sample[]);

#if PVID_REFINE_INTEGRALS
/* The integral of an input by trapezoids, with its newest sample: since init, without what gaps contained. A sample
 * that is not finite has no share, but breaks the block. */
static inline float pvid_refine_integrated(pvid_refine_front_f32 *self, size_t input, float x)
{
    const float share = self->half_tick[input] * (x + self->before[input]);
    self->before[input] = x;
    if (!pvid_finite_f32(share)) {
        return share;
    }
    self->integral[input] += share;
    return self->integral[input];
}
#endif

/* A sample behind the first one. Returns whether it is the last one of a block of samples. */
PVID_ALWAYS_INLINE bool pvid_refine_front_add_f32(pvid_refine_front_f32 *self, const float sample[])
{
#if PVID_REFINE_RUNGE_KUTTA
    if (self->wait == self->middle) {
        for (size_t i = 0; PVID_REFINE_IS_INPUT(i); i++) {
            const float x = sample[self->sample[i]] - self->reference[i];
            self->ahead[i] = self->between ? (self->sum[i] + (0.5f * x)) : self->sum[i];
        }
    }
#endif
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_SIGNALS; i++)
    {
        const float x = sample[self->sample[i]];
#if PVID_REFINE_INTEGRALS
        if (PVID_REFINE_IS_INPUT(i) && (self->half_tick[i] > 0.0f)) {
            self->sum[i] += pvid_refine_integrated(self, i, x);
            continue;
        }
#endif
        self->sum[i] += PVID_REFINE_IS_INPUT(i) ? (x - self->reference[i]) : x;
    }
    self->wait--;
    return self->wait == 0u;
}

/* Entries of the ring since the restart: from the first one that is complete, up to the end. Older ones than those of
 * the room are overwritten. */
uint32_t pvid_refine_front_first_f32(const pvid_refine_front_f32 *self);
uint32_t pvid_refine_front_room_f32(const pvid_refine_front_f32 *self);

PVID_ALWAYS_INLINE uint32_t pvid_refine_front_end_f32(const pvid_refine_front_f32 *self)
{
    return (self->next > self->behind) ? (self->next - self->behind) : 0u;
}

/* Outputs of an entry. */
PVID_ALWAYS_INLINE void pvid_refine_front_outputs_f32(const pvid_refine_front_f32 *self, uint32_t entry, float output[])
{
    const int16_t *value = self->ring[entry & ((uint32_t)PVID_REFINE_RING - 1u)];
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++)
    {
        const int16_t z = value[PVID_REFINE_INPUTS + i];
        const float x = (float)z * self->from_counts[PVID_REFINE_INPUTS + i];
        output[i] = (z == INT16_MIN) ? pvid_from_bits_f32(0x7FC00000u) : x;
    }
}

/* Signals of an entry. */
PVID_ALWAYS_INLINE void pvid_refine_front_read_f32(const pvid_refine_front_f32 *self, uint32_t entry,
                                                   pvid_refine_signals_f32 *signals)
{
    const int16_t *value = self->ring[entry & ((uint32_t)PVID_REFINE_RING - 1u)];
    PVID_UNROLL for (size_t i = 0; PVID_REFINE_IS_INPUT(i); i++)
    {
        signals->u[i] = (float)value[i] * self->from_counts[i];
    }
    pvid_refine_front_outputs_f32(self, entry, signals->z);
}

#if PVID_REFINE_TURNING
/* A difference of angles without whole turns; turn 0: unchanged. */
static inline float pvid_refine_turned(float difference, float turn)
{
    const float turns = (turn > 0.0f) ? (difference / turn) : 0.0f;
    const bool countable = (turns > -1.0e9f) && (turns < 1.0e9f);
    const float half = (turns < 0.0f) ? -0.5f : 0.5f;
    return countable ? (difference - (turn * (float)(int32_t)(turns + half))) : difference;
}
#endif

#if PVID_REFINE_RUNGE_KUTTA
/* Inputs at the time t, 0..1 from an entry to the next one: of the cubic through the two entries and their neighbours;
 * held ones of the parabola with the means of this step and its neighbours. */
void pvid_refine_front_between_f32(const pvid_refine_front_f32 *self, uint32_t entry, float t, float input[]);
#endif

#endif
