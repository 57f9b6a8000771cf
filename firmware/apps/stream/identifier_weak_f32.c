#include "frames_f32.h"
#include "identifier.h"
#include "pvid/fnv.h"
#include "pvid/little_endian.h"
#include "pvid/pvid.h"
#include "pvid/weak.h"
#include "stream_tables.h"

#ifdef STREAM_REFINED
#include "pvid/fnv_refine.h"
#include "stream_refine.h"
#endif

static pvid_weak_f32 identifier;

#ifdef STREAM_REFINED
typedef char frames_hold_the_refined[(STREAM_SHOWN <= PVID_LINK_P) ? 1 : -1];

static pvid_refine_f32 refinement;
static const pvid_weak_refine_f32 second = {&pvid_refiner_f32, &refinement, &stream_refine_config};
#endif

uint32_t identifier_arithmetic_faults(void)
{
    return pvid_arithmetic_faults_f32();
}

pvid_status identifier_start(const uint8_t payload[PVID_CONFIGURE_BYTES])
{
    pvid_weak_config_f32 config = STREAM_CONFIG;
    get_estimator_config(&config.estimator, payload);
#ifdef STREAM_REFINED
    config.refine = &second;
#endif
    return pvid_weak_init_f32(&identifier, &config);
}

pvid_reason identifier_step(const uint8_t sample[SAMPLE_BYTES])
{
    float values[STREAM_SAMPLES];
    get_floats(values, sample, STREAM_SAMPLES);
    return pvid_weak_step_f32(&identifier, values);
}

uint32_t identifier_hash(uint32_t hash, pvid_reason reason)
{
    const uint32_t weak = pvid_fnv_estimator_f32(hash, &identifier.estimator, reason);
#ifdef STREAM_REFINED
    return pvid_fnv_refine_f32(weak, &refinement, pvid_refine_reason_f32(&refinement));
#else
    return weak;
#endif
}

#ifdef STREAM_REFINED
void identifier_refined(uint8_t payload[PVID_REFINED_ESTIMATE_BYTES], uint32_t session)
{
    pvid_estimate_f32 best;
    pvid_refine_estimate_f32 refined;
    uint32_t number = 0;
    memset(payload, 0, PVID_REFINED_ESTIMATE_BYTES);
    pvid_put_u32(&payload[PVID_REFINED_ESTIMATE_SESSION], session);
    const pvid_stage stage = pvid_refine_best_f32(&refinement, pvid_weak_estimate_f32(&identifier), &best);
    payload[PVID_REFINED_ESTIMATE_STAGE] = (uint8_t)stage;
    put_p(&payload[PVID_REFINED_ESTIMATE_P], &payload[PVID_REFINED_ESTIMATE_COVARIANCE], &best);
    if (pvid_refine_read_f32(&refinement, &refined, &number) && (number > 0u)) {
        pvid_put_u32(&payload[PVID_REFINED_ESTIMATE_NUMBER], number);
        for (size_t i = 0; i < STREAM_SHOWN; i++) {
            pvid_put_f32(&payload[PVID_REFINED_ESTIMATE_R + (4u * i)], refined.r[stream_shown[i]]);
            pvid_put_f32(&payload[PVID_REFINED_ESTIMATE_SE + (4u * i)], refined.se[stream_shown[i]]);
        }
        pvid_put_f32(&payload[PVID_REFINED_ESTIMATE_LEVEL], refined.level);
        pvid_put_f32(&payload[PVID_REFINED_ESTIMATE_CLASH], refined.clash);
    }
    payload[PVID_REFINED_ESTIMATE_REASON] = (uint8_t)pvid_refine_reason_f32(&refinement);
}
#endif

/* The published estimate of the weak form. */
void identifier_estimate(uint8_t payload[PVID_ESTIMATE_BYTES], uint32_t session, pvid_reason reason)
{
    put_estimate(payload, pvid_weak_estimate_f32(&identifier), session, identifier.estimator.counters.updates, reason);
}

const pvid_counters *identifier_counters(void)
{
    return &identifier.estimator.counters;
}
