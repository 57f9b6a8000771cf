/* The reason of several ticks together. Private to the core. */
#ifndef PVID_OUTCOME_H
#define PVID_OUTCOME_H

#include <stdint.h>

#include "pvid/status.h"

/* 2: there is a new estimate; 0: nothing to report. */
static inline uint32_t pvid_outcome_rank(pvid_reason reason)
{
    if ((reason == PVID_UPDATED) || (reason == PVID_MISFIT)) {
        return 2;
    }
    return ((reason == PVID_ACCUMULATED) || (reason == PVID_WARMING_UP)) ? 0u : 1u;
}

/* Of the ticks so far and the next one: the last that published an estimate, else the last with something to report. */
static inline pvid_reason pvid_outcome(pvid_reason before, pvid_reason next)
{
    return ((next == before) || (pvid_outcome_rank(next) < pvid_outcome_rank(before))) ? before : next;
}

#endif
