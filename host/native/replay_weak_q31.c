/* Declared in replay_weak_q31.h. Host only. */
#include "replay_weak_q31.h"

#include <stddef.h>
#include <string.h>

#include "record_tick_q31.h"

void pvid_replay_weak_q31(pvid_weak_q31 *self, uint32_t ticks, const int32_t readings[], const pvid_record_q31 *record)
{
    const uint32_t samples = self->design->model->samples;
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const pvid_reason reason = pvid_weak_step_q31(self, &readings[(size_t)tick * samples]);
        record_tick(record, tick, &self->estimator, reason);
        if (record->published != NULL) {
            const uint32_t n_p = self->estimator.model->n_p;
            const pvid_estimate_q31 *estimate = pvid_weak_estimate_q31(self);
            memcpy(&record->published[(size_t)tick * n_p], estimate->p, n_p * sizeof estimate->p[0]);
            memcpy(&record->published_se[(size_t)tick * n_p], estimate->se, n_p * sizeof estimate->se[0]);
            record->standing[tick] = pvid_standing_word(estimate->standing);
        }
    }
}
