/* Counting and reporting of verdicts, for both cores. Private to the core. */
#ifndef PVID_PRIVATE_VERDICT_H
#define PVID_PRIVATE_VERDICT_H

#include <stdbool.h>

#include "number/count.h"
#include "pvid/status.h"

/* Counts consecutive uninformative groups; 0 after a step, or after p reverted to the published estimate. */
static inline void pvid_trust_count_uninformative(uint16_t *uninformative, pvid_reason reason, bool is_back)
{
    if ((reason == PVID_UPDATED) || is_back) {
        *uninformative = 0;
    } else {
        pvid_count_up_16(uninformative);
    }
}

/* Counts a verdict and returns the reason to report; `reason` is that of the solve. */
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
