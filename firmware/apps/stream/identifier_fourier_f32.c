#include <string.h>

#include "identifier.h"
#include "pvid/fnv.h"
#include "pvid/fourier.h"
#include "pvid/little_endian.h"
#include "pvid/pvid.h"
#include "stream_tables.h"

static pvid_fourier_f32 identifier;

static void get_floats(float to[], const uint8_t from[])
{
    for (size_t i = 0; i < STREAM_N_P; i++) {
        to[i] = pvid_get_f32(&from[4u * i]);
    }
}

uint32_t identifier_arithmetic_faults(void)
{
    return pvid_arithmetic_faults_f32();
}

pvid_status identifier_start(const uint8_t payload[PVID_CONFIGURE_BYTES])
{
    pvid_fourier_config_f32 config = STREAM_CONFIG;
    pvid_estimator_config_f32 *estimator = &config.estimator;
    get_floats(estimator->start, &payload[PVID_CONFIGURE_START]);
    get_floats(estimator->start_sd, &payload[PVID_CONFIGURE_START_SD]);
    get_floats(estimator->lower, &payload[PVID_CONFIGURE_LOWER]);
    get_floats(estimator->upper, &payload[PVID_CONFIGURE_UPPER]);
    estimator->row_sd = pvid_get_f32(&payload[PVID_CONFIGURE_ROW_SD]);
    estimator->forgetting_s = pvid_get_f32(&payload[PVID_CONFIGURE_FORGETTING_S]);
    estimator->feedback_hz = pvid_get_f32(&payload[PVID_CONFIGURE_FEEDBACK_HZ]);
    estimator->law = (pvid_law)payload[PVID_CONFIGURE_LAW]; /* any value: init checks it */
    estimator->divider = pvid_get_u16(&payload[PVID_CONFIGURE_DIVIDER]);
    return pvid_fourier_init_f32(&identifier, &config);
}

pvid_reason identifier_step(const uint8_t sample[SAMPLE_BYTES])
{
    float values[STREAM_SAMPLES];
    for (size_t i = 0; i < STREAM_SAMPLES; i++) {
        values[i] = pvid_get_f32(&sample[4u * i]);
    }
    return pvid_fourier_step_f32(&identifier, values);
}

uint32_t identifier_hash(uint32_t hash, pvid_reason reason)
{
    return pvid_fnv_estimator_f32(hash, &identifier.estimator, reason);
}

/* The published estimate. */
void identifier_estimate(uint8_t payload[PVID_ESTIMATE_BYTES], uint32_t session, pvid_reason reason)
{
    const pvid_estimate_f32 *estimate = pvid_fourier_estimate_f32(&identifier);
    memset(payload, 0, PVID_ESTIMATE_BYTES);
    pvid_put_u32(&payload[PVID_ESTIMATE_SESSION], session);
    pvid_put_u32(&payload[PVID_ESTIMATE_UPDATES], identifier.estimator.counters.updates);
    size_t at = PVID_ESTIMATE_COVARIANCE;
    for (size_t i = 0; i < LINK_MAX_P; i++) {
        for (size_t j = i; j < LINK_MAX_P; j++) {
            if (j < STREAM_N_P) {
                pvid_put_f32(&payload[at], estimate->covariance[i][j]);
            }
            at += 4u;
        }
        if (i < STREAM_N_P) {
            pvid_put_f32(&payload[PVID_ESTIMATE_P + (4u * i)], estimate->p[i]);
        }
    }
    pvid_put_f32(&payload[PVID_ESTIMATE_KAPPA], estimate->kappa);
    pvid_put_f32(&payload[PVID_ESTIMATE_RESIDUAL_SD], estimate->residual_sd);
    pvid_put_f32(&payload[PVID_ESTIMATE_WEIGHT], estimate->weight);
    payload[PVID_ESTIMATE_REASON] = (uint8_t)reason;
}

const pvid_counters *identifier_counters(void)
{
    return &identifier.estimator.counters;
}
