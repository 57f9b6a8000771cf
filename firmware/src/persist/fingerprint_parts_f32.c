#include "number/uncontracted.h"

#include "persist/fingerprint_parts_f32.h"

#include "number/finite_f32.h"
#include "pvid/fnv_word.h"

uint32_t pvid_fingerprint_floats(uint32_t hash, const float values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, pvid_bits_f32(values[i]));
    }
    return running;
}

uint32_t pvid_fingerprint_float(uint32_t hash, float value)
{
    return pvid_fnv_word(hash, pvid_bits_f32(value));
}

uint32_t pvid_fingerprint_estimator_f32(uint32_t hash, const pvid_estimator_config_f32 *config, size_t n_p)
{
    uint32_t running = pvid_fingerprint_floats(hash, config->start, n_p);
    running = pvid_fingerprint_floats(running, config->start_sd, n_p);
    running = pvid_fingerprint_floats(running, config->lower, n_p);
    running = pvid_fingerprint_floats(running, config->upper, n_p);
    running = pvid_fingerprint_float(running, config->row_sd);
    running = pvid_fingerprint_float(running, config->forgetting_s);
    running = pvid_fingerprint_float(running, config->feedback_hz);
    running = pvid_fingerprint_float(running, config->step_limit);
    running = pvid_fingerprint_float(running, config->kappa_min);
    running = pvid_fingerprint_float(running, config->noise_margin);
    running = pvid_fingerprint_float(running, config->dead_zone);
    running = pvid_fnv_word(running, (uint32_t)config->law);
    return pvid_fnv_word(running, config->divider);
}

uint32_t pvid_fingerprint_gate_f32(uint32_t hash, const pvid_gate_config_f32 *config)
{
    return pvid_fingerprint_float(pvid_fingerprint_float(hash, config->sigmas), config->patience_s);
}

uint32_t pvid_fingerprint_trust_f32(uint32_t hash, const pvid_trust_config_f32 *config)
{
    uint32_t running = pvid_fingerprint_float(hash, config->kappa_min);
    running = pvid_fingerprint_float(running, config->se_max);
    running = pvid_fingerprint_float(running, config->misfit_max);
    running = pvid_fnv_word(running, config->groups_min);
    running = pvid_fnv_word(running, config->revert_after);
    running = pvid_fingerprint_float(running, config->renewal);
    return pvid_fingerprint_float(running, config->neglected);
}
