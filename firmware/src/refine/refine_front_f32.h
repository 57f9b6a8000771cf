/* From samples to the signals of the refinement at its own rate. Private to the core. */
#ifndef PVID_REFINE_FRONT_F32_H
#define PVID_REFINE_FRONT_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#include "refine/refine_pass_f32.h"

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

PVID_ALWAYS_INLINE pvid_refine_entry pvid_refine_front_step_f32(pvid_refine_front_f32 *self,
                                                                const pvid_refine_config_f32 *config,
                                                                const float sample[])
{
    if (!self->referred) {
        pvid_refine_front_refer_f32(self, config, sample);
    }
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_SIGNALS; i++)
    {
        const float x = sample[self->sample[i]];
        self->sum[i] += (i < (size_t)PVID_REFINE_INPUTS) ? (x - self->reference[i]) : x;
    }
    self->wait--;
    return (self->wait > 0u) ? PVID_REFINE_NOTHING : pvid_refine_front_end_block_f32(self, config, sample);
}

/* Entries of the ring since the restart: from the first one that is complete, up to the end. Older ones than those of
 * the room are overwritten. */
uint32_t pvid_refine_front_first_f32(const pvid_refine_front_f32 *self);
uint32_t pvid_refine_front_end_f32(const pvid_refine_front_f32 *self);
uint32_t pvid_refine_front_room_f32(const pvid_refine_front_f32 *self);

/* Signals of `steps` entries, 1 to 3; of inputs those of the reach as well. */
PVID_ALWAYS_INLINE void pvid_refine_front_read_f32(const pvid_refine_front_f32 *self, uint32_t entry, uint32_t steps,
                                                   pvid_refine_signals_f32 *signals)
{
    const uint32_t mask = (uint32_t)PVID_REFINE_RING - 1u;
    for (uint32_t k = 0; k < (steps + (2u * PVID_REFINE_REACH)); k++) {
        const int16_t *value = self->ring[((entry - PVID_REFINE_REACH) + k) & mask];
        PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_INPUTS; i++)
        {
            signals->u[k][i] = (float)value[i] * self->from_counts[i];
        }
    }
    for (uint32_t k = 0; k < steps; k++) {
        const int16_t *value = self->ring[(entry + k) & mask];
        PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++)
        {
            const int16_t z = value[PVID_REFINE_INPUTS + i];
            signals->z[k][i] = (z == INT16_MIN) ? pvid_from_bits_f32(0x7FC00000u)
                                                : ((float)z * self->from_counts[PVID_REFINE_INPUTS + i]);
        }
    }
}

#endif
