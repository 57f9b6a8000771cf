#include "persist/fingerprint_parts_q31.h"

#include "pvid/fnv_word.h"

uint32_t pvid_fingerprint_words(uint32_t hash, const int32_t values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, (uint32_t)values[i]);
    }
    return running;
}

uint32_t pvid_fingerprint_formats(uint32_t hash, const int8_t values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, (uint32_t)(int32_t)values[i]);
    }
    return running;
}

uint32_t pvid_fingerprint_table(uint32_t hash, const PVID_TABLE int32_t *values, size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, (uint32_t)values[i]);
    }
    return running;
}

uint32_t pvid_fingerprint_estimator_q31(uint32_t hash, const pvid_estimator_config_q31 *config, size_t n_theta,
                                        size_t n_p)
{
    uint32_t running = pvid_fingerprint_words(hash, config->start, n_p);
    running = pvid_fingerprint_words(running, config->start_sd, n_p);
    running = pvid_fingerprint_words(running, config->lower, n_p);
    running = pvid_fingerprint_words(running, config->upper, n_p);
    running = pvid_fingerprint_formats(running, config->p_bits, n_p);
    running = pvid_fingerprint_formats(running, config->n_bits, n_theta);
    running = pvid_fingerprint_formats(running, &config->y_bits, (n_theta > 0u) ? 1u : 0u);
    running = pvid_fingerprint_words(running, &config->row_sd, 1);
    running = pvid_fnv_word(running, config->forgetting_groups);
    running = pvid_fingerprint_words(running, &config->gain, 1);
    running = pvid_fnv_word(running, config->correlation);
    running = pvid_fnv_word(running, config->row_weight);
    running = pvid_fnv_word(running, config->step_limit);
    running = pvid_fingerprint_words(running, &config->kappa_min, 1);
    running = pvid_fnv_word(running, config->noise_margin);
    running = pvid_fnv_word(running, config->dead_zone);
    return pvid_fnv_word(running, config->divider);
}

uint32_t pvid_fingerprint_trust_q31(uint32_t hash, const pvid_trust_config_q31 *config)
{
    const int32_t limits[] = {config->kappa_min, config->se_max};
    uint32_t running = pvid_fingerprint_words(hash, limits, sizeof limits / sizeof limits[0]);
    running = pvid_fnv_word(running, config->misfit_max);
    running = pvid_fnv_word(running, config->groups_min);
    running = pvid_fnv_word(running, config->revert_after);
    running = pvid_fnv_word(running, config->renewal);
    return pvid_fnv_word(running, (uint32_t)config->neglected);
}

uint32_t pvid_fingerprint_gate_q31(uint32_t hash, const pvid_gate_config_q31 *config)
{
    return pvid_fnv_word(pvid_fnv_word(hash, config->sigmas), config->patience_groups);
}
