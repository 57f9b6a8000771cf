#include "number/uncontracted.h"

#include "keep/fingerprint_f32.h"

#include <stddef.h>

#include "number/finite_f32.h"
#include "pvid/fnv.h"

static uint32_t floats(uint32_t hash, const float values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, pvid_bits_f32(values[i]));
    }
    return running;
}

static uint32_t one(uint32_t hash, float value)
{
    return pvid_fnv_word(hash, pvid_bits_f32(value));
}

/* Without the fields that the identifiers fill in. */
static uint32_t estimator_of(uint32_t hash, const pvid_estimator_config_f32 *config, size_t n_p)
{
    uint32_t running = floats(hash, config->start, n_p);
    running = floats(running, config->start_sd, n_p);
    running = floats(running, config->lower, n_p);
    running = floats(running, config->upper, n_p);
    running = one(running, config->row_sd);
    running = one(running, config->forgetting_s);
    running = one(running, config->feedback_hz);
    running = one(running, config->step_limit);
    running = one(running, config->kappa_min);
    running = one(running, config->noise_margin);
    running = one(running, config->dead_zone);
    running = pvid_fnv_word(running, (uint32_t)config->law);
    return pvid_fnv_word(running, config->divider);
}

static uint32_t gate_of(uint32_t hash, const pvid_gate_config_f32 *config)
{
    return one(one(hash, config->sigmas), config->patience_s);
}

uint32_t pvid_fingerprint_strong_f32(const pvid_strong_config_f32 *config)
{
    uint32_t hash = one(PVID_FNV_START, config->sample_rate_hz);
    hash = one(hash, config->l1);
    hash = one(hash, config->drive_min);
    hash = pvid_fnv_word(hash, config->bank.half);
    hash = pvid_fnv_word(hash, config->bank.stride);
    hash = pvid_fnv_word(hash, config->bank.block);
    hash = floats(hash, config->bank.weights, (size_t)PVID_ORDERS * config->bank.half);
    hash = gate_of(hash, &config->gate);
    hash = one(hash, config->estimator.correlation);
    hash = one(hash, config->estimator.row_weight);
    hash = pvid_fnv_word(hash, config->exact_every);
    return estimator_of(hash, &config->estimator, PVID_KAPITZA_P);
}

static uint32_t design_of(uint32_t hash, const pvid_weak_design_f32 *design)
{
    const size_t half = (design->taps - 1u) / 2u;
    const size_t functions = design->functions;
    uint32_t running = pvid_fnv_word(hash, design->taps);
    running = pvid_fnv_word(running, design->decimation);
    running = pvid_fnv_word(running, design->window);
    running = pvid_fnv_word(running, design->functions);
    running = floats(running, design->smooth, half);
    running = floats(running, design->second, half);
    running = floats(running, design->chi, 3u * functions * design->window);
    running = floats(running, design->gram, 3u * functions * (functions + 1u));
    running = one(running, design->overlap);
    return pvid_fnv_word(running, design->lag);
}

static uint32_t trust_of(uint32_t hash, const pvid_trust_config_f32 *config)
{
    uint32_t running = one(hash, config->kappa_min);
    running = one(running, config->se_max);
    running = one(running, config->misfit_max);
    running = pvid_fnv_word(running, config->groups_min);
    running = pvid_fnv_word(running, config->revert_after);
    return one(running, config->renewal);
}

uint32_t pvid_fingerprint_weak_f32(const pvid_weak_config_f32 *config)
{
    const size_t n_p = (size_t)PVID_KAPITZA_P + (config->zero_unknown ? 1u : 0u) + (config->friction ? 2u : 0u);
    uint32_t hash = one(PVID_FNV_START, config->sample_rate_hz);
    hash = one(hash, config->l1);
    hash = one(hash, config->drive_min);
    hash = one(hash, config->pivot_noise);
    hash = one(hash, config->angle_limit);
    hash = design_of(hash, config->design);
    hash = pvid_fnv_word(hash, config->full_angle ? 1u : 0u);
    hash = pvid_fnv_word(hash, config->friction ? 1u : 0u);
    hash = pvid_fnv_word(hash, (config->full_angle || config->friction) ? config->passes : 0u);
    hash = pvid_fnv_word(hash, config->zero_unknown ? 1u : 0u);
    hash = pvid_fnv_word(hash, config->iterations);
    hash = estimator_of(hash, &config->estimator, n_p);
    hash = gate_of(hash, &config->gate);
    return trust_of(hash, &config->trust);
}
