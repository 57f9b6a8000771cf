/* What the estimators of both cores count of a solve. Private to the core, inlined. */
#ifndef PVID_COMMIT_H
#define PVID_COMMIT_H

#include <stdbool.h>
#include <stdint.h>

#include "number/count.h"
#include "pvid/status.h"

/* Counts a group of rows. Returns whether a solve is due: every `divider` groups. */
static inline bool pvid_solve_is_due(uint16_t *phase, uint16_t divider)
{
    (*phase)++;
    if (*phase < divider) {
        return false;
    }
    *phase = 0;
    return true;
}

/* Counts a solve that holds p, PVID_HELD_SINGULAR or PVID_HELD_NOT_EXCITED, and returns the reason. */
static inline pvid_reason pvid_count_held(pvid_counters *counters, pvid_reason reason)
{
    pvid_count_up((reason == PVID_HELD_SINGULAR) ? &counters->held_singular : &counters->held_not_excited);
    return reason;
}

/* Counts what became of a step. */
static inline void pvid_count_step(pvid_counters *counters, bool limited, bool bounded)
{
    if (limited) {
        pvid_count_up(&counters->limited);
    }
    if (bounded) {
        pvid_count_up(&counters->bounded);
    }
}

#endif
