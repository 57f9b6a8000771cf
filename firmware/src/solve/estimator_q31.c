#include "solve/row_q31.h"
#include "solve/system_q31.h"
#include "solve/state_q31.h"

#include <stddef.h>
#include <string.h>

#include "number/init.h"
#include "number/count.h"
#include "solve/information_q31.h"
#include "solve/scaled_model_q31.h"
#include "solve/settings_q31.h"
#include "number/integer_q31.h"
#include "number/scaled_q31.h"
#include "number/unroll.h"

#define FORMAT_MAX 64

/* ---- configuration ---- */

static bool format_is_valid(int8_t bits)
{
    return (bits >= -FORMAT_MAX) && (bits <= FORMAT_MAX);
}

static bool moments_are_valid(size_t n_moments)
{
    return (n_moments >= 1u) && (n_moments <= PVID_MAX_MOMENTS_Q31);
}

static bool functions_are_valid(const pvid_model_q31 *model)
{
    const pvid_scaled_model_q31 *scaled = model->scaled;
    return (scaled != NULL) ? ((scaled->theta != NULL) && (scaled->jacobian != NULL) && (scaled->adapter != NULL))
                            : ((model->theta != NULL) && (model->jacobian != NULL) && (model->formats != NULL));
}

static bool model_is_valid(const pvid_model_q31 *model)
{
    return !((model == NULL) || !functions_are_valid(model) || (model->c_row == NULL) || (model->c_column == NULL) ||
             (model->n_theta < 1u) || (model->n_theta > PVID_MAX_THETA_Q31) || (model->n_p < 1u) ||
             (model->n_p > PVID_MAX_P) || (model->n_p > model->n_theta) || (model->n_c < 1u) ||
             (model->n_c > PVID_MAX_C_Q31)) &&
           moments_are_valid(pvid_kinds_moments(model->n_theta, model->n_kinds, model->kind_end));
}

const pvid_estimator_config_q31 pvid_estimator_defaults_q31 = {
    .gain = PVID_ONE_Q30,
    .correlation = 65536,
    .row_weight = 65536,
    .step_limit = 19661, /* 0.3 */
    .kappa_min = 10737,  /* 1e-5 */
    .divider = 1,
};

static bool formats_are_valid(const pvid_estimator_config_q31 *config)
{
    const pvid_model_q31 *model = config->model;
    bool valid = format_is_valid(config->y_bits);
    for (size_t i = 0; i < model->n_theta; i++) {
        valid = valid && format_is_valid(config->n_bits[i]);
    }
    for (size_t i = 0; i < model->n_p; i++) {
        valid = valid && format_is_valid(config->p_bits[i]);
    }
    return valid;
}

static pvid_status config_is_valid(const pvid_estimator_config_q31 *config)
{
    if (!model_is_valid(config->model)) {
        return PVID_BAD_MODEL;
    }
    if (!formats_are_valid(config)) {
        return PVID_BAD_FORMAT;
    }
    return pvid_settings_are_valid_q31(config, config->model->n_p, config->model->positive);
}

static void init_formats(pvid_estimator_q31 *self, const pvid_estimator_config_q31 *config)
{
    const pvid_model_q31 *model = config->model;
    int16_t c_bits[PVID_MAX_C_Q31] = {0};
    if (model->scaled != NULL) {
        model->scaled->adapter->formats(self, config, self->theta_bits);
    } else {
        model->formats(config->p_bits, self->theta_bits, c_bits);
    }
    for (size_t i = 0; i < model->n_theta; i++) {
        self->align[i] = (int16_t)((self->theta_bits[i] + config->n_bits[i]) - config->y_bits);
    }
    for (size_t k = 0; k < model->n_c; k++) {
        const int32_t n_bits = config->n_bits[model->c_row[k]];
        const int32_t p_bits = config->p_bits[model->c_column[k]];
        self->c_exponent[k] = (int16_t)(((config->y_bits - n_bits) - p_bits) - c_bits[k]);
    }
}

static pvid_status prepare(pvid_estimator_q31 *self, const pvid_estimator_config_q31 *config)
{
    const pvid_status status = config_is_valid(config);
    if (status != PVID_OK) {
        return status;
    }
    memset(self, 0, sizeof *self);
    self->model = config->model;
    pvid_information_init_q31(&self->information, config->model, config->forgetting_groups, config->row_weight);
    pvid_settings_init_q31(&self->settings, config, config->model->n_p, config->model->positive);
    init_formats(self, config); /* of a model in numbers of any size they follow the settings */
    for (size_t i = 0; i < config->model->n_p; i++) {
        self->p[i] = config->start[i];
    }
    int64_t theta[PVID_MAX_THETA_Q31];
    pvid_estimator_theta_q31(self, self->p, theta);
    pvid_estimator_set_theta_q31(self, theta);
    self->divider = config->divider;
    return PVID_OK;
}

pvid_status pvid_estimator_init_layout_q31(pvid_estimator_q31 *self, const pvid_estimator_config_q31 *config,
                                           uint32_t layout)
{
    if (layout != PVID_LAYOUT) {
        return PVID_BAD_LAYOUT;
    }
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

void pvid_estimator_place_q31(pvid_estimator_q31 *self, uint8_t index, int64_t value)
{
    if (!pvid_estimator_is_ready_q31(self)) {
        return;
    }
    int64_t theta[PVID_MAX_THETA_Q31];
    const int64_t above = (value < self->settings.lower[index]) ? self->settings.lower[index] : value;
    self->p[index] = (int32_t)((above > self->settings.upper[index]) ? self->settings.upper[index] : above);
    pvid_estimator_theta_q31(self, self->p, theta);
    pvid_estimator_set_theta_q31(self, theta);
}

PVID_COLD void pvid_estimator_clear_q31(pvid_estimator_q31 *self)
{
    memset(self->information.sums, 0, sizeof self->information.sums);
    memset(self->fresh, 0, sizeof self->fresh);
    self->information.exponent = 0;
    self->information.age = 0;
    self->group_rss = 0;
    self->group_weight = 0;
}

/* ---- rows ---- */

pvid_reason pvid_estimator_add_kind_q31(pvid_estimator_q31 *self, uint8_t kind, const int32_t n[], int32_t y)
{
    if (!pvid_estimator_is_ready_q31(self)) {
        return PVID_NOT_READY;
    }
    const bool exists = kind < pvid_kinds_count(self->model->n_kinds);
    PVID_ASSERT(exists);
    if (!exists) {
        return PVID_NOT_READY;
    }
    pvid_block block;
    int64_t e;
    pvid_information_block_q31(self->model, pvid_kind_first(self->model->kind_end, kind), &block);
    if (!pvid_estimator_innovation_q31(self, &block, n, y, &e)) {
        pvid_count_up(&self->counters.rejected_saturated);
        return PVID_REJECTED_SATURATED;
    }
    pvid_estimator_add_row_q31(self, &block, n, (int32_t)e, pvid_square_q31((int32_t)e));
    return PVID_ACCUMULATED;
}

pvid_reason pvid_estimator_add_q31(pvid_estimator_q31 *self, const int32_t n[], int32_t y)
{
    return pvid_estimator_add_kind_q31(self, 0, n, y);
}

pvid_reason pvid_estimator_add_to_b_q31(pvid_estimator_q31 *self, const pvid_scaled_q31 g[])
{
    if (!pvid_estimator_is_ready_q31(self)) {
        return PVID_NOT_READY;
    }
    const size_t n = self->model->n_theta;
    int64_t *b = &self->information.sums[((size_t)self->information.n_sums - 2u) - n];
    int64_t added[PVID_MAX_THETA_Q31];
    bool fits = true;
    for (size_t i = 0; i < n; i++) {
        const int64_t exact = pvid_scaled_fixed_q31(g[i], -2 * (int32_t)self->information.exponent);
        added[i] = pvid_clamp_q31(exact, PVID_CLAMP_LIMIT);
        fits = fits && (pvid_magnitude_q31(b[i] + added[i]) <= (uint64_t)PVID_CLAMP_LIMIT) &&
               (pvid_magnitude_q31(self->fresh[i] + added[i]) <= (uint64_t)PVID_CLAMP_LIMIT);
    }
    if (!fits) {
        pvid_count_up(&self->counters.rejected_saturated);
        return PVID_REJECTED_SATURATED;
    }
    for (size_t i = 0; i < n; i++) {
        b[i] += added[i];
        self->fresh[i] += added[i];
    }
    return PVID_ACCUMULATED;
}

/* ---- a solve at once ---- */

static pvid_reason solve_at_once(pvid_estimator_q31 *self, bool ends_group)
{
    if (!pvid_estimator_is_ready_q31(self)) {
        return PVID_NOT_READY;
    }
    pvid_estimator_solve_q31 solve;
    pvid_estimator_begin_q31(self, &solve, ends_group);
    bool done = false;
    for (uint16_t left = pvid_estimator_stages_q31(self, ends_group); (left > 0u) && !done; left--) {
        done = pvid_estimator_advance_q31(self, &solve);
    }
    return solve.reason;
}

pvid_reason pvid_estimator_update_q31(pvid_estimator_q31 *self)
{
    return solve_at_once(self, true);
}

pvid_reason pvid_estimator_iterate_q31(pvid_estimator_q31 *self)
{
    return solve_at_once(self, false);
}

/* ---- an assessment at once ---- */

void pvid_estimator_assess_q31(const pvid_estimator_q31 *self, pvid_estimate_q31 *estimate)
{
    if (estimate == NULL) {
        return;
    }
    if (!pvid_estimator_is_ready_q31(self)) {
        memset(estimate, 0, sizeof *estimate);
        return;
    }
    pvid_estimator_solve_q31 solve;
    pvid_estimator_begin_assessment_q31(self, &solve);
    bool done = false;
    for (uint16_t left = pvid_estimator_assessment_stages_q31(self); (left > 0u) && !done; left--) {
        done = pvid_estimator_assess_advance_q31(self, &solve, estimate);
    }
}
