/* The C side of pvid.core.native: replays a run through the shipped fixed-point core and records every tick. */
#include "replay_q31.h"

#include <stdbool.h>
#include <string.h>

#include "record_tick_q31.h"

/* The same of the strong form. */
static void record_strong_tick(const pvid_record_q31 *record, uint32_t tick,
                               const pvid_kapitza_estimator_q31 *estimator, pvid_reason reason)
{
    if (record->p != NULL) {
        memcpy(&record->p[tick * PVID_KAPITZA_P], estimator->p, sizeof estimator->p);
    }
    if (record->sums != NULL) {
        memcpy(&record->sums[tick * PVID_KAPITZA_SUMS_Q31], estimator->sums, sizeof estimator->sums);
    }
    if (record->exponent != NULL) {
        record->exponent[tick] = estimator->exponent;
    }
    if (record->reason != NULL) {
        record->reason[tick] = (uint8_t)reason;
    }
    if (record->hash != NULL) {
        *record->running_hash = pvid_fnv_strong_q31(*record->running_hash, estimator, reason);
        record->hash[tick] = *record->running_hash;
    }
}

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

static void record_strong_assessment(const pvid_record_q31 *record, uint32_t tick,
                                     const pvid_kapitza_estimator_q31 *estimator)
{
    if (is_estimate_due(record, tick)) {
        pvid_kapitza_estimator_assess_q31(estimator, &record->estimate[tick / record->estimate_every]);
    }
}

void pvid_replay_strong_q31(pvid_strong_q31 *self, uint32_t ticks, const int32_t phi[], const int32_t y[],
                            const pvid_record_q31 *record)
{
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const pvid_reason reason = pvid_strong_step_q31(self, phi[tick], y[tick]);
        record_strong_tick(record, tick, &self->estimator, reason);
        record_strong_assessment(record, tick, &self->estimator);
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

void pvid_replay_strong_rows_q31(const pvid_strong_row_q31 *format, uint32_t ticks, const int32_t phi[],
                                 const int32_t u[], int32_t rows[], uint8_t fits[])
{
    for (size_t tick = 0; tick < ticks; tick++) {
        fits[tick] = pvid_kapitza_strong_row_q31(format, &phi[tick * PVID_ORDERS], &u[tick * PVID_Y_ORDERS_Q31],
                                                 &rows[tick * PVID_KAPITZA_ROW_Q31])
                         ? 1u
                         : 0u;
    }
}

static pvid_reason take(pvid_kapitza_estimator_q31 *self, const int32_t row[])
{
    int32_t gradient[PVID_KAPITZA_P];
    int32_t e;
    if (!pvid_kapitza_estimator_innovate_q31(self, row, &e, gradient)) {
        self->counters.rejected_saturated++;
        return PVID_REJECTED_SATURATED;
    }
    return pvid_kapitza_estimator_take_q31(self, row, e, gradient);
}

void pvid_replay_kapitza_rows_q31(pvid_kapitza_estimator_q31 *self, uint32_t ticks, const int32_t rows[],
                                  const pvid_record_q31 *record)
{
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const pvid_reason reason = take(self, &rows[tick * PVID_KAPITZA_ROW_Q31]);
        record_strong_tick(record, tick, self, reason);
        record_strong_assessment(record, tick, self);
    }
}
