/* The schedule of the weak form of any mechanism in float32. Private to the core.
 *
 * The last tick of a step's D forms its jets, the tick behind it the channels. The others add a block of eight steps to
 * the sums, some harmonics a tick, and at the end of a window join these; when nothing is to be added, they run stages
 * of the last whole window: all of them, or where the window is done in time every second, fourth ... alone, so that
 * blocks of samples take alike. Below 4 ticks jets and channels are of one tick; with D = 1 every tick does all. All
 * other ticks only add their samples to the front end's block.
 */
#ifndef PVID_WEAK_TICKS_F32_H
#define PVID_WEAK_TICKS_F32_H

#include <stdint.h>

#include "pvid/weak.h"

/* Largest number of stages per tick. */
#define PVID_WEAK_MOST_STAGES 255u

/* Least D whose jets and channels have a tick each. */
#define PVID_WEAK_TWO_TICKS 4u

/* Ticks of a block of steps that add harmonics or run stages. */
static inline uint32_t pvid_weak_free_ticks_f32(uint32_t decimation)
{
    const uint32_t used = (decimation >= PVID_WEAK_TWO_TICKS) ? 2u : 1u;
    return PVID_WEAK_BLOCK * ((decimation > 1u) ? (decimation - used) : 1u);
}

/* Harmonics that a tick adds or joins, such that a block that ends a window is added and joined before the next one. */
static inline uint8_t pvid_weak_items_f32(uint32_t free_ticks, uint32_t harmonics)
{
    return (uint8_t)(((2u * harmonics) + (free_ticks - 1u)) / free_ticks);
}

/* Blocks that are needed: one where the free ticks of a step add and join all harmonics, before the next step's
 * channels take the place of the first of the block. */
static inline uint32_t pvid_weak_blocks_f32(uint32_t free_ticks, uint32_t harmonics)
{
    return (((free_ticks / PVID_WEAK_BLOCK) * pvid_weak_items_f32(free_ticks, harmonics)) >= (2u * harmonics)) ? 1u
                                                                                                               : 2u;
}

/* Fewest stages per tick that finish a window before the next one is joined; 0: more than PVID_WEAK_MOST_STAGES. The
 * blocks of a half but the one in which the window is joined have ticks without harmonics. */
static inline uint8_t pvid_weak_stages_f32(uint32_t stages, uint32_t hop, uint32_t free_ticks, uint32_t harmonics)
{
    const uint32_t items = pvid_weak_items_f32(free_ticks, harmonics);
    const uint32_t adding = (harmonics + (items - 1u)) / items;
    const uint32_t ticks = ((hop / PVID_WEAK_BLOCK) - 1u) * (free_ticks - adding);
    const uint32_t stages_per_tick = (ticks > 0u) ? ((stages + (ticks - 1u)) / ticks) : UINT32_MAX;
    return (uint8_t)((stages_per_tick <= PVID_WEAK_MOST_STAGES) ? stages_per_tick : 0u);
}

#endif
