/* Declared in replay_weak.h. Host only. */
#include "replay_weak.h"

#include <stddef.h>
#include <string.h>

#include "record_tick.h"

void pvid_replay_weak_f32(pvid_weak_f32 *self, uint32_t ticks, const float samples[], const pvid_record_f32 *record)
{
    const uint32_t n_samples = self->design->model->samples;
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const pvid_reason reason = pvid_weak_step_f32(self, &samples[(size_t)tick * n_samples]);
        record_tick(record, tick, &self->estimator, reason);
        if (record->published != NULL) {
            const uint32_t n_p = self->estimator.model->n_p;
            const pvid_estimate_f32 *estimate = pvid_weak_estimate_f32(self);
            memcpy(&record->published[(size_t)tick * n_p], estimate->p, n_p * sizeof(float));
            memcpy(&record->published_se[(size_t)tick * n_p], estimate->se, n_p * sizeof(float));
            record->standing[tick] = pvid_standing_word(estimate->standing);
        }
    }
}

void pvid_replay_function_f32(void (*function)(const float in[], float out[]), uint32_t n, uint32_t inputs,
                              uint32_t outputs, const float in[], float out[])
{
    for (uint32_t k = 0; k < n; k++) {
        function(&in[(size_t)k * inputs], &out[(size_t)k * outputs]);
    }
}
