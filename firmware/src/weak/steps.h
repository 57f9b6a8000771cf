/* Gauss-Newton steps of a window and the pace of its stages, the same in float32 and in fixed point. Private to the
 * core. */
#ifndef PVID_WEAK_STEPS_H
#define PVID_WEAK_STEPS_H

#include <stdbool.h>
#include <stdint.h>

/* Windows that have `iterations` steps each. By then p has come near from a start that is 50 % off; later windows have
 * one step, and the next window goes on from there. */
#define PVID_WEAK_EARLY_WINDOWS 8u

/* judged: windows before this one. */
static inline uint8_t pvid_weak_steps(uint8_t iterations, uint16_t judged)
{
    return (judged < PVID_WEAK_EARLY_WINDOWS) ? iterations : 1u;
}

/* Largest pace. */
#define PVID_WEAK_MOST_PACE 3u

/* The pace of a window's stages: those ticks run one that are a multiple of 2^pace before the last of their step, so
 * that blocks of samples take alike. It is 0, all ticks, unless all stages are done before the next window is joined,
 * and `columns` of them, which read its sums, before the next block is added. blocks: of so many steps in half a
 * window; ticks: of a step that add, join or run stages; joining: ticks that add a block and join a window. */
static inline uint8_t pvid_weak_pace(uint32_t stages, uint32_t columns, uint32_t blocks, uint32_t steps, uint32_t ticks,
                                     uint32_t joining)
{
    uint8_t pace = 0;
    for (uint32_t next = 1; next <= PVID_WEAK_MOST_PACE; next++) {
        const uint32_t paced = steps * (ticks >> next);
        const bool done =
            (paced >= (columns + joining)) && (((blocks - 1u) * (paced - ((joining + 1u) / 2u))) >= stages);
        pace = done ? (uint8_t)next : pace;
    }
    return pace;
}

/* Returns whether a tick, so many before the last of its step, runs none. */
static inline bool pvid_weak_rests(uint32_t wait, uint8_t pace)
{
    return ((wait >> pace) << pace) != wait;
}

#endif
