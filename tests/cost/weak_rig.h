/* The weak form of the pendulum's shipped rig, for counting the instructions of its ticks. */
#ifndef WEAK_RIG_H
#define WEAK_RIG_H

/* Steps until every part of a tick is at work, with what `noise` returns, in -1..1. */
void weak_rig_prepare(float (*noise)(void));

void weak_rig_tick(float phi, float y);

#endif
