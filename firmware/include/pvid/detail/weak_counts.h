/* pvid/detail/weak_counts.h - sizes of arrays that a model may need little of, at least 1: those of a build for one
 * model (PVID_EXACT), or enough for any. Not API. */
#ifndef PVID_DETAIL_WEAK_COUNTS_H
#define PVID_DETAIL_WEAK_COUNTS_H

#include "pvid/config.h"

#if PVID_EXACT
#define PVID_WEAK_GAINS PVID_EXACT_GAINS
#define PVID_WEAK_VALUES (PVID_EXACT_GAINS + PVID_EXACT_INTEGRANDS)
#else
#define PVID_WEAK_GAINS PVID_MAX_CHANNELS
#define PVID_WEAK_VALUES (PVID_MAX_CHANNELS + PVID_MAX_INTEGRANDS)
#endif
#if !PVID_EXACT
#define PVID_WEAK_RUNS PVID_MAX_INTEGRANDS
#elif PVID_EXACT_RUNS > 0
#define PVID_WEAK_RUNS PVID_EXACT_RUNS
#else
#define PVID_WEAK_RUNS 1
#endif
#if !PVID_EXACT
#define PVID_WEAK_SIGNS PVID_MAX_INTEGRANDS
#elif PVID_EXACT_SIGNS > 0
#define PVID_WEAK_SIGNS PVID_EXACT_SIGNS
#else
#define PVID_WEAK_SIGNS 1
#endif

#endif
