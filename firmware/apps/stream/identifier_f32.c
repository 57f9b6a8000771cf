#include "frames_f32.h"
#include "identifier.h"
#include "pvid/little_endian.h"
#include "pvid/pvid.h"
#include "stream_tables.h"

static STREAM_TYPE identifier;

uint32_t identifier_arithmetic_faults(void)
{
    return pvid_arithmetic_faults_f32();
}

pvid_status identifier_start(const uint8_t payload[PVID_CONFIGURE_BYTES])
{
    static STREAM_CONFIG config; /* the identifier reads it where it is */
    config = stream_config;
    get_estimator_config(&config.estimator, payload);
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
    return STREAM_HASH(hash, &identifier.estimator, reason);
}

void identifier_estimate(uint8_t payload[PVID_ESTIMATE_BYTES], uint32_t session, pvid_reason reason)
{
    pvid_estimate_f32 estimate;
    STREAM_ASSESS(&STREAM_ASSESSED, &estimate);
    put_estimate(payload, &estimate, session, identifier.estimator.counters.updates, reason);
}

const pvid_counters *identifier_counters(void)
{
    return &identifier.estimator.counters;
}
