#include "number/uncontracted.h"

#include "persist/fingerprint_refine_f32.h"

#include <stddef.h>

#include "number/fingerprint_numbers_f32.h"
#include "persist/fingerprint_tables.h"
#include "number/finite_f32.h"
#include "pvid/fnv_word.h"
#include "refine_model_f32.h"

/* Different numbers from 3/8 on with few digits. */
static void make_point(size_t n, float first, float point[])
{
    for (size_t i = 0; i < n; i++) {
        point[i] = first + (0.140625f * (float)i);
    }
}

/* All NaNs have one hash: their bits differ between processors. */
static uint32_t results(uint32_t hash, const float values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, pvid_finite_f32(values[i]) ? pvid_bits_f32(values[i]) : 0x7FC00000u);
    }
    return running;
}

uint32_t pvid_fingerprint_refine_model_f32(uint32_t hash)
{
    const uint8_t sizes[] = {PVID_REFINE_ORDER,  PVID_REFINE_COORDINATES, PVID_REFINE_INPUTS,    PVID_REFINE_OUTPUTS,
                             PVID_REFINE_MOVING, PVID_REFINE_PARAMETERS,  PVID_REFINE_CONSTANTS, PVID_REFINE_SKEW,
                             PVID_REFINE_P,      PVID_REFINE_RUNGE_KUTTA, PVID_REFINE_SIGNS,     PVID_REFINE_WIDTHS,
                             PVID_REFINE_HIDDEN};
    float r[PVID_REFINE_PARAMETERS];
    float m[PVID_REFINE_CONSTANTS];
    float state[PVID_REFINE_STATES];
    float u[PVID_REFINE_ROOM_U];
    float a[PVID_REFINE_COORDINATES];
    float z[PVID_REFINE_OUTPUTS];
    const float *v = &state[PVID_REFINE_STATES - PVID_REFINE_COORDINATES];
    make_point(PVID_REFINE_PARAMETERS, 0.375f, r);
    make_point(PVID_REFINE_STATES, 0.25f, state);
    make_point(PVID_REFINE_INPUTS, 0.75f, u);
    pvid_refine_constants(r, m);
    pvid_refine_motion(m, state, v, u, a);
    pvid_refine_output(m, r, state, v, u, z);
    uint32_t running = pvid_fingerprint_bytes(hash, sizes, sizeof sizes);
    running = results(running, m, PVID_REFINE_CONSTANTS);
    running = results(running, a, PVID_REFINE_COORDINATES);
    return results(running, z, PVID_REFINE_OUTPUTS);
}

static uint32_t signals_of(uint32_t hash, const pvid_refine_signal_f32 signal[])
{
    uint32_t running = hash;
    for (size_t i = 0; i < PVID_REFINE_SIGNALS; i++) {
        const uint8_t fields[] = {signal[i].sample, (uint8_t)signal[i].order, signal[i].source};
        running = pvid_fingerprint_bytes(running, fields, sizeof fields);
        running = pvid_fingerprint_float(running, signal[i].scale);
        running = pvid_fingerprint_float(running, signal[i].range);
    }
    return running;
}

uint32_t pvid_fingerprint_refine_f32(uint32_t hash, const pvid_refine_config_f32 *config)
{
    const uint8_t small[] = {config->ratio, config->passes, config->most_passes, config->jobs, config->rests};
    const float limits[] = {config->forgetting_s, config->outlier_gate, config->gate,
                            config->chi_max,      config->clash_max,    config->step_max,
                            config->step_limit,   config->se_max,       config->distance};
    uint32_t running = pvid_fingerprint_float(hash, config->sample_rate_hz);
    running = pvid_fingerprint_bytes(running, small, sizeof small);
    running = pvid_fingerprint_floats(running, config->second, (config->second != NULL) ? (PVID_REFINE_HALF + 1) : 0);
#if PVID_REFINE_RUNGE_KUTTA
    const uint8_t parts[] = {config->parts, config->fine_parts};
    running = pvid_fingerprint_bytes(running, parts, sizeof parts);
#endif
#if PVID_REFINE_SIGNS > 0
    running = pvid_fingerprint_float(running, config->step_fine);
#endif
#if PVID_REFINE_OBSERVER
    running = pvid_fingerprint_floats(running, config->observer, PVID_REFINE_OUTPUTS * PVID_REFINE_STATES);
#endif
#if PVID_REFINE_WIDTHS > 0
    running = pvid_fingerprint_floats(running, config->width, PVID_REFINE_WIDTHS);
#endif
    running = signals_of(running, config->signal);
    running = pvid_fnv_word(running, config->block);
    running = pvid_fnv_word(running, config->first_block);
    running = pvid_fingerprint_floats(running, config->sd, PVID_REFINE_OUTPUTS);
    running = pvid_fingerprint_floats(running, config->prior_sd, PVID_REFINE_PARAMETERS);
    running = pvid_fingerprint_floats(running, config->state_limit, PVID_REFINE_STATES);
    return pvid_fingerprint_floats(running, limits, sizeof limits / sizeof limits[0]);
}
