/* Gauss-Newton steps of a window, the same in float32 and in fixed point. Private to the core. */
#ifndef PVID_WEAK_STEPS_H
#define PVID_WEAK_STEPS_H

#include <stdint.h>

/* Windows that have `iterations` steps each. By then p has come near from a start that is 50 % off; later windows have
 * one step, and the next window goes on from there. */
#define PVID_WEAK_EARLY_WINDOWS 8u

/* judged: windows before this one. */
static inline uint8_t pvid_weak_steps(uint8_t iterations, uint16_t judged)
{
    return (judged < PVID_WEAK_EARLY_WINDOWS) ? iterations : 1u;
}

#endif
