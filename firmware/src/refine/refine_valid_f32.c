#include "number/uncontracted.h"

#include "refine/refine_valid_f32.h"

#include <stddef.h>

#include "number/finite_f32.h"
#include "number/unroll.h"

PVID_COLD static bool all_within(const float values[], size_t n, float low, float high)
{
    bool within = true;
    for (size_t i = 0; i < n; i++) {
        within = within && pvid_within_f32(values[i], low, high);
    }
    return within;
}

static pvid_status signals_are_valid(const pvid_refine_config_f32 *config, size_t samples)
{
    if (config->signal == NULL) {
        return PVID_BAD_DESIGN;
    }
    for (size_t i = 0; i < PVID_REFINE_SIGNALS; i++) {
        const pvid_refine_signal_f32 *signal = &config->signal[i];
        const bool derived = (signal->order == 2) && PVID_REFINE_IS_INPUT(i) && (config->second != NULL);
        const bool integrated =
            (signal->order == -1) && PVID_REFINE_IS_INPUT(i) && (signal->source == (uint8_t)PVID_SIGNAL_SAMPLED);
        if (((signal->order != 0) && !derived && !(integrated && (PVID_REFINE_INTEGRALS != 0))) ||
            (signal->sample >= samples) ||
            (signal->source > ((PVID_REFINE_IS_INPUT(i)) ? (uint8_t)PVID_SIGNAL_HELD : (uint8_t)PVID_SIGNAL_SAMPLED)) ||
            !pvid_within_f32(signal->scale, -1.0e9f, 1.0e9f)) {
            return PVID_BAD_DESIGN;
        }
        if (!pvid_within_f32(signal->range, 1.0e-9f, 1.0e9f)) {
            return PVID_BAD_RANGE;
        }
    }
    const bool weights =
        (config->second == NULL) || all_within(config->second, PVID_REFINE_HALF + 1, -1.0e12f, 1.0e12f);
    return weights ? PVID_OK : PVID_BAD_DESIGN;
}

static pvid_status blocks_are_valid(const pvid_refine_config_f32 *config)
{
    if ((config->first_block < 8u) || (config->first_block > config->block) ||
        (((uint32_t)config->block * 6u) > PVID_REFINE_RING)) {
        return PVID_BAD_WINDOW;
    }
    const bool passes = (config->passes >= 1u) && (config->passes <= config->most_passes) &&
                        (config->most_passes <= 16u) && (config->jobs >= 1u) && (config->jobs <= 128u);
    return passes ? PVID_OK : PVID_BAD_ITERATIONS;
}

static pvid_status sizes_are_valid(const pvid_refine_config_f32 *config)
{
    if (!all_within(config->sd, PVID_REFINE_OUTPUTS, 1.0e-15f, 1.0e9f)) {
        return PVID_BAD_ROW_SD;
    }
    if (!all_within(config->prior_sd, PVID_REFINE_PARAMETERS, 1.0e-9f, 1.0e9f)) {
        return PVID_BAD_START_SD;
    }
#if PVID_REFINE_RUNGE_KUTTA
    if ((config->parts < 1u) || (config->fine_parts < config->parts) || (config->fine_parts > 64u)) {
        return PVID_BAD_DECIMATION;
    }
#endif
#if PVID_REFINE_OBSERVER
    if (!all_within(config->observer, PVID_REFINE_OUTPUTS * PVID_REFINE_STATES, -1.0e9f, 1.0e9f)) {
        return PVID_BAD_DESIGN;
    }
#endif
#if PVID_REFINE_WIDTHS > 0
    if (!all_within(config->width, PVID_REFINE_WIDTHS, 1.0e-9f, 1.0e9f)) {
        return PVID_BAD_BOUNDS;
    }
#endif
    if (!all_within(config->state_limit, PVID_REFINE_STATES, 1.0e-9f, 1.0e9f)) {
        return PVID_BAD_BOUNDS;
    }
    if (!pvid_within_f32(config->forgetting_s, 0.0f, 1.0e9f)) {
        return PVID_BAD_FORGETTING;
    }
    return PVID_OK;
}

static pvid_status limits_are_valid(const pvid_refine_config_f32 *config)
{
    const bool gate =
        pvid_within_f32(config->outlier_gate, 2.0f, 1.0e3f) || pvid_within_f32(config->outlier_gate, 0.0f, 0.0f);
    if (!gate || !pvid_within_f32(config->gate, 0.0f, 1.0e3f)) {
        return PVID_BAD_GATE_SIGMAS;
    }
    if (!pvid_within_f32(config->chi_max, 1.0f, 1.0e6f) || !pvid_within_f32(config->clash_max, 1.0f, 1.0e6f)) {
        return PVID_BAD_MISFIT_MAX;
    }
    if (!pvid_within_f32(config->step_limit, 1.0e-6f, 1.0e6f) || !pvid_within_f32(config->step_max, 1.0e-9f, 1.0e6f)) {
        return PVID_BAD_STEP_LIMIT;
    }
#if PVID_REFINE_SIGNS > 0
    if (!pvid_within_f32(config->step_fine, 1.0e-9f, 1.0e6f)) {
        return PVID_BAD_STEP_LIMIT;
    }
#endif
    if (!pvid_within_f32(config->se_max, 1.0e-9f, 1.0e9f)) {
        return PVID_BAD_SE_MAX;
    }
    return pvid_within_f32(config->distance, 0.0f, 1.0e9f) ? PVID_OK : PVID_BAD_START_SD;
}

PVID_COLD pvid_status pvid_refine_valid_f32(const pvid_refine_config_f32 *config, size_t samples)
{
    if (!pvid_within_f32(config->sample_rate_hz, 1.0e-3f, 1.0e6f)) {
        return PVID_BAD_SAMPLE_RATE;
    }
    if (config->ratio < 1u) {
        return PVID_BAD_DECIMATION;
    }
    pvid_status status = signals_are_valid(config, samples);
    if (status == PVID_OK) {
        status = blocks_are_valid(config);
    }
    if (status == PVID_OK) {
        status = sizes_are_valid(config);
    }
    return (status == PVID_OK) ? limits_are_valid(config) : status;
}
