/* The C side of pvid.core.native: replays a run through the shipped fixed-point core and records every tick. */
#include "replay_q31.h"

#include <stdbool.h>
#include <string.h>

#include "record_tick_q31.h"

static bool is_estimate_due(const pvid_record_q31 *record, uint32_t tick)
{
    return (record->estimate != NULL) && ((tick % record->estimate_every) == 0u);
}

static void record_assessment(const pvid_record_q31 *record, uint32_t tick, const pvid_estimator_q31 *estimator)
{
    if (is_estimate_due(record, tick)) {
        pvid_estimator_assess_q31(estimator, &record->estimate[tick / record->estimate_every]);
    }
}

void pvid_replay_weak_q31(pvid_weak_q31 *self, uint32_t ticks, const int32_t phi[], const int32_t y[],
                          const pvid_record_q31 *record)
{
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const pvid_reason reason = pvid_weak_step_q31(self, phi[tick], y[tick]);
        const pvid_estimate_q31 *estimate = pvid_weak_estimate_q31(self);
        record_tick(record, tick, &self->estimator, reason);
        if (record->published != NULL) {
            const size_t n_p = self->estimator.model->n_p;
            memcpy(&record->published[tick * n_p], estimate->p, n_p * sizeof estimate->p[0]);
            memcpy(&record->published_se[tick * n_p], estimate->se, n_p * sizeof estimate->se[0]);
        }
        if (is_estimate_due(record, tick)) {
            record->estimate[tick / record->estimate_every] = *estimate;
        }
    }
}

void pvid_replay_strong_q31(pvid_strong_q31 *self, uint32_t ticks, const int32_t phi[], const int32_t y[],
                            const pvid_record_q31 *record)
{
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const pvid_reason reason = pvid_strong_step_q31(self, phi[tick], y[tick]);
        record_tick(record, tick, &self->estimator, reason);
        record_assessment(record, tick, &self->estimator);
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

void pvid_replay_derivatives_q31(pvid_differentiator_q31 *self, uint32_t ticks, const int32_t phi[], const int32_t y[],
                                 int32_t d_phi[], int32_t d_y[], uint8_t ready[])
{
    for (size_t tick = 0; tick < ticks; tick++) {
        ready[tick] = pvid_differentiator_step_q31(self, phi[tick], y[tick], &d_phi[tick * PVID_ORDERS],
                                                   &d_y[tick * PVID_Y_ORDERS_Q31])
                          ? 1u
                          : 0u;
    }
}

void pvid_replay_strong_rows_q31(const pvid_strong_row_q31 *shifts, uint32_t ticks, const int32_t phi[],
                                 const int32_t u[], int32_t n[], int32_t y[], uint8_t fits[])
{
    for (size_t tick = 0; tick < ticks; tick++) {
        fits[tick] = pvid_kapitza_strong_row_q31(shifts, &phi[tick * PVID_ORDERS], &u[tick * PVID_Y_ORDERS_Q31],
                                                 &y[tick], &n[tick * PVID_KAPITZA_STRONG_THETA])
                         ? 1u
                         : 0u;
    }
}
