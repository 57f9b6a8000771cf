/* The schedule of the weak form of any mechanism: the work of a tick by its place, for both cores. Private to the core.
 *
 * A step takes D ticks: the first D - 1 run the front end's FIR job, the last one forms the step's channels. In the
 * first D - 1 a block of four steps is added to the sums, some harmonics a tick, and at the end of a window these are
 * joined; in ticks that are free of both, stages of the last whole window run. With D = 1 every tick does all of it.
 */
#ifndef PVID_FOURIER_SCHEDULE_H
#define PVID_FOURIER_SCHEDULE_H

#include <stdint.h>

/* Largest number of stages per tick. */
#define PVID_FOURIER_STAGES_MAX 64u

/* Ticks of a block of four steps that add harmonics or run stages. */
static inline uint32_t pvid_fourier_free_ticks(uint32_t decimation)
{
    return (decimation > 1u) ? (4u * (decimation - 1u)) : 4u;
}

/* Harmonics that a tick adds or joins, such that a block that ends a window is added and joined before the next one. */
static inline uint8_t pvid_fourier_items_per_tick(uint32_t decimation, uint32_t harmonics)
{
    const uint32_t ticks = pvid_fourier_free_ticks(decimation);
    return (uint8_t)(((2u * harmonics) + (ticks - 1u)) / ticks);
}

/* Fewest stages per tick that finish a window before the next one is joined; 0: more than PVID_FOURIER_STAGES_MAX. The
 * blocks of a half but the one in which the window is joined have ticks without harmonics. */
static inline uint8_t pvid_fourier_stages_per_tick(uint32_t stages, uint32_t hop, uint32_t decimation,
                                                   uint32_t harmonics)
{
    const uint32_t items = pvid_fourier_items_per_tick(decimation, harmonics);
    const uint32_t adding = (harmonics + (items - 1u)) / items;
    const uint32_t ticks = ((hop / 4u) - 1u) * (pvid_fourier_free_ticks(decimation) - adding);
    const uint32_t stages_per_tick = (ticks > 0u) ? ((stages + (ticks - 1u)) / ticks) : UINT32_MAX;
    return (uint8_t)((stages_per_tick <= PVID_FOURIER_STAGES_MAX) ? stages_per_tick : 0u);
}

#endif
