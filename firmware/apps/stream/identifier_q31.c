#include "frames_q31.h"
#include "identifier.h"
#include "pvid/little_endian.h"
#include "pvid/pvid_q31.h"
#include "stream_tables.h"

static STREAM_TYPE identifier;

/* Integers have one arithmetic. */
uint32_t identifier_arithmetic_faults(void)
{
    return 0;
}

pvid_status identifier_start(const uint8_t payload[PVID_CONFIGURE_Q31_BYTES])
{
    STREAM_CONFIG config = stream_config;
    get_estimator_config(&config.estimator, payload);
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
    STREAM_ASSESS(&STREAM_ASSESSED, &estimate);
    put_estimate(payload, &estimate, session, identifier.estimator.counters.updates, reason);
}

const pvid_counters *identifier_counters(void)
{
    return &identifier.estimator.counters;
}
