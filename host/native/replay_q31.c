/* The C side of pvid.core.native: replays a run through the shipped fixed-point core and records every tick. */
#include "replay_q31.h"

#include <stdbool.h>
#include <string.h>

#include "record_tick_q31.h"

static void record_assessment(const pvid_record_q31 *record, uint32_t tick, const pvid_estimator_q31 *estimator)
{
    if ((record->estimate != NULL) && ((tick % record->estimate_every) == 0u)) {
        pvid_estimator_assess_q31(estimator, &record->estimate[tick / record->estimate_every]);
    }
}

void pvid_replay_rows_q31(pvid_estimator_q31 *self, uint32_t ticks, const int32_t n[], const int32_t y[],
                          const pvid_record_q31 *record)
{
    const size_t n_theta = self->model->n_theta;
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const pvid_reason added = pvid_estimator_add_q31(self, &n[tick * n_theta], y[tick]);
        const pvid_reason reason = (added == PVID_ACCUMULATED) ? pvid_estimator_update_q31(self) : added;
        record_tick(record, tick, self, reason);
        record_assessment(record, tick, self);
    }
}
