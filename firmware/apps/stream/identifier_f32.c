#include <string.h>

#include "identifier.h"
#include "pvid/little_endian.h"
#include "pvid/pvid.h"
#include "stream_tables.h"

static STREAM_TYPE identifier;

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
    STREAM_CONFIG config = stream_config;
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
    return STREAM_INIT(&identifier, &config);
}

void identifier_sample(const int32_t counts[STREAM_SAMPLES], uint8_t sample[SAMPLE_BYTES])
{
    pvid_put_f32(sample, (float)counts[0] * STREAM_PHI_LSB);
    pvid_put_f32(&sample[4], (float)counts[1] * STREAM_Y_LSB);
}

pvid_reason identifier_step(const uint8_t sample[SAMPLE_BYTES])
{
    return STREAM_STEP(&identifier, pvid_get_f32(sample), pvid_get_f32(&sample[4]));
}

uint32_t identifier_hash(uint32_t hash, pvid_reason reason)
{
    return pvid_fnv_estimator_f32(hash, &identifier.estimator, reason);
}

void identifier_estimate(uint8_t payload[PVID_ESTIMATE_BYTES], uint32_t session, pvid_reason reason)
{
    pvid_estimate_f32 estimate;
    memset(payload, 0, PVID_ESTIMATE_BYTES);
    pvid_estimator_assess_f32(&identifier.estimator, &estimate);
    pvid_put_u32(&payload[PVID_ESTIMATE_SESSION], session);
    pvid_put_u32(&payload[PVID_ESTIMATE_UPDATES], identifier.estimator.counters.updates);
    size_t at = PVID_ESTIMATE_COVARIANCE;
    for (size_t i = 0; i < LINK_MAX_P; i++) {
        for (size_t j = i; j < LINK_MAX_P; j++) {
            if (j < STREAM_N_P) {
                pvid_put_f32(&payload[at], estimate.covariance[i][j]);
            }
            at += 4u;
        }
        if (i < STREAM_N_P) {
            pvid_put_f32(&payload[PVID_ESTIMATE_P + (4u * i)], estimate.p[i]);
        }
    }
    pvid_put_f32(&payload[PVID_ESTIMATE_KAPPA], estimate.kappa);
    pvid_put_f32(&payload[PVID_ESTIMATE_RESIDUAL_SD], estimate.residual_sd);
    pvid_put_f32(&payload[PVID_ESTIMATE_WEIGHT], estimate.weight);
    payload[PVID_ESTIMATE_REASON] = (uint8_t)reason;
}

const pvid_counters *identifier_counters(void)
{
    return &identifier.estimator.counters;
}
