#include "keep/fingerprint_q31.h"

#include <stddef.h>

#include "pvid/fnv_word.h"

static uint32_t words(uint32_t hash, const int32_t values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, (uint32_t)values[i]);
    }
    return running;
}

static uint32_t shifts(uint32_t hash, const uint8_t values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, values[i]);
    }
    return running;
}

static uint32_t formats(uint32_t hash, const int8_t values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, (uint32_t)(int32_t)values[i]);
    }
    return running;
}

/* Tables may be in their own address space. */
static uint32_t table(uint32_t hash, const PVID_TABLE int32_t *values, size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, (uint32_t)values[i]);
    }
    return running;
}

static uint32_t short_table(uint32_t hash, const PVID_TABLE int16_t *values, size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, (uint32_t)(int32_t)values[i]);
    }
    return running;
}

static uint32_t design_of(uint32_t hash, const pvid_weak_design_q31 *design)
{
    const size_t half = (design->taps - 1u) / 2u;
    const size_t functions = design->functions;
    const int32_t limits[] = {design->phi_max, design->y_max, design->u_max};
    const uint8_t single[] = {design->lag,     design->smooth_bits, design->phi_shift,
                              design->u_shift, design->uf_shift,    design->sum_shift};
    uint32_t running = pvid_fnv_word(hash, design->taps);
    running = pvid_fnv_word(running, design->decimation);
    running = pvid_fnv_word(running, design->window);
    running = pvid_fnv_word(running, design->functions);
    running = shifts(running, single, sizeof single);
    running = shifts(running, design->integral_shift, sizeof design->integral_shift);
    running = shifts(running, design->high_shift, sizeof design->high_shift);
    running = shifts(running, design->product_shift, sizeof design->product_shift);
    running = shifts(running, design->shift, sizeof design->shift);
    running = formats(running, design->gram_bits, PVID_WEAK_GRAMS);
    running = words(running, limits, sizeof limits / sizeof limits[0]);
    running = table(running, design->smooth, half);
    running = table(running, design->second, half);
    running = short_table(running, design->chi, 3u * functions * design->window);
    running = table(running, design->multiplier, PVID_WEAK_TERMS_Q31);
    return table(running, design->gram, (PVID_WEAK_GRAMS / 2u) * functions * (functions + 1u));
}

static uint32_t estimator_of(uint32_t hash, const pvid_estimator_config_q31 *config, size_t n_theta, size_t n_p)
{
    uint32_t running = words(hash, config->start, n_p);
    running = words(running, config->start_sd, n_p);
    running = words(running, config->lower, n_p);
    running = words(running, config->upper, n_p);
    running = formats(running, config->p_bits, n_p);
    running = formats(running, config->n_bits, n_theta);
    running = formats(running, &config->y_bits, (n_theta > 0u) ? 1u : 0u);
    running = words(running, &config->row_sd, 1);
    running = pvid_fnv_word(running, config->forgetting_groups);
    running = words(running, &config->gain, 1);
    running = pvid_fnv_word(running, config->correlation);
    running = pvid_fnv_word(running, config->row_weight);
    running = pvid_fnv_word(running, config->step_limit);
    running = words(running, &config->kappa_min, 1);
    running = pvid_fnv_word(running, config->noise_margin);
    running = pvid_fnv_word(running, config->dead_zone);
    return pvid_fnv_word(running, config->divider);
}

static uint32_t trust_of(uint32_t hash, const pvid_trust_config_q31 *config)
{
    const int32_t limits[] = {config->kappa_min, config->se_max};
    uint32_t running = words(hash, limits, sizeof limits / sizeof limits[0]);
    running = pvid_fnv_word(running, config->misfit_max);
    running = pvid_fnv_word(running, config->groups_min);
    running = pvid_fnv_word(running, config->revert_after);
    return pvid_fnv_word(running, config->renewal);
}

static uint32_t gate_of(uint32_t hash, const pvid_gate_config_q31 *config)
{
    return pvid_fnv_word(pvid_fnv_word(hash, config->sigmas), config->patience_groups);
}

static uint32_t bank_of(uint32_t hash, const pvid_fir_bank_q31 *bank)
{
    const int32_t limits[] = {bank->phi_max, bank->y_max, bank->centre};
    uint32_t running = pvid_fnv_word(hash, bank->half);
    running = pvid_fnv_word(running, bank->stride);
    running = words(running, limits, sizeof limits / sizeof limits[0]);
    running = shifts(running, bank->phi_shift, sizeof bank->phi_shift);
    running = shifts(running, bank->y_shift, sizeof bank->y_shift);
    return table(running, bank->weights, (size_t)PVID_ORDERS * bank->half);
}

static uint32_t row_of(uint32_t hash, const pvid_strong_row_q31 *row)
{
    const uint32_t running = formats(hash, row->phi_shift, sizeof row->phi_shift);
    const int32_t single[] = {row->phi3, row->reference};
    return words(formats(running, row->finer, sizeof row->finer), single, sizeof single / sizeof single[0]);
}

uint32_t pvid_fingerprint_strong_q31(const pvid_strong_config_q31 *config)
{
    const int32_t scalars[] = {config->phi_offset, config->y_offset, config->drive_min};
    uint32_t hash = words(PVID_FNV_START, scalars, sizeof scalars / sizeof scalars[0]);
    hash = words(hash, config->u_multiplier, PVID_Y_ORDERS_Q31);
    hash = bank_of(hash, &config->bank);
    hash = row_of(hash, &config->row);
    hash = shifts(hash, config->u_shift, sizeof config->u_shift);
    hash = pvid_fnv_word(hash, config->drive_ticks);
    hash = gate_of(hash, &config->gate);
    return estimator_of(hash, &config->estimator, 0, PVID_KAPITZA_P);
}

uint32_t pvid_fingerprint_weak_q31(const pvid_weak_config_q31 *config)
{
    const pvid_model_q31 *model = config->zero_unknown ? &pvid_kapitza_weak_q31 : &pvid_kapitza_weak_zeroed_q31;
    const int32_t scalars[] = {config->phi_offset, config->y_offset, config->drive_min, config->pivot_noise.m,
                               config->pivot_noise.e};
    uint32_t hash = words(PVID_FNV_START, scalars, sizeof scalars / sizeof scalars[0]);
    hash = design_of(hash, config->design);
    hash = pvid_fnv_word(hash, config->zero_unknown ? 1u : 0u);
    hash = pvid_fnv_word(hash, config->iterations);
    hash = estimator_of(hash, &config->estimator, model->n_theta, model->n_p);
    hash = trust_of(hash, &config->trust);
    return gate_of(hash, &config->gate);
}
