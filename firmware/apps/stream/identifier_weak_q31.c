#include "frames_q31.h"
#include "identifier.h"
#include "pvid/fnv_q31.h"
#include "pvid/little_endian.h"
#include "pvid/weak_q31.h"
#include "stream_tables.h"

static pvid_weak_q31 identifier;

/* Integers have one arithmetic. */
uint32_t identifier_arithmetic_faults(void)
{
    return 0;
}

pvid_status identifier_start(const uint8_t payload[PVID_CONFIGURE_Q31_BYTES])
{
    pvid_weak_config_q31 config = STREAM_CONFIG;
    get_estimator_config(&config.estimator, payload);
    return pvid_weak_init_q31(&identifier, &config);
}

pvid_reason identifier_step(const uint8_t sample[SAMPLE_BYTES])
{
    int32_t readings[STREAM_SAMPLES];
    for (size_t i = 0; i < STREAM_SAMPLES; i++) {
        readings[i] = pvid_get_i32(&sample[4u * i]);
    }
    return pvid_weak_step_q31(&identifier, readings);
}

uint32_t identifier_hash(uint32_t hash, pvid_reason reason)
{
    return pvid_fnv_estimator_q31(hash, &identifier.estimator, reason);
}

/* The published estimate. */
void identifier_estimate(uint8_t payload[PVID_ESTIMATE_Q31_BYTES], uint32_t session, pvid_reason reason)
{
    put_estimate(payload, pvid_weak_estimate_q31(&identifier), session, identifier.estimator.counters.updates, reason);
}

const pvid_counters *identifier_counters(void)
{
    return &identifier.estimator.counters;
}
