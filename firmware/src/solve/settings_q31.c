#include "solve/settings_q31.h"

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "number/fingerprint_numbers_q31.h"
#include "number/integer_q31.h"
#include "number/unroll.h"
#include "solve/state_q31.h"
#include "solve/system_q31.h"
#include "pvid/fnv_word.h"

#define NOISE_MARGIN_MAX ((uint32_t)1 << 30)
#define DEAD_ZONE_MAX ((uint32_t)100 << 16)

static pvid_status parameters_are_valid(const pvid_estimator_config_q31 *config, uint8_t n_p, uint32_t positive)
{
    for (size_t i = 0; i < n_p; i++) {
        const bool above_zero = ((positive >> i) & 1u) != 0u;
        if ((config->lower[i] >= config->upper[i]) || (config->lower[i] == INT32_MIN) ||
            (above_zero && (config->lower[i] <= 0))) {
            return PVID_BAD_BOUNDS;
        }
        if ((config->start[i] < config->lower[i]) || (config->start[i] > config->upper[i])) {
            return PVID_BAD_START;
        }
        if (config->start_sd[i] <= 0) {
            return PVID_BAD_START_SD;
        }
    }
    return PVID_OK;
}

PVID_COLD pvid_status pvid_settings_are_valid_q31(const pvid_estimator_config_q31 *config, uint8_t n_p,
                                                  uint32_t positive)
{
    const pvid_status parameters = parameters_are_valid(config, n_p, positive);
    if (parameters != PVID_OK) {
        return parameters;
    }
    if (config->row_sd <= 0) {
        return PVID_BAD_ROW_SD;
    }
    if ((config->forgetting_groups != 0u) &&
        ((config->forgetting_groups < 4u) || (config->forgetting_groups > ((uint32_t)1 << 24)))) {
        return PVID_BAD_FORGETTING;
    }
    if ((config->gain < 0) || (config->gain > PVID_ONE_Q30)) {
        return PVID_BAD_FEEDBACK;
    }
    if ((config->correlation < ((uint32_t)1 << 16)) || (config->correlation > ((uint32_t)1 << 31))) {
        return PVID_BAD_CORRELATION;
    }
    if ((config->row_weight < 1u) || (config->row_weight > ((uint32_t)1 << 16))) {
        return PVID_BAD_ROW_WEIGHT;
    }
    if ((config->step_limit < 1u) || (config->step_limit > 58982u)) {
        return PVID_BAD_STEP_LIMIT;
    }
    if ((config->kappa_min < 0) || (config->kappa_min > (PVID_ONE_Q30 - (PVID_ONE_Q30 / 1000)))) {
        return PVID_BAD_KAPPA_MIN;
    }
    if (config->noise_margin > NOISE_MARGIN_MAX) {
        return PVID_BAD_NOISE_MARGIN;
    }
    if (config->dead_zone > ((PVID_DEAD_ZONE != 0) ? DEAD_ZONE_MAX : 0u)) {
        return PVID_BAD_DEAD_ZONE;
    }
    return (config->divider >= 1u) ? PVID_OK : PVID_BAD_DIVIDER;
}

PVID_COLD void pvid_settings_init_q31(pvid_solve_settings_q31 *self, const pvid_estimator_config_q31 *config,
                                      uint8_t n_p, uint32_t positive)
{
    memcpy(self->p_bits, config->p_bits, sizeof self->p_bits);
    for (size_t i = 0; i < n_p; i++) {
        self->start_sd[i] = config->start_sd[i];
        self->lower[i] = config->lower[i];
        self->upper[i] = config->upper[i];
        self->prior_exponent[i] =
            (int16_t)pvid_square_ratio_q31(config->row_sd, -PVID_ROW_SD_BITS, config->start_sd[i], &self->prior[i]);
    }
    self->row_sd = config->row_sd;
    self->gain = config->gain;
    self->correlation = config->correlation;
    self->step_limit = config->step_limit;
    self->kappa_min = config->kappa_min;
    self->noise_margin = config->noise_margin;
    self->dead_zone = config->dead_zone;
    self->n_p = n_p;
    self->positive = (pvid_p_bits)(positive & PVID_P_ALL);
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
    running = pvid_fingerprint_formats(running, &config->y_bits, 1);
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
