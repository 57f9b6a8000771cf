/* The C side of pvid.core.native: replays a run through the shipped core and records every tick.
 *
 * Host only. The core is compiled from the same sources with the same flags as on a device; this
 * file adds loops that Python would be slow at.
 */
#include "replay.h"

#include <string.h>

#include "record_tick.h"

const char *pvid_native_build(void)
{
    return PVID_NATIVE_BUILD;
}

/* What is recorded of a tick of the strong form. */
static void record_strong(const pvid_record_f32 *record, uint32_t tick, const pvid_strong_f32 *self, pvid_reason reason)
{
    const pvid_strong_estimator_f32 *estimator = &self->estimator;
    if (record->p != NULL) {
        memcpy(&record->p[(size_t)tick * PVID_KAPITZA_P], estimator->p, sizeof estimator->p);
    }
    if (record->sums != NULL) {
        pvid_strong_read_sums_f32(self, &record->sums[(size_t)tick * PVID_STRONG_SUMS]);
    }
    if (record->reason != NULL) {
        record->reason[tick] = (uint8_t)reason;
    }
    if (record->hash != NULL) {
        *record->running_hash = pvid_fnv_strong_f32(*record->running_hash, estimator, reason);
        record->hash[tick] = *record->running_hash;
    }
    if ((record->estimate != NULL) && ((tick % record->estimate_every) == 0u)) {
        pvid_strong_assess_f32(self, &record->estimate[tick / record->estimate_every]);
    }
}

void pvid_replay_strong_f32(pvid_strong_f32 *self, uint32_t ticks, const float phi[], const float y[],
                            const pvid_record_f32 *record)
{
    for (uint32_t tick = 0; tick < ticks; tick++) {
        record_strong(record, tick, self, pvid_strong_step_f32(self, phi[tick], y[tick]));
    }
}

void pvid_replay_derivatives_f32(pvid_strong_f32 *self, uint32_t ticks, const float phi[], const float u[],
                                 const pvid_record_f32 *record)
{
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const float *d_phi = &phi[(size_t)tick * PVID_ORDERS];
        record_strong(record, tick, self, pvid_strong_row_step_f32(self, d_phi, &u[(size_t)tick * 3u]));
    }
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

void pvid_replay_strong_rows_f32(uint32_t ticks, const float phi[], const float u[], float n[], float y[])
{
    for (uint32_t tick = 0; tick < ticks; tick++) {
        pvid_kapitza_strong_row_f32(&phi[(size_t)tick * PVID_ORDERS], &u[(size_t)tick * 3u], &y[tick],
                                    &n[(size_t)tick * PVID_KAPITZA_STRONG_THETA]);
    }
}
