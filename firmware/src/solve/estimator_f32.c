#include "number/uncontracted.h"

#include "pvid/estimator.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "number/count.h"
#include "number/init.h"
#include "number/finite_f32.h"
#include "number/unroll.h"
#include "solve/constraints_f32.h"
#include "solve/information_f32.h"
#include "solve/kinds.h"
#include "solve/pattern_f32.h"
#include "solve/row_f32.h"
#include "solve/settings_f32.h"
#include "solve/state_f32.h"
#include "solve/staged_f32.h"

const pvid_estimator_config_f32 pvid_estimator_defaults_f32 = {
    .correlation = 1.0f,
    .row_weight = 1.0f,
    .step_limit = 0.3f,
    .kappa_min = 1.0e-5f,
    .noise_margin = 16.0f,
    .law = PVID_LAW_STATIONARY,
    .divider = 1,
};

/* ---- configuration ---- */

static bool constraints_are_valid(const pvid_model_f32 *model)
{
#if PVID_MAX_CONSTRAINTS > 0
    const uint32_t count = model->n_constraints;
    return (count <= PVID_MAX_CONSTRAINTS) && (count < model->n_p) && ((count == 0u) || (model->constraints != NULL)) &&
           (model->n_p <= (model->n_theta + count));
#else
    return model->n_p <= model->n_theta;
#endif
}

/* p on the constraints. Returns whether there is such a p near it. */
static bool return_to_constraints(const pvid_estimator_f32 *self, float p[])
{
#if PVID_MAX_CONSTRAINTS > 0
    return (self->model->n_constraints == 0u) ||
           pvid_constraints_return_f32(self->model, &self->settings, p, PVID_RETURNS_AT_INIT);
#else
    (void)self;
    (void)p;
    return true;
#endif
}

static bool drifts_are_valid(const pvid_estimator_config_f32 *config)
{
#if PVID_MAX_DRIFTS > 0
    const pvid_model_f32 *model = config->model;
    return (model->n_drifts == 0u) || ((model->n_drifts <= PVID_MAX_DRIFTS) && (model->drifts != NULL) &&
                                       pvid_within_f32(model->drift_s * config->update_rate_hz, 4.0f, 1.0e12f));
#else
    (void)config;
    return true;
#endif
}

#if PVID_MAX_DRIFTS > 0
/* What is known of the start of parameters in no row, as if of a row. */
PVID_COLD static void anchor(pvid_estimator_f32 *self)
{
    const pvid_model_f32 *model = self->model;
    for (size_t k = 0; (model->anchor_sd != NULL) && (k < model->n_c); k++) {
        const float sd = model->anchor_sd[model->c_column[k]];
        if (sd > 0.0f) {
            pvid_block block;
            pvid_information_block_f32(model, model->c_row[k], &block);
            const size_t place = pvid_pattern_diagonal_f32(block.n, (size_t)model->c_row[k] - block.first);
            self->information.low[block.moment + place] = self->settings.row_variance / (sd * sd);
        }
    }
}
#endif

/* The share that a drift leaves. */
PVID_COLD static void prepare_drifts(pvid_estimator_f32 *self, const pvid_estimator_config_f32 *config)
{
#if PVID_MAX_DRIFTS > 0
    if (config->model->n_drifts > 0u) {
        self->settings.drift_keep = pvid_settings_decay_f32(1.0f / (config->model->drift_s * config->update_rate_hz));
        anchor(self);
    }
#else
    (void)self;
    (void)config;
#endif
}

static bool model_is_valid(const pvid_model_f32 *model)
{
    if ((PVID_CHECK_TABLES == 0) && (model != NULL)) {
        return true;
    }
    return (model != NULL) && (model->theta != NULL) && (model->jacobian != NULL) && (model->c_row != NULL) &&
           (model->c_column != NULL) && (model->n_theta >= 1u) && (model->n_theta <= PVID_MAX_THETA) &&
           (model->n_p >= 1u) && (model->n_p <= PVID_MAX_P) && ((PVID_EXACT == 0) || (model->n_p == PVID_MAX_P)) &&
           constraints_are_valid(model) && (model->n_c >= 1u) && (model->n_c <= PVID_MAX_C) &&
           (model->n_moments >= 1u) && (model->n_moments <= PVID_MAX_MOMENTS) &&
           (model->n_moments == pvid_kinds_moments(model->n_theta, model->n_kinds, model->kind_end));
}

static pvid_status config_is_valid(const pvid_estimator_config_f32 *config)
{
    const pvid_model_f32 *model = config->model;
    if (!model_is_valid(model)) {
        return PVID_BAD_MODEL;
    }
    if (!drifts_are_valid(config)) {
        return PVID_BAD_MODEL;
    }
    const pvid_status status = pvid_settings_are_valid_f32(config, model->n_p, model->positive, config->update_rate_hz);
    if (status != PVID_OK) {
        return status;
    }
#if PVID_MAX_CONSTRAINTS > 0
    /* law (5) leaves F where it is: there is no force that a constraint could take */
    if ((model->n_constraints > 0u) && (pvid_settings_gain_f32(config, config->update_rate_hz, 1.0f) < 1.0f)) {
        return (config->law == PVID_LAW_STATIONARY) ? PVID_BAD_FEEDBACK : PVID_BAD_LAW;
    }
#endif
    return pvid_within_f32(config->row_weight, 1.0e-6f, 1.0f) ? PVID_OK : PVID_BAD_ROW_WEIGHT;
}

PVID_COLD static pvid_status prepare(pvid_estimator_f32 *self, const pvid_estimator_config_f32 *config)
{
    const pvid_status status = config_is_valid(config);
    if (status != PVID_OK) {
        return status;
    }
    memset(self, 0, sizeof *self);
    self->model = config->model;
    pvid_information_init_f32(&self->information, config->model, config->forgetting_s * config->update_rate_hz);
    self->information.row_weight = config->row_weight;
    for (size_t i = 0; i < config->model->n_p; i++) {
        const float ratio = config->row_sd / config->start_sd[i];
        self->p[i] = config->start[i];
        self->settings.prior[i] = ratio * ratio;
        self->settings.start_sd[i] = config->start_sd[i];
        self->settings.lower[i] = config->lower[i];
        self->settings.upper[i] = config->upper[i];
    }
    self->settings.row_variance = config->row_sd * config->row_sd;
    self->settings.gain = pvid_settings_gain_f32(config, config->update_rate_hz, (float)config->divider);
    self->settings.correlation = config->correlation;
    self->settings.step_limit = config->step_limit;
    self->settings.kappa_min = config->kappa_min;
    self->settings.noise_margin = config->noise_margin;
    self->settings.dead_zone = config->dead_zone * config->dead_zone;
    self->settings.n_p = config->model->n_p;
    self->settings.positive = (pvid_p_bits)(config->model->positive & PVID_P_ALL);
    self->divider = config->divider;
    prepare_drifts(self, config);
    if (!return_to_constraints(self, self->p)) {
        return PVID_BAD_START;
    }
    config->model->theta(self->p, self->theta);
    return PVID_OK;
}

pvid_status pvid_estimator_init_layout_f32(pvid_estimator_f32 *self, const pvid_estimator_config_f32 *config,
                                           uint32_t layout)
{
    if (layout != PVID_LAYOUT) {
        return PVID_BAD_LAYOUT;
    }
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

void pvid_estimator_place_f32(pvid_estimator_f32 *self, const float p[])
{
    if (!pvid_estimator_is_ready_f32(self)) {
        return;
    }
#if PVID_MAX_CONSTRAINTS > 0
    float before[PVID_MAX_P];
    memcpy(before, self->p, sizeof before);
#endif
    for (size_t a = 0; a < self->model->n_p; a++) {
        if (pvid_finite_f32(p[a])) {
            const float x = (p[a] < self->settings.lower[a]) ? self->settings.lower[a] : p[a];
            self->p[a] = (x > self->settings.upper[a]) ? self->settings.upper[a] : x;
        }
    }
#if PVID_MAX_CONSTRAINTS > 0
    if (!return_to_constraints(self, self->p)) {
        memcpy(self->p, before, sizeof before);
    }
#endif
    self->model->theta(self->p, self->theta);
}

PVID_COLD void pvid_estimator_clear_f32(pvid_estimator_f32 *self)
{
    pvid_information_fade_f32(&self->information, 0.0f);
#if PVID_MAX_DRIFTS > 0
    if (self->model->n_drifts > 0u) {
        anchor(self);
    }
#endif
    self->information.age = 0;
    self->group_rss = 0.0f;
    self->group_weight = 0.0f;
#if PVID_FEEDBACK
    memset(self->innovation, 0, sizeof self->innovation);
#endif
}

/* ---- rows, solves, assessments ---- */

pvid_reason pvid_estimator_add_f32(pvid_estimator_f32 *self, const float n[], float y)
{
    if (!pvid_estimator_is_ready_f32(self)) {
        return PVID_NOT_READY;
    }
    return pvid_staged_add_f32(self, 0, n, y);
}

pvid_reason pvid_estimator_add_kind_f32(pvid_estimator_f32 *self, uint8_t kind, const float n[], float y)
{
    if (!pvid_estimator_is_ready_f32(self)) {
        return PVID_NOT_READY;
    }
    const bool exists = kind < pvid_kinds_count(self->model->n_kinds);
    PVID_ASSERT(exists);
    if (!exists) {
        return PVID_NOT_READY;
    }
    return pvid_staged_add_f32(self, kind, n, y);
}

PVID_COLD pvid_reason pvid_estimator_add_to_b_f32(pvid_estimator_f32 *self, const float g[])
{
    if (!pvid_estimator_is_ready_f32(self)) {
        return PVID_NOT_READY;
    }
    const pvid_model_f32 *model = self->model;
    uint32_t largest = 0; /* bits are ordered like absolute values, infinity and NaN last */
    for (size_t i = 0; i < model->n_theta; i++) {
        const uint32_t size = pvid_bits_f32(g[i]) & 0x7FFFFFFFu;
        largest = (size > largest) ? size : largest;
    }
    if (largest > pvid_bits_f32(PVID_ROW_LIMIT * PVID_ROW_LIMIT)) {
        const bool finite = largest < 0x7F800000u;
        pvid_count_up(finite ? &self->counters.rejected_saturated : &self->counters.rejected_not_finite);
        return finite ? PVID_REJECTED_SATURATED : PVID_REJECTED_NOT_FINITE;
    }
    float *b = &self->information.low[model->n_moments];
    for (size_t i = 0; i < model->n_theta; i++) {
        b[i] += g[i];
    }
    if (pvid_feeds_back_f32(self)) {
        float c[PVID_MAX_C];
        float gradient[PVID_MAX_P];
        const pvid_block whole = {0, model->n_theta, 0};
        model->jacobian(self->p, c);
        pvid_pattern_transpose_times_f32(model, c, &whole, g, gradient);
        pvid_row_accumulate_innovation_f32(self, model->n_p, gradient, 1.0f);
    }
    return PVID_ACCUMULATED;
}

/* All stages of a solve. */
static pvid_reason solve_in_stages(pvid_estimator_f32 *self, bool ends_group)
{
    if (!pvid_estimator_is_ready_f32(self)) {
        return PVID_NOT_READY;
    }
    pvid_estimator_solve_f32 solve;
    pvid_estimator_begin_f32(self, &solve, ends_group);
    bool done = false;
    for (uint16_t left = pvid_estimator_stages_f32(self, ends_group); (left > 0u) && !done; left--) {
        done = pvid_estimator_advance_f32(self, &solve);
    }
    return solve.reason;
}

pvid_reason pvid_estimator_update_f32(pvid_estimator_f32 *self)
{
    return solve_in_stages(self, true);
}

pvid_reason pvid_estimator_iterate_f32(pvid_estimator_f32 *self)
{
    return solve_in_stages(self, false);
}

pvid_reason pvid_estimator_step_f32(pvid_estimator_f32 *self, const float n[], float y)
{
    if (!pvid_estimator_is_ready_f32(self)) {
        return PVID_NOT_READY;
    }
    const pvid_reason added = pvid_staged_add_f32(self, 0, n, y);
    return (added == PVID_ACCUMULATED) ? pvid_estimator_update_f32(self) : added;
}

static void assess_in_stages(const pvid_estimator_f32 *self, pvid_estimate_f32 *estimate)
{
    pvid_estimator_solve_f32 solve;
    pvid_estimator_begin_assessment_f32(self, &solve, estimate);
    bool done = false;
    for (uint16_t left = pvid_estimator_assessment_stages_f32(self); (left > 0u) && !done; left--) {
        done = pvid_estimator_assess_advance_f32(self, &solve);
    }
}

void pvid_estimator_assess_f32(const pvid_estimator_f32 *self, pvid_estimate_f32 *estimate)
{
    if (estimate == NULL) {
        return;
    }
    if (!pvid_estimator_is_ready_f32(self)) {
        memset(estimate, 0, sizeof *estimate);
        return;
    }
    assess_in_stages(self, estimate);
}
