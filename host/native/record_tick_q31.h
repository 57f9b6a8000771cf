/* What every replay of the fixed-point core records of a tick. Host only. */
#ifndef PVID_RECORD_TICK_Q31_H
#define PVID_RECORD_TICK_Q31_H

#include <string.h>

#include "pvid/fnv.h"
#include "replay_q31.h"

static inline void record_tick(const pvid_record_q31 *record, uint32_t tick, const pvid_estimator_q31 *estimator,
                               pvid_reason reason)
{
    const pvid_information_q31 *information = &estimator->information;
    const size_t n_p = estimator->model->n_p;
    const size_t n_sums = information->n_sums;
    if (record->p != NULL) {
        memcpy(&record->p[tick * n_p], estimator->p, n_p * sizeof estimator->p[0]);
    }
    if (record->sums != NULL) {
        memcpy(&record->sums[tick * n_sums], information->sums, n_sums * sizeof information->sums[0]);
    }
    if (record->exponent != NULL) {
        record->exponent[tick] = information->exponent;
    }
    if (record->reason != NULL) {
        record->reason[tick] = (uint8_t)reason;
    }
    if (record->hash != NULL) {
        *record->running_hash = pvid_fnv_estimator_q31(*record->running_hash, estimator, reason);
        record->hash[tick] = *record->running_hash;
    }
}

#endif
