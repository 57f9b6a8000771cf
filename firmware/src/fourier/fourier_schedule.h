/* The schedule of the weak form of any mechanism: the work of a tick by its place in a step, for both cores. Private to
 * the core.
 *
 * A step has D ticks. The first ones run the front end's FIR job, about 16 pairs each but in at most half of the step;
 * the next one forms the step's channels; in those behind it a block of four steps is added to the sums, some harmonics
 * a tick, and at the end of a window these are joined. In what is left of them stages of the last whole window run.
 * Below 8 ticks the job takes one tick and the channels the last one; all but that add and run stages. With D = 1 every
 * tick does all of it.
 */
#ifndef PVID_FOURIER_SCHEDULE_H
#define PVID_FOURIER_SCHEDULE_H

#include <stdint.h>

/* Least D with ticks of their own for the job. */
#define PVID_FOURIER_LONG_STEP 8u

/* Pairs of a tick of the job, if half of the step is enough. */
#define PVID_FOURIER_PAIRS 16u

/* Largest number of stages per tick. */
#define PVID_FOURIER_STAGES_MAX 64u

/* Ticks of a job. */
static inline uint32_t pvid_fourier_job_ticks(uint32_t decimation, uint32_t pairs)
{
    const uint32_t few = (pairs + (PVID_FOURIER_PAIRS - 1u)) / PVID_FOURIER_PAIRS;
    const uint32_t half = decimation / 2u;
    const uint32_t ticks = (few < half) ? few : half;
    return ((decimation < PVID_FOURIER_LONG_STEP) || (ticks == 0u)) ? 1u : ticks;
}

/* Place in a step of the tick that forms the channels. */
static inline uint32_t pvid_fourier_step_place(uint32_t decimation, uint32_t job_ticks)
{
    return (decimation < PVID_FOURIER_LONG_STEP) ? (decimation - 1u) : job_ticks;
}

/* Place of the first tick that adds or runs stages. */
static inline uint32_t pvid_fourier_work_place(uint32_t decimation, uint32_t job_ticks)
{
    return (decimation < PVID_FOURIER_LONG_STEP) ? 0u : (job_ticks + 1u);
}

/* Ticks of a block of four steps that add harmonics or run stages. */
static inline uint32_t pvid_fourier_free_ticks(uint32_t decimation, uint32_t job_ticks)
{
    const uint32_t behind = decimation - pvid_fourier_work_place(decimation, job_ticks);
    const uint32_t step = ((decimation < PVID_FOURIER_LONG_STEP) && (decimation > 1u)) ? 1u : 0u;
    return 4u * (behind - step);
}

/* Harmonics that a tick adds or joins, such that a block that ends a window is added and joined before the next one. */
static inline uint8_t pvid_fourier_items_per_tick(uint32_t free_ticks, uint32_t harmonics)
{
    return (uint8_t)(((2u * harmonics) + (free_ticks - 1u)) / free_ticks);
}

/* Fewest stages per tick that finish a window before the next one is joined; 0: more than PVID_FOURIER_STAGES_MAX. The
 * blocks of a half but the one in which the window is joined have ticks without harmonics. */
static inline uint8_t pvid_fourier_stages_per_tick(uint32_t stages, uint32_t hop, uint32_t free_ticks,
                                                   uint32_t harmonics)
{
    const uint32_t items = pvid_fourier_items_per_tick(free_ticks, harmonics);
    const uint32_t adding = (harmonics + (items - 1u)) / items;
    const uint32_t ticks = ((hop / 4u) - 1u) * (free_ticks - adding);
    const uint32_t stages_per_tick = (ticks > 0u) ? ((stages + (ticks - 1u)) / ticks) : UINT32_MAX;
    return (uint8_t)((stages_per_tick <= PVID_FOURIER_STAGES_MAX) ? stages_per_tick : 0u);
}

#endif
