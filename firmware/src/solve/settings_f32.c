#include "number/uncontracted.h"

#include "solve/settings_f32.h"

#include <stdbool.h>
#include <stddef.h>

#include "number/fingerprint_numbers_f32.h"
#include "number/finite_f32.h"
#include "number/unroll.h"
#include "pvid/fnv_word.h"

#define GROUPS_MIN 4.0f

static pvid_status parameters_are_valid(const pvid_estimator_config_f32 *config, size_t n_p, uint32_t positive)
{
    for (size_t i = 0; i < n_p; i++) {
        const float lower = config->lower[i];
        const float upper = config->upper[i];
        if (!pvid_finite_f32(lower) || !pvid_finite_f32(upper) || !(lower < upper) ||
            ((((positive >> i) & 1u) != 0u) && !(lower > 0.0f))) {
            return PVID_BAD_BOUNDS;
        }
        if (!pvid_within_f32(config->start[i], lower, upper)) {
            return PVID_BAD_START;
        }
        if (!pvid_within_f32(config->start_sd[i], 1.0e-12f, 1.0e12f)) {
            return PVID_BAD_START_SD;
        }
    }
    return PVID_OK;
}

PVID_COLD pvid_status pvid_settings_within_f32(const float values[], const pvid_range_f32 ranges[], size_t count)
{
    for (size_t i = 0; i < count; i++) {
        const pvid_range_f32 *range = &ranges[i];
        const bool off = range->or_zero && pvid_within_f32(values[i], 0.0f, 0.0f);
        if (!off && !pvid_within_f32(values[i], range->least, range->most)) {
            return range->status;
        }
    }
    return PVID_OK;
}

PVID_COLD pvid_status pvid_settings_are_valid_f32(const pvid_estimator_config_f32 *config, size_t n_p,
                                                  uint32_t positive, float update_rate_hz)
{
    const pvid_status parameters = parameters_are_valid(config, n_p, positive);
    if (parameters != PVID_OK) {
        return parameters;
    }
    /* in the order of `values` */
    static const pvid_range_f32 ranges[] = {
        {1.0e-12f, 1.0e12f, PVID_BAD_ROW_SD, false},
        {1.0e-6f, 1.0e6f, PVID_BAD_UPDATE_RATE, false},
        {0.0f, 1.0e12f, PVID_BAD_FORGETTING, false},
        {GROUPS_MIN, 1.0e18f, PVID_BAD_FORGETTING, false},
        {0.0f, (PVID_FEEDBACK != 0) ? 1.0e12f : 0.0f, PVID_BAD_FEEDBACK, false},
        {1.0f, 1.0e6f, PVID_BAD_CORRELATION, false},
        {1.0e-6f, 0.9f, PVID_BAD_STEP_LIMIT, false},
        {0.0f, 0.999f, PVID_BAD_KAPPA_MIN, false},
        {0.0f, 1.0e6f, PVID_BAD_NOISE_MARGIN, false},
        {0.0f, (PVID_DEAD_ZONE != 0) ? 100.0f : 0.0f, PVID_BAD_DEAD_ZONE, false},
    };
    /* fewer than four groups in the time constant of forgetting are none */
    const float groups = (config->forgetting_s > 0.0f) ? (config->forgetting_s * update_rate_hz) : GROUPS_MIN;
    const float values[] = {config->row_sd,       update_rate_hz,      config->forgetting_s, groups,
                            config->feedback_hz,  config->correlation, config->step_limit,   config->kappa_min,
                            config->noise_margin, config->dead_zone};
    const pvid_status status = pvid_settings_within_f32(values, ranges, sizeof values / sizeof values[0]);
    if (status != PVID_OK) {
        return status;
    }
    if ((config->law != PVID_LAW_STATIONARY) && ((PVID_FEEDBACK == 0) || (config->law != PVID_LAW_PSEUDOVELOCITY))) {
        return PVID_BAD_LAW;
    }
    return (config->divider >= 1u) ? PVID_OK : PVID_BAD_DIVIDER;
}

PVID_COLD float pvid_settings_gain_f32(const pvid_estimator_config_f32 *config, float update_rate_hz, float interval)
{
    if (PVID_FEEDBACK == 0) {
        return 1.0f;
    }
    if (config->law == PVID_LAW_PSEUDOVELOCITY) {
        return 0.0f;
    }
    const float gain = (config->feedback_hz * interval) / update_rate_hz;
    return ((config->feedback_hz > 0.0f) && (gain < 1.0f)) ? gain : 1.0f;
}

/* exp(-x), 0 <= x <= 4, by the series of exp(x): the core has no libm but sqrtf. Accurate to a few
 * ulp; called once, in init. */
PVID_COLD float pvid_settings_decay_f32(float x)
{
    float sum = 1.0f;
    for (size_t k = 24; k > 0u; k--) {
        sum = 1.0f + ((x / (float)k) * sum);
    }
    return 1.0f / sum;
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
