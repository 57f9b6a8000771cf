#include "number/uncontracted.h"

#include "persist/fingerprint_weak_f32.h"

#include <stdbool.h>
#include <stddef.h>

#include "judge/gate_f32.h"
#include "judge/trust_f32.h"
#include "number/fingerprint_numbers_f32.h"
#include "solve/settings_f32.h"
#include "persist/fingerprint_tables.h"
#include "number/finite_f32.h"
#include "pvid/fnv_word.h"

/* ---- the functions of a model, by their results ---- */

/* All NaNs have one hash: their bits differ between processors. */
static uint32_t results(uint32_t hash, const float values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, pvid_finite_f32(values[i]) ? pvid_bits_f32(values[i]) : 0x7FC00000u);
    }
    return running;
}

/* Different numbers between 3/8 and 4 with few digits, all positive or of both signs. */
static void make_point(bool positive, size_t n, float point[])
{
    for (size_t i = 0; i < n; i++) {
        const float size = 0.375f + (0.140625f * (float)i);
        point[i] = (positive || ((i % 2u) == 0u)) ? size : -size;
    }
}

static uint32_t signal_functions(uint32_t hash, const pvid_weak_model_f32 *model, bool positive)
{
    const size_t inputs = (size_t)model->jets + model->runs + model->signs;
    float in[PVID_MAX_INPUTS] = {0.0f};
    float out[PVID_MAX_CHANNELS + (2 * PVID_MAX_INTEGRANDS)] = {0.0f};
    uint32_t running = hash;
    make_point(positive, inputs, in);
    model->values(in, out);
    running = results(running, out, (size_t)model->gains + model->integrands);
    if (model->prepare != NULL) {
        model->prepare(in, out);
        running = results(running, out, (size_t)model->runs + model->signs);
    }
    return running;
}

static uint32_t parameters_of(uint32_t hash, const pvid_model_f32 *model)
{
    const uint8_t sizes[] = {model->n_theta, model->n_p, model->n_kinds};
    uint32_t running = pvid_fingerprint_bytes(hash, sizes, sizeof sizes);
    running = pvid_fnv_word(running, model->n_moments);
    running = pvid_fnv_word(running, model->n_c);
    running = pvid_fnv_word(running, model->positive);
    running = pvid_fingerprint_bytes(running, model->kind_end, (model->n_kinds > 1u) ? model->n_kinds : 0u);
    running = pvid_fingerprint_bytes(running, model->c_row, model->n_c);
    running = pvid_fingerprint_bytes(running, model->c_column, model->n_c);
    float p[PVID_MAX_P] = {0.0f};
    float theta[PVID_MAX_THETA] = {0.0f};
    make_point(true, model->n_p, p);
    model->theta(p, theta);
    return results(running, theta, model->n_theta);
}

static uint32_t terms_of(uint32_t hash, const pvid_weak_term_f32 term[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        const uint8_t fields[] = {term[i].channel, term[i].order, term[i].column};
        running = pvid_fingerprint_bytes(running, fields, sizeof fields);
        running = pvid_fingerprint_float(running, term[i].factor);
    }
    return running;
}

uint32_t pvid_fingerprint_weak_model_f32(const pvid_weak_model_f32 *model)
{
    const uint8_t sizes[] = {model->samples, model->signals,    model->jets,     model->runs, model->signs,
                             model->gains,   model->integrands, model->channels, model->kinds};
    uint32_t hash = pvid_fingerprint_bytes(PVID_FNV_START, sizes, sizeof sizes);
    hash = pvid_fingerprint_signals(hash, model->signal, model->signals);
    hash = pvid_fingerprint_jets(hash, model->jet, model->jets);
    hash = pvid_fingerprint_channels(hash, model->channel, model->channels);
    hash = terms_of(hash, model->term, model->kind[model->kinds - 1u].end);
    hash = pvid_fingerprint_kinds(hash, model->kind, model->kinds);
    hash = signal_functions(hash, model, true);
    hash = signal_functions(hash, model, false);
    return parameters_of(hash, model->model);
}

/* ---- the tables of a design ---- */

static uint32_t filters_of(uint32_t hash, const pvid_weak_filter_f32 filter[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, filter[i].half);
        running = pvid_fingerprint_floats(running, filter[i].weights, filter[i].half);
    }
    return running;
}

static uint32_t noise_of(uint32_t hash, const pvid_weak_noise_f32 noise[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        const uint8_t fields[] = {noise[i].kind, noise[i].power, noise[i].a, noise[i].b};
        running = pvid_fingerprint_bytes(running, fields, sizeof fields);
        running = pvid_fingerprint_float(running, noise[i].factor);
    }
    return running;
}

uint32_t pvid_fingerprint_weak_design_f32(const pvid_weak_design_f32 *design)
{
    const pvid_weak_model_f32 *model = design->model;
    const uint8_t sizes[] = {design->functions, design->power, design->decimation};
    uint32_t hash = pvid_fingerprint_bytes(PVID_FNV_START, sizes, sizeof sizes);
    hash = pvid_fnv_word(hash, design->hop);
    hash = filters_of(hash, design->compensator, model->jets);
    hash = pvid_fingerprint_floats(hash, design->circle, (5u * (size_t)design->hop) / 2u);
    hash = pvid_fnv_word(hash, design->n_noise);
    hash = noise_of(hash, design->noise, design->n_noise);
    hash = pvid_fingerprint_bytes(hash, design->error_order, model->kinds);
    hash = pvid_fingerprint_floats(hash, design->error_variance, model->kinds);
    hash = pvid_fingerprint_floats(hash, design->sign_width, model->signs);
    hash = pvid_fingerprint_floats(hash, design->sign_doubt, (design->sign_doubt != NULL) ? model->signs : 0u);
    return pvid_fingerprint_float(hash, design->overlap);
}

/* ---- the configuration ---- */

/* Limits of the samples that may be missing. */
static uint32_t limits_of(uint32_t hash, const float limits[], size_t n)
{
    const uint32_t running = pvid_fnv_word(hash, (limits != NULL) ? 1u : 0u);
    return pvid_fingerprint_floats(running, limits, (limits != NULL) ? n : 0u);
}

uint32_t pvid_fingerprint_weak_f32(const pvid_weak_config_f32 *config)
{
    const pvid_weak_model_f32 *model = config->design->model;
    uint32_t hash = pvid_fingerprint_float(PVID_FNV_START, config->sample_rate_hz);
    hash = limits_of(hash, config->range, model->samples);
    hash = limits_of(hash, config->drive_min, model->samples);
    hash = pvid_fnv_word(hash, config->compensation ? 1u : 0u);
    hash = pvid_fnv_word(hash, config->iterations);
    hash = pvid_fingerprint_estimator_f32(hash, &config->estimator, model->model->n_p);
    hash = pvid_fingerprint_trust_f32(hash, &config->trust, model->model->n_p);
    return pvid_fingerprint_gate_f32(hash, &config->gate);
}
