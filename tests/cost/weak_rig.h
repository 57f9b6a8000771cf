/* A weak-form identifier, for counting the instructions of its ticks: of the standard rig's size, or of another
 * one by -D. Zero unknown or not, three Gauss-Newton steps. The tables are noise: what a tick does depends
 * on their size alone. */
#ifndef WEAK_RIG_H
#define WEAK_RIG_H

#include <stdint.h>

#ifndef WEAK_RIG_TAPS
#define WEAK_RIG_TAPS 81
#endif
#ifndef WEAK_RIG_DECIMATION
#define WEAK_RIG_DECIMATION 9
#endif
#ifndef WEAK_RIG_WINDOW
#define WEAK_RIG_WINDOW 191
#endif
#ifndef WEAK_RIG_FUNCTIONS
#define WEAK_RIG_FUNCTIONS 10
#endif
#ifndef WEAK_RIG_ZERO
#define WEAK_RIG_ZERO 1
#endif

/* Ticks from one window to the next: the length over which a mean makes sense. */
#define WEAK_RIG_PERIOD ((uint32_t)(WEAK_RIG_DECIMATION * ((WEAK_RIG_WINDOW - 1) / 2)))

/* Fills the tables with what `noise` returns, in -1..1, and steps until every part of a tick is at work. */
void weak_rig_prepare(float (*noise)(void));

void weak_rig_tick(float phi, float y);

#endif
