#include "number/uncontracted.h"

#include "pvid/record_weak.h"

#include "number/finite_f32.h"
#include "persist/record.h"
#include "solve/constraints_f32.h"

#define ONE_Q15 32768.0f
#define MOST_Q15 32767.0f

/* A product of two is finite, and so is that of their inverses. */
#define LARGEST_ERROR 1.0e18f

/* Of the errors of parameters a and b, nearest, Q15. */
static int16_t correlation_of(const pvid_estimate_f32 *estimate, size_t a, size_t b)
{
    const float x = (estimate->covariance[a][b] / (estimate->se[a] * estimate->se[b])) * ONE_Q15;
    const float clamped = (x <= -MOST_Q15) ? -MOST_Q15 : ((x <= MOST_Q15) ? x : MOST_Q15);
    return (int16_t)(clamped + ((clamped < 0.0f) ? -0.5f : 0.5f));
}

pvid_record_status pvid_record_save_weak_f32(const pvid_weak_f32 *self, pvid_record_writer *writer, uint32_t mechanism,
                                             uint8_t record[], size_t room)
{
    if ((self == NULL) || (self->design == NULL) || (writer == NULL) || (record == NULL)) {
        return PVID_RECORD_NOT_READY;
    }
    pvid_estimate_f32 estimate;
    uint32_t number = 0;
    if (!pvid_weak_read_f32(self, &estimate, &number)) {
        return PVID_RECORD_MORE; /* steps published meanwhile */
    }
    const uint8_t n_p = self->design->model->model->n_p;
    const bool valid = estimate.standing.state == (uint8_t)PVID_STANDING_VALID;
    const pvid_record_status status = pvid_record_next(writer, n_p, number, valid, room);
    if (status != PVID_RECORD_MORE) {
        return status;
    }
    const size_t a = writer->next;
    pvid_record_row row;
    row.value = pvid_bits_f32(estimate.p[a]);
    row.error = pvid_bits_f32(estimate.se[a]);
    for (size_t b = a + 1u; b < n_p; b++) {
        row.correlation[b] = correlation_of(&estimate, a, b);
    }
    return pvid_record_put(writer, n_p, mechanism, &row, record);
}

/* The record's values to a configuration. Returns whether values and errors are plausible there. */
static bool take_start(const pvid_weak_f32 *self, pvid_estimator_config_f32 *config, const uint8_t record[])
{
    const pvid_model_f32 *model = self->design->model->model;
    bool plausible = true;
    for (uint8_t a = 0; a < model->n_p; a++) {
        pvid_record_row row;
        pvid_record_get(record, model->n_p, a, &row);
        config->start[a] = pvid_from_bits_f32(row.value);
        plausible = plausible && pvid_within_f32(config->start[a], config->lower[a], config->upper[a]) &&
                    pvid_within_f32(pvid_from_bits_f32(row.error), 1.0f / LARGEST_ERROR, LARGEST_ERROR);
    }
#if PVID_MAX_CONSTRAINTS > 0
    plausible = plausible &&
                ((model->n_constraints == 0u) ||
                 pvid_constraints_return_f32(model, &self->estimator.settings, config->start, PVID_RETURNS_AT_INIT));
#endif
    return plausible;
}

/* Its errors to the estimate that is read until the first of this life. */
static void take_errors(pvid_trust_f32 *trust, uint8_t n_p, const uint8_t record[])
{
    pvid_estimate_f32 *estimate = &trust->estimate;
    pvid_record_row row;
    for (uint8_t a = 0; a < n_p; a++) {
        pvid_record_get(record, n_p, a, &row);
        estimate->se[a] = pvid_from_bits_f32(row.error);
        estimate->covariance[a][a] = estimate->se[a] * estimate->se[a];
        for (uint8_t b = 0; b < a; b++) {
            const float correlation = (float)row.correlation[b] / ONE_Q15;
            estimate->covariance[a][b] = (correlation * estimate->se[a]) * estimate->se[b];
            estimate->covariance[b][a] = estimate->covariance[a][b];
        }
    }
    trust->copy = *estimate;
}

pvid_record_status pvid_record_load_weak_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                             uint32_t mechanism, const uint8_t record[], size_t length)
{
    if ((self == NULL) || (config == NULL) || (record == NULL) || (self->design == NULL) ||
        (self->design != config->design)) {
        return PVID_RECORD_NOT_READY;
    }
    const uint8_t n_p = config->design->model->model->n_p;
    const pvid_record_status status = pvid_record_inspect(record, length, n_p, mechanism);
    if (status != PVID_RECORD_DONE) {
        return status;
    }
    pvid_weak_config_f32 changed = *config;
    changed.refine = self->refine;
    if (!take_start(self, &changed.estimator, record)) {
        return PVID_RECORD_IMPLAUSIBLE;
    }
    if (pvid_weak_init_f32(self, &changed) != PVID_OK) {
        return PVID_RECORD_NOT_READY; /* not the configuration of its init */
    }
    take_errors(&self->trust, n_p, record);
    return PVID_RECORD_DONE;
}
