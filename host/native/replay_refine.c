/* Declared in replay_refine.h. Host only. */
#include "replay_refine.h"

#include <stddef.h>
#include <string.h>

#include "pvid/fnv.h"
#include "pvid/fnv_refine.h"

static void put_latest(const pvid_refine_f32 *refinement, uint32_t tick, float r[], float se[])
{
    const pvid_refine_estimate_f32 *latest = pvid_refine_latest_f32(refinement);
    if ((r != NULL) && (latest != NULL)) {
        memcpy(&r[(size_t)tick * PVID_REFINE_PARAMETERS], latest->r, sizeof latest->r);
        memcpy(&se[(size_t)tick * PVID_REFINE_PARAMETERS], latest->se, sizeof latest->se);
    }
}

void pvid_replay_refine_f32(pvid_refine_f32 *self, uint32_t ticks, uint32_t n_samples, const float samples[],
                            const float weak_p[], const float weak_se[], uint32_t *running_hash, uint8_t reason[],
                            uint32_t hash[], float r[], float se[])
{
    for (uint32_t tick = 0; tick < ticks; tick++) {
        pvid_estimate_f32 weak;
        const float *p = &weak_p[(size_t)tick * PVID_REFINE_P];
        memset(&weak, 0, sizeof weak);
        memcpy(weak.p, p, PVID_REFINE_P * sizeof weak.p[0]);
        memcpy(weak.se, &weak_se[(size_t)tick * PVID_REFINE_P], PVID_REFINE_P * sizeof weak.se[0]);
        const bool given = (p[0] - p[0]) >= 0.0f;
        const pvid_reason one =
            pvid_refine_step_f32(self, &samples[(size_t)tick * n_samples], given ? &weak : NULL, false);
        if (reason != NULL) {
            reason[tick] = (uint8_t)one;
        }
        if (hash != NULL) {
            *running_hash = pvid_fnv_refine_f32(*running_hash, self, one);
            hash[tick] = *running_hash;
        }
        put_latest(self, tick, r, se);
    }
}

void pvid_replay_both_stages_f32(pvid_weak_f32 *self, uint32_t ticks, const float samples[], uint8_t reasons[],
                                 uint8_t told[], uint8_t busy[], float weak_p[], float weak_se[], float r[], float se[],
                                 uint32_t *running_hash, uint32_t hash[])
{
    const uint32_t n_samples = self->design->model->samples;
    const pvid_refine_f32 *refinement = self->refine->storage;
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const pvid_reason reason = pvid_weak_step_f32(self, &samples[(size_t)tick * n_samples]);
        if ((weak_p != NULL) &&
            ((reason == PVID_UPDATED) || (reason == PVID_MISFIT) || (reason == PVID_HELD_UNCERTAIN))) {
            const pvid_estimate_f32 *estimate = pvid_weak_candidate_f32(self);
            memcpy(&weak_p[(size_t)tick * PVID_REFINE_P], estimate->p, PVID_REFINE_P * sizeof weak_p[0]);
            memcpy(&weak_se[(size_t)tick * PVID_REFINE_P], estimate->se, PVID_REFINE_P * sizeof weak_se[0]);
        }
        if (reasons != NULL) {
            reasons[tick] = (uint8_t)reason;
        }
        if (told != NULL) {
            told[tick] = (uint8_t)pvid_refine_reason_f32(refinement);
            busy[tick] = (uint8_t)refinement->busy;
        }
        if (hash != NULL) {
            *running_hash = pvid_fnv_estimator_f32(*running_hash, &self->estimator, reason);
            *running_hash = pvid_fnv_refine_f32(*running_hash, refinement, pvid_refine_reason_f32(refinement));
            hash[tick] = *running_hash;
        }
        put_latest(refinement, tick, r, se);
    }
}

void pvid_replay_refine_shape(uint32_t shape[8])
{
    const uint32_t numbers[8] = {PVID_REFINE_ORDER,  PVID_REFINE_COORDINATES, PVID_REFINE_INPUTS, PVID_REFINE_OUTPUTS,
                                 PVID_REFINE_MOVING, PVID_REFINE_PARAMETERS,  PVID_REFINE_SKEW,   PVID_REFINE_P};
    memcpy(shape, numbers, sizeof numbers);
}
