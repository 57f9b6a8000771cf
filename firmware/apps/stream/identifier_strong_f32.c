/* The printed strong form of any mechanism; STREAM_NAME(verb) is NAME_strong_<verb>_f32. */
#include "frames_f32.h"
#include "identifier.h"
#include "pvid/arithmetic.h"
#include "stream_tables.h"

static STREAM_TYPE identifier;

uint32_t identifier_arithmetic_faults(void)
{
    return pvid_arithmetic_faults_f32();
}

pvid_status identifier_start(const uint8_t payload[PVID_CONFIGURE_BYTES])
{
    static STREAM_CONFIG_TYPE config; /* the identifier reads it where it is */
    config = STREAM_CONFIG;
    get_estimator_config(&config.estimator, payload);
    return STREAM_NAME(init)(&identifier, &config);
}

pvid_reason identifier_step(const uint8_t sample[SAMPLE_BYTES])
{
    float values[STREAM_SAMPLES];
    get_floats(values, sample, STREAM_SAMPLES);
    return STREAM_NAME(step)(&identifier, values);
}

uint32_t identifier_hash(uint32_t hash, pvid_reason reason)
{
    return STREAM_NAME(fnv)(hash, &identifier.estimator, reason);
}

void identifier_estimate(uint8_t payload[PVID_ESTIMATE_BYTES], uint32_t session, pvid_reason reason)
{
    pvid_estimate_f32 estimate;
    STREAM_NAME(assess)(&identifier, &estimate);
    estimate.standing = (pvid_standing){0, 0, 0};
    put_estimate(payload, &estimate, session, identifier.estimator.counters.updates, reason);
    pvid_put_u32(&payload[PVID_ESTIMATE_STANDING], UINT32_MAX); /* the strong form has none */
}

const pvid_counters *identifier_counters(void)
{
    return &identifier.estimator.counters;
}
