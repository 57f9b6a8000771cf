/* From samples to the signals of the refinement at its own rate. Private to the core. */
#ifndef PVID_REFINE_FRONT_F32_H
#define PVID_REFINE_FRONT_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#include "pvid/detail/refine_state.h"

/* Signals of an entry of the ring: inputs, and outputs (NaN: missing). */
typedef struct {
    float u[PVID_REFINE_INPUTS];
    float z[PVID_REFINE_OUTPUTS];
} pvid_refine_signals_f32;

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

/* A sample behind the first one. Returns whether it is the last one of a block of samples. */
PVID_ALWAYS_INLINE bool pvid_refine_front_add_f32(pvid_refine_front_f32 *self, const float sample[])
{
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_SIGNALS; i++)
    {
        const float x = sample[self->sample[i]];
        self->sum[i] += (i < (size_t)PVID_REFINE_INPUTS) ? (x - self->reference[i]) : x;
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

/* Signals of an entry. */
PVID_ALWAYS_INLINE void pvid_refine_front_read_f32(const pvid_refine_front_f32 *self, uint32_t entry,
                                                   pvid_refine_signals_f32 *signals)
{
    const int16_t *value = self->ring[entry & ((uint32_t)PVID_REFINE_RING - 1u)];
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_INPUTS; i++)
    {
        signals->u[i] = (float)value[i] * self->from_counts[i];
    }
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++)
    {
        const int16_t z = value[PVID_REFINE_INPUTS + i];
        const float x = (float)z * self->from_counts[PVID_REFINE_INPUTS + i];
        signals->z[i] = (z == INT16_MIN) ? pvid_from_bits_f32(0x7FC00000u) : x;
    }
}

#endif
