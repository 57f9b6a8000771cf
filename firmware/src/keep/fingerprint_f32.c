#include "number/uncontracted.h"

#include "keep/fingerprint_f32.h"

#include <stddef.h>

#include "keep/fingerprint_parts_f32.h"
#include "pvid/fnv_word.h"

uint32_t pvid_fingerprint_strong_f32(const pvid_strong_config_f32 *config)
{
    uint32_t hash = pvid_fingerprint_float(PVID_FNV_START, config->sample_rate_hz);
    hash = pvid_fingerprint_float(hash, config->l1);
    hash = pvid_fingerprint_float(hash, config->drive_min);
    hash = pvid_fnv_word(hash, config->bank.half);
    hash = pvid_fnv_word(hash, config->bank.stride);
    hash = pvid_fnv_word(hash, config->bank.block);
    hash = pvid_fingerprint_floats(hash, config->bank.weights, (size_t)PVID_ORDERS * config->bank.half);
    hash = pvid_fingerprint_gate_f32(hash, &config->gate);
    hash = pvid_fingerprint_float(hash, config->estimator.correlation);
    hash = pvid_fingerprint_float(hash, config->estimator.row_weight);
    hash = pvid_fnv_word(hash, config->exact_every);
    return pvid_fingerprint_estimator_f32(hash, &config->estimator, PVID_KAPITZA_P);
}

static uint32_t design_of(uint32_t hash, const pvid_weak_design_f32 *design)
{
    const size_t half = (design->taps - 1u) / 2u;
    const size_t functions = design->functions;
    uint32_t running = pvid_fnv_word(hash, design->taps);
    running = pvid_fnv_word(running, design->decimation);
    running = pvid_fnv_word(running, design->window);
    running = pvid_fnv_word(running, design->functions);
    running = pvid_fingerprint_floats(running, design->smooth, half);
    running = pvid_fingerprint_floats(running, design->second, half);
    running = pvid_fingerprint_floats(running, design->chi, 3u * functions * design->window);
    running = pvid_fingerprint_floats(running, design->gram, 3u * functions * (functions + 1u));
    running = pvid_fingerprint_float(running, design->overlap);
    return pvid_fnv_word(running, design->lag);
}

uint32_t pvid_fingerprint_weak_f32(const pvid_weak_config_f32 *config)
{
    const size_t n_p = (size_t)PVID_KAPITZA_P + (config->zero_unknown ? 1u : 0u) + (config->friction ? 2u : 0u);
    uint32_t hash = pvid_fingerprint_float(PVID_FNV_START, config->sample_rate_hz);
    hash = pvid_fingerprint_float(hash, config->l1);
    hash = pvid_fingerprint_float(hash, config->drive_min);
    hash = pvid_fingerprint_float(hash, config->pivot_noise);
    hash = pvid_fingerprint_float(hash, config->angle_limit);
    hash = design_of(hash, config->design);
    hash = pvid_fnv_word(hash, config->full_angle ? 1u : 0u);
    hash = pvid_fnv_word(hash, config->friction ? 1u : 0u);
    hash = pvid_fnv_word(hash, (config->full_angle || config->friction) ? config->passes : 0u);
    hash = pvid_fnv_word(hash, config->zero_unknown ? 1u : 0u);
    hash = pvid_fnv_word(hash, config->iterations);
    hash = pvid_fingerprint_estimator_f32(hash, &config->estimator, n_p);
    hash = pvid_fingerprint_gate_f32(hash, &config->gate);
    return pvid_fingerprint_trust_f32(hash, &config->trust);
}
