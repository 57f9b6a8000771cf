/* A weak-form identifier of the base size, for counting the instructions of its ticks.
 *
 * 71 taps, D = 8, W = 157, K = 12, zero unknown, three Gauss-Newton steps. The tables are noise: what a
 * tick does depends on their size alone. */
#ifndef WEAK_RIG_H
#define WEAK_RIG_H

#include <stdint.h>

/* Ticks from one window to the next: the length over which a mean makes sense. */
#define WEAK_RIG_PERIOD 624u

/* Fills the tables with what `noise` returns, in -1..1, and steps until every part of a tick is at work. */
void weak_rig_prepare(float (*noise)(void));

void weak_rig_tick(float phi, float y);

#endif
