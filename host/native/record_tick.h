/* What a replay in float32 records of a tick. Host only. */
#ifndef PVID_RECORD_TICK_H
#define PVID_RECORD_TICK_H

#include <string.h>

#include "pvid/estimator.h"
#include "pvid/fnv.h"
#include "replay.h"

static inline void record_tick(const pvid_record_f32 *record, uint32_t tick, const pvid_estimator_f32 *estimator,
                               pvid_reason reason)
{
    const uint32_t n_p = estimator->model->n_p;
    const uint32_t n_sums = estimator->information.n_moments + estimator->information.n_theta + 2u;
    if (record->p != NULL) {
        memcpy(&record->p[(size_t)tick * n_p], estimator->p, n_p * sizeof(float));
    }
    if (record->sums != NULL) {
        pvid_information_read_f32(&estimator->information, &record->sums[(size_t)tick * n_sums]);
    }
    if (record->reason != NULL) {
        record->reason[tick] = (uint8_t)reason;
    }
    if (record->hash != NULL) {
        *record->running_hash = pvid_fnv_estimator_f32(*record->running_hash, estimator, reason);
        record->hash[tick] = *record->running_hash;
    }
    if ((record->estimate != NULL) && ((tick % record->estimate_every) == 0u)) {
        pvid_estimator_assess_f32(estimator, &record->estimate[tick / record->estimate_every]);
    }
}

#endif
