#include <string.h>

#include "identifier.h"
#include "pvid/little_endian.h"
#include "pvid/pvid_q31.h"
#include "stream_tables.h"

static STREAM_TYPE identifier;

static void get_integers(int32_t to[], const uint8_t from[])
{
    for (size_t i = 0; i < STREAM_N_P; i++) {
        to[i] = pvid_get_i32(&from[4u * i]);
    }
}

/* Integers have one arithmetic. */
uint32_t identifier_arithmetic_faults(void)
{
    return 0;
}

pvid_status identifier_start(const uint8_t payload[PVID_CONFIGURE_Q31_BYTES])
{
    STREAM_CONFIG config = stream_config;
    pvid_estimator_config_q31 *estimator = &config.estimator;
    get_integers(estimator->start, &payload[PVID_CONFIGURE_Q31_START]);
    get_integers(estimator->start_sd, &payload[PVID_CONFIGURE_Q31_START_SD]);
    get_integers(estimator->lower, &payload[PVID_CONFIGURE_Q31_LOWER]);
    get_integers(estimator->upper, &payload[PVID_CONFIGURE_Q31_UPPER]);
    estimator->row_sd = pvid_get_i32(&payload[PVID_CONFIGURE_Q31_ROW_SD]);
    estimator->forgetting_groups = pvid_get_u32(&payload[PVID_CONFIGURE_Q31_FORGETTING_GROUPS]);
    estimator->gain = pvid_get_i32(&payload[PVID_CONFIGURE_Q31_GAIN]);
    estimator->divider = pvid_get_u16(&payload[PVID_CONFIGURE_Q31_DIVIDER]);
    config.phi_offset = pvid_get_i32(&payload[PVID_CONFIGURE_Q31_PHI_OFFSET]);
    config.y_offset = pvid_get_i32(&payload[PVID_CONFIGURE_Q31_Y_OFFSET]);
    return STREAM_INIT(&identifier, &config);
}

void identifier_sample(const int32_t counts[STREAM_SAMPLES], uint8_t sample[SAMPLE_BYTES])
{
    pvid_put_i32(sample, counts[0]);
    pvid_put_i32(&sample[4], counts[1]);
}

pvid_reason identifier_step(const uint8_t sample[SAMPLE_BYTES])
{
    return STREAM_STEP(&identifier, pvid_get_i32(sample), pvid_get_i32(&sample[4]));
}

uint32_t identifier_hash(uint32_t hash, pvid_reason reason)
{
    return STREAM_HASH(hash, &identifier.estimator, reason);
}

void identifier_estimate(uint8_t payload[PVID_ESTIMATE_Q31_BYTES], uint32_t session, pvid_reason reason)
{
    pvid_estimate_q31 estimate;
    memset(payload, 0, PVID_ESTIMATE_Q31_BYTES);
    STREAM_ASSESS(&STREAM_ASSESSED, &estimate);
    pvid_put_u32(&payload[PVID_ESTIMATE_Q31_SESSION], session);
    pvid_put_u32(&payload[PVID_ESTIMATE_Q31_UPDATES], identifier.estimator.counters.updates);
    size_t at = PVID_ESTIMATE_Q31_CORRELATION;
    for (size_t i = 0; i < LINK_MAX_P; i++) {
        for (size_t j = i; j < LINK_MAX_P; j++) {
            if (j < STREAM_N_P) {
                pvid_put_i32(&payload[at], estimate.correlation[i][j]);
            }
            at += 4u;
        }
        if (i < STREAM_N_P) {
            pvid_put_i32(&payload[PVID_ESTIMATE_Q31_P + (4u * i)], estimate.p[i]);
            pvid_put_i32(&payload[PVID_ESTIMATE_Q31_SE + (4u * i)], estimate.se[i]);
        }
    }
    pvid_put_i32(&payload[PVID_ESTIMATE_Q31_KAPPA], estimate.kappa);
    pvid_put_i32(&payload[PVID_ESTIMATE_Q31_RESIDUAL_SD], estimate.residual_sd);
    pvid_put_u32(&payload[PVID_ESTIMATE_Q31_WEIGHT], estimate.weight);
    payload[PVID_ESTIMATE_Q31_REASON] = (uint8_t)reason;
}

const pvid_counters *identifier_counters(void)
{
    return &identifier.estimator.counters;
}
