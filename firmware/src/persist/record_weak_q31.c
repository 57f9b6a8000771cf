#include "pvid/record_weak_q31.h"

#include "number/integer_q31.h"
#include "persist/record.h"

#define ONE_Q15 32768
#define MANTISSA 24u               /* bits of a binary32, with the leading one */
#define BIAS 150                   /* of the exponent of its integer mantissa */
#define NOT_FINITE 0xFFu           /* exponent of infinity and NaN */
#define BEYOND INT64_C(2147483648) /* 2^31 */

/* The bits of the binary32 nearest to x 2^-bits, |bits| <= 64. */
static uint32_t word_of(int32_t x, int32_t bits)
{
    const uint64_t size = pvid_magnitude_q31(x);
    if (size == 0u) {
        return 0u;
    }
    const int32_t shift = (int32_t)MANTISSA - (int32_t)pvid_bit_length_q31(size);
    const int64_t mantissa = pvid_scale_q31((int64_t)size, -shift); /* 2^23..2^24: the carry of 2^24 is right */
    const int32_t exponent = (BIAS - shift) - bits;
    const uint32_t before = (uint32_t)exponent - 1u;
    const uint32_t word = (before << (MANTISSA - 1u)) + (uint32_t)mantissa;
    return (x < 0) ? (word | 0x80000000u) : word;
}

/* A binary32 times 2^bits, nearest; beyond +-2^31 and not finite: +-2^31. */
static int64_t fixed_of(uint32_t word, int32_t bits)
{
    const uint32_t exponent = (word >> (MANTISSA - 1u)) & 0xFFu;
    const uint32_t mantissa = (word & 0x7FFFFFu) | 0x800000u;
    const int32_t shift = ((int32_t)exponent - BIAS) + bits;
    int64_t size = 0;
    if ((exponent == NOT_FINITE) || (shift > 8)) {
        size = BEYOND;
    } else if ((exponent > 0u) && (shift > -32)) {
        size = pvid_clamp_q31(pvid_scale_q31((int64_t)mantissa, -shift), BEYOND);
    } else {
        /* 0, or less than half a unit */
    }
    return ((word & 0x80000000u) != 0u) ? -size : size;
}

pvid_record_status pvid_record_save_weak_q31(const pvid_weak_q31 *self, pvid_record_writer *writer, uint32_t mechanism,
                                             uint8_t record[], size_t room)
{
    if ((self == NULL) || (self->design == NULL) || (writer == NULL) || (record == NULL)) {
        return PVID_RECORD_NOT_READY;
    }
    pvid_estimate_q31 estimate;
    uint32_t number = 0;
    if (!pvid_weak_read_q31(self, &estimate, &number)) {
        return PVID_RECORD_MORE; /* steps published meanwhile */
    }
    const uint8_t n_p = self->estimator.settings.n_p;
    const bool valid = estimate.standing.state == (uint8_t)PVID_STANDING_VALID;
    const pvid_record_status status = pvid_record_next(writer, n_p, number, valid, room);
    if (status != PVID_RECORD_MORE) {
        return status;
    }
    const size_t a = writer->next;
    pvid_record_row row;
    row.value = word_of(estimate.p[a], self->estimator.settings.p_bits[a]);
    row.error = word_of((estimate.se[a] > 0) ? estimate.se[a] : 1, self->estimator.settings.p_bits[a]);
    for (size_t b = a + 1u; b < n_p; b++) {
        row.correlation[b] =
            (int16_t)pvid_clamp_q31(pvid_scale_q31(estimate.correlation[a][b], 15), (int64_t)ONE_Q15 - 1);
    }
    return pvid_record_put(writer, n_p, mechanism, &row, record);
}

/* The record's values to a configuration. Returns whether values and errors are plausible there. */
static bool take_start(uint8_t n_p, pvid_estimator_config_q31 *config, const uint8_t record[])
{
    bool plausible = true;
    for (uint8_t a = 0; a < n_p; a++) {
        pvid_record_row row;
        pvid_record_get(record, n_p, a, &row);
        const int64_t value = fixed_of(row.value, config->p_bits[a]);
        const int64_t error = fixed_of(row.error, config->p_bits[a]);
        plausible = plausible && (value >= config->lower[a]) && (value <= config->upper[a]) && (row.error > 0u) &&
                    (error >= 0) && (error < BEYOND);
        config->start[a] = (int32_t)pvid_clamp_q31(value, INT32_MAX);
    }
    return plausible;
}

/* Its errors to the estimate that is read until the first of this life. */
static void take_errors(pvid_weak_q31 *self, uint8_t n_p, const uint8_t record[])
{
    pvid_estimate_q31 *estimate = &self->trust.estimate;
    pvid_record_row row;
    for (uint8_t a = 0; a < n_p; a++) {
        pvid_record_get(record, n_p, a, &row);
        const int64_t error = fixed_of(row.error, self->estimator.settings.p_bits[a]);
        estimate->se[a] = (int32_t)((error > 0) ? pvid_clamp_q31(error, INT32_MAX) : 1);
        for (uint8_t b = 0; b < a; b++) {
            estimate->correlation[a][b] = (int32_t)row.correlation[b] * ONE_Q15;
            estimate->correlation[b][a] = estimate->correlation[a][b];
        }
    }
    self->trust.copy = *estimate;
}

pvid_record_status pvid_record_load_weak_q31(pvid_weak_q31 *self, const pvid_weak_config_q31 *config,
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
    pvid_weak_config_q31 changed = *config;
    if (!take_start(n_p, &changed.estimator, record)) {
        return PVID_RECORD_IMPLAUSIBLE;
    }
    if (pvid_weak_init_q31(self, &changed) != PVID_OK) {
        return PVID_RECORD_NOT_READY; /* not the configuration of its init */
    }
    take_errors(self, n_p, record);
    return PVID_RECORD_DONE;
}
