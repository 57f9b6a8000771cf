/* Counting and reporting of verdicts, for both cores. Private to the core. */
#ifndef PVID_PRIVATE_VERDICT_H
#define PVID_PRIVATE_VERDICT_H

#include <stdbool.h>

#include "number/count.h"
#include "pvid/status.h"

/* Counts consecutive uninformative groups: groups without a step. 0 after a step, or after p reverted to the published
 * estimate (is_back). */
static inline void pvid_trust_count_uninformative(uint16_t *uninformative, pvid_reason reason, bool is_back)
{
    if ((reason == PVID_UPDATED) || is_back) {
        *uninformative = 0;
    } else {
        pvid_count_up_16(uninformative);
    }
}

/* Counts the verdict of trust on a group and returns the reason that the tick reports. `reason` is that of the solve;
 * the solve has counted it if it is not PVID_UPDATED. */
static inline pvid_reason pvid_trust_report(pvid_counters *counters, pvid_reason verdict, pvid_reason reason,
                                            bool misfit)
{
    pvid_reason reported = verdict;
    if ((verdict == PVID_UPDATED) && misfit) {
        pvid_count_up(&counters->misfits);
        reported = PVID_MISFIT;
    } else if (verdict == PVID_HELD_UNCERTAIN) {
        pvid_count_up(&counters->held_uncertain);
    } else if ((verdict == PVID_HELD_NOT_EXCITED) && (reason == PVID_UPDATED)) {
        pvid_count_up(&counters->held_not_excited);
    }
    return reported;
}

#endif
