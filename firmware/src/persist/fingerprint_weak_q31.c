#include "persist/fingerprint_weak_q31.h"

#include <stdbool.h>
#include <stddef.h>

#include "judge/gate_q31.h"
#include "judge/trust_q31.h"
#include "number/fingerprint_numbers_q31.h"
#include "solve/settings_q31.h"
#include "persist/fingerprint_tables.h"
#include "pvid/fnv_word.h"

/* ---- the functions of a model, by their results ---- */

/* Different numbers from `least` to about ten times it, of both signs. */
static void make_point(int32_t least, size_t n, int32_t point[])
{
    for (size_t i = 0; i < n; i++) {
        const int32_t size = least + ((int32_t)i * ((least / 3) + 1));
        point[i] = ((i % 2u) == 0u) ? size : -size;
    }
}

/* Inputs beyond their reach leave zeros. */
static uint32_t signal_functions(uint32_t hash, const pvid_weak_model_q31 *model, int32_t least)
{
    const size_t inputs = (size_t)model->jets + model->runs + model->signs;
    int32_t in[PVID_MAX_INPUTS] = {0};
    int32_t out[PVID_MAX_CHANNELS + (2 * PVID_MAX_INTEGRANDS)] = {0};
    uint32_t running = hash;
    make_point(least, inputs, in);
    running = pvid_fnv_word(running, model->values(in, out) ? 1u : 0u);
    running = pvid_fingerprint_words(running, out, (size_t)model->gains + model->integrands);
    if (model->prepare != NULL) {
        running = pvid_fnv_word(running, model->prepare(in, out) ? 1u : 0u);
        running = pvid_fingerprint_words(running, out, (size_t)model->runs + model->signs);
    }
    return running;
}

static uint32_t scaled_theta(uint32_t hash, const pvid_model_q31 *model)
{
    pvid_scaled_q31 p[PVID_MAX_P];
    pvid_scaled_q31 theta[PVID_MAX_THETA_Q31];
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        p[i].m = INT32_C(0x28000000) + ((int32_t)i * INT32_C(0x00345678));
        p[i].e = -30;
    }
    model->scaled->theta(p, theta);
    uint32_t running = hash;
    for (size_t i = 0; i < model->n_theta; i++) {
        running = pvid_fingerprint_words(running, &theta[i].m, 1);
        running = pvid_fingerprint_words(running, &theta[i].e, 1);
    }
    return running;
}

static uint32_t plain_theta(uint32_t hash, const pvid_model_q31 *model)
{
    int32_t p[PVID_MAX_P];
    int64_t theta[PVID_MAX_THETA_Q31];
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        p[i] = INT32_C(0x28000000) + ((int32_t)i * INT32_C(0x00345678));
    }
    model->theta(p, theta);
    uint32_t running = hash;
    for (size_t i = 0; i < model->n_theta; i++) {
        running = pvid_fnv_word(running, (uint32_t)((uint64_t)theta[i] >> 32));
        running = pvid_fnv_word(running, (uint32_t)((uint64_t)theta[i] & UINT32_MAX));
    }
    return running;
}

static uint32_t parameters_of(uint32_t hash, const pvid_model_q31 *model)
{
    const uint8_t sizes[] = {model->n_theta, model->n_p, model->n_kinds, model->n_c};
    uint32_t running = pvid_fingerprint_bytes(hash, sizes, sizeof sizes);
    running = pvid_fnv_word(running, model->positive);
    running = pvid_fingerprint_bytes(running, model->kind_end, (model->n_kinds > 1u) ? model->n_kinds : 0u);
    running = pvid_fingerprint_bytes(running, model->c_row, model->n_c);
    running = pvid_fingerprint_bytes(running, model->c_column, model->n_c);
    return (model->scaled != NULL) ? scaled_theta(running, model) : plain_theta(running, model);
}

static uint32_t terms_of(uint32_t hash, const pvid_weak_term_q31 term[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        const uint8_t fields[] = {term[i].channel, term[i].order, term[i].column};
        running = pvid_fingerprint_bytes(running, fields, sizeof fields);
    }
    return running;
}

/* One past the last term. */
static size_t terms_end(const pvid_weak_model_q31 *model)
{
    return model->kind[model->kinds - 1u].end;
}

uint32_t pvid_fingerprint_weak_model_q31(const pvid_weak_model_q31 *model)
{
    const uint8_t sizes[] = {model->samples, model->signals,    model->jets,     model->runs, model->signs,
                             model->gains,   model->integrands, model->channels, model->kinds};
    uint32_t hash = pvid_fingerprint_bytes(PVID_FNV_START, sizes, sizeof sizes);
    hash = pvid_fingerprint_signals(hash, model->signal, model->signals);
    hash = pvid_fingerprint_jets(hash, model->jet, model->jets);
    hash = pvid_fingerprint_channels(hash, model->channel, model->channels);
    hash = terms_of(hash, model->term, terms_end(model));
    hash = pvid_fingerprint_kinds(hash, model->kind, model->kinds);
    hash = signal_functions(hash, model, INT32_C(0x04000000));
    hash = signal_functions(hash, model, INT32_C(0x00040000));
    return parameters_of(hash, model->model);
}

/* ---- the tables of a design ---- */

static uint32_t rescale_of(uint32_t hash, const pvid_rescale_q31 *one)
{
    const uint8_t shifts[] = {one->down, one->shift};
    return pvid_fingerprint_words(pvid_fingerprint_bytes(hash, shifts, sizeof shifts), &one->multiplier, 1);
}

static uint32_t scaled_of(uint32_t hash, const pvid_scaled_q31 values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fingerprint_words(running, &values[i].m, 1);
        running = pvid_fingerprint_words(running, &values[i].e, 1);
    }
    return running;
}

static uint32_t filters_of(uint32_t hash, const pvid_weak_filter_q31 filter[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        const pvid_weak_filter_q31 *one = &filter[i];
        running = pvid_fnv_word(running, one->half);
        running = pvid_fnv_word(running, one->down);
        running = pvid_fingerprint_table(running, one->weights, (one->weights != NULL) ? ((size_t)one->half + 1u) : 0u);
    }
    return running;
}

static uint32_t formats_of(uint32_t hash, const pvid_weak_design_q31 *design)
{
    uint32_t running = hash;
    for (size_t i = 0; i < design->model->integrands; i++) {
        const uint8_t fields[] = {design->integral[i].down, design->integral[i].twice};
        running = pvid_fingerprint_bytes(running, fields, sizeof fields);
    }
    for (size_t i = 0; i < design->model->channels; i++) {
        const pvid_weak_format_q31 *one = &design->format[i];
        const uint8_t fields[] = {one->value, one->lift, one->own, one->plain, one->ramp};
        running = pvid_fingerprint_bytes(running, fields, sizeof fields);
    }
    return running;
}

static uint32_t noise_of(uint32_t hash, const pvid_weak_noise_q31 noise[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        const uint8_t fields[] = {noise[i].kind, noise[i].power, noise[i].a, noise[i].b};
        running = pvid_fingerprint_bytes(running, fields, sizeof fields);
        running = scaled_of(running, &noise[i].factor, 1);
    }
    return running;
}

uint32_t pvid_fingerprint_weak_design_q31(const pvid_weak_design_q31 *design)
{
    const pvid_weak_model_q31 *model = design->model;
    const uint8_t sizes[] = {design->functions, design->power, design->decimation, design->sum_shift};
    uint32_t hash = pvid_fingerprint_bytes(PVID_FNV_START, sizes, sizeof sizes);
    hash = pvid_fnv_word(hash, design->hop);
    hash = pvid_fingerprint_words(hash, design->full_scale, model->samples);
    hash = pvid_fingerprint_bytes(hash, design->down, model->signals);
    hash = filters_of(hash, design->filter, model->jets);
    for (size_t i = 0; i < model->runs; i++) {
        hash = rescale_of(hash, &design->run[i]);
    }
    hash = pvid_fingerprint_words(hash, design->sign_width, model->signs);
    hash = formats_of(hash, design);
    const size_t highest = ((size_t)design->functions / 2u) + (design->power / 2u);
    const size_t entries = ((7u * (size_t)design->hop) / 2u) + (3u * highest);
    hash = pvid_fingerprint_table(hash, design->circle, entries);
    hash = pvid_fnv_word(hash, design->fine ? 1u : 0u);
    hash = scaled_of(hash, design->factor, terms_end(model));
    hash = pvid_fnv_word(hash, design->n_noise);
    hash = noise_of(hash, design->noise, design->n_noise);
    hash = pvid_fingerprint_bytes(hash, design->error_order, model->kinds);
    return scaled_of(hash, design->error_variance, model->kinds);
}

/* ---- the configuration ---- */

uint32_t pvid_fingerprint_weak_q31(const pvid_weak_config_q31 *config)
{
    const pvid_weak_model_q31 *model = config->design->model;
    const bool driven = config->drive_min != NULL;
    uint32_t hash = pvid_fingerprint_words(PVID_FNV_START, config->offset, model->samples);
    hash = pvid_fnv_word(hash, driven ? 1u : 0u);
    hash = pvid_fingerprint_words(hash, config->drive_min, driven ? model->samples : 0u);
    hash = pvid_fnv_word(hash, config->compensation ? 1u : 0u);
    hash = pvid_fnv_word(hash, config->iterations);
    hash = pvid_fingerprint_estimator_q31(hash, &config->estimator, model->model->n_theta, model->model->n_p);
    hash = pvid_fingerprint_trust_q31(hash, &config->trust, model->model->n_p);
    return pvid_fingerprint_gate_q31(hash, &config->gate);
}
