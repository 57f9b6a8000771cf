#include "frames_f32.h"
#include "identifier.h"
#include "pvid/fnv.h"
#include "pvid/weak.h"
#include "pvid/little_endian.h"
#include "pvid/pvid.h"
#include "stream_tables.h"

static pvid_weak_f32 identifier;

uint32_t identifier_arithmetic_faults(void)
{
    return pvid_arithmetic_faults_f32();
}

pvid_status identifier_start(const uint8_t payload[PVID_CONFIGURE_BYTES])
{
    pvid_weak_config_f32 config = STREAM_CONFIG;
    get_estimator_config(&config.estimator, payload);
    return pvid_weak_init_f32(&identifier, &config);
}

void identifier_sample(const int32_t counts[STREAM_SAMPLES], uint8_t sample[SAMPLE_BYTES])
{
    static const float lsb[STREAM_SAMPLES] = STREAM_LSB;
    for (size_t i = 0; i < STREAM_SAMPLES; i++) {
        pvid_put_f32(&sample[4u * i], (float)counts[i] * lsb[i]);
    }
}

pvid_reason identifier_step(const uint8_t sample[SAMPLE_BYTES])
{
    float values[STREAM_SAMPLES];
    for (size_t i = 0; i < STREAM_SAMPLES; i++) {
        values[i] = pvid_get_f32(&sample[4u * i]);
    }
    return pvid_weak_step_f32(&identifier, values);
}

uint32_t identifier_hash(uint32_t hash, pvid_reason reason)
{
    return pvid_fnv_estimator_f32(hash, &identifier.estimator, reason);
}

/* The published estimate. */
void identifier_estimate(uint8_t payload[PVID_ESTIMATE_BYTES], uint32_t session, pvid_reason reason)
{
    put_estimate(payload, pvid_weak_estimate_f32(&identifier), session, identifier.estimator.counters.updates, reason);
}

const pvid_counters *identifier_counters(void)
{
    return &identifier.estimator.counters;
}
