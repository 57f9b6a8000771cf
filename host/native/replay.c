/* The C side of pvid.core.native: replays a run through the shipped core and records every tick.
 *
 * Host only. The core is compiled from the same sources with the same flags as on a device; this
 * file adds loops that Python would be slow at.
 */
#include "replay.h"

#include "record_tick.h"

const char *pvid_native_build(void)
{
    return PVID_NATIVE_BUILD;
}

void pvid_replay_rows_f32(pvid_estimator_f32 *self, uint32_t ticks, const float n[], const float y[],
                          const pvid_record_f32 *record)
{
    const uint32_t n_theta = self->model->n_theta;
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const pvid_reason reason = pvid_estimator_step_f32(self, &n[(size_t)tick * n_theta], y[tick]);
        record_tick(record, tick, self, reason);
    }
}
