#include "number/uncontracted.h"

#include "pvid/estimator.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "solve/estimator_f32.h"
#include "number/finite_f32.h"
#include "solve/pattern_f32.h"
#include "pvid/kapitza.h"
#include "number/unroll.h"

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

static bool model_is_valid(const pvid_model_f32 *model)
{
    return (model != NULL) && (model->theta != NULL) && (model->jacobian != NULL) && (model->c_row != NULL) &&
           (model->c_column != NULL) && (model->n_theta >= 1u) && (model->n_theta <= PVID_MAX_THETA) &&
           (model->n_p >= 1u) && (model->n_p <= PVID_MAX_P) && (model->n_p <= model->n_theta) &&
           (model->n_gated <= model->n_p) && (model->n_c >= 1u) && (model->n_c <= PVID_MAX_THETA * PVID_MAX_P) &&
           (model->n_moments >= 1u) && (model->n_moments <= PVID_MAX_MOMENTS) &&
           ((model->accumulate == NULL) == (model->project == NULL)) &&
           ((model->innovate == NULL) == (model->project == NULL)) &&
           ((model->absorb == NULL) || (model->project != NULL)) &&
           ((model->accumulate != NULL) ||
            (model->n_moments == ((uint16_t)model->n_theta * (model->n_theta + 1u)) / 2u));
}

static pvid_status parameters_are_valid(const pvid_estimator_config_f32 *config)
{
    for (size_t i = 0; i < config->model->n_p; i++) {
        const float lower = config->lower[i];
        const float upper = config->upper[i];
        if (!pvid_finite_f32(lower) || !pvid_finite_f32(upper) || !(lower < upper) ||
            (pvid_is_positive_f32(config->model, i) && !(lower > 0.0f))) {
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

static pvid_status config_is_valid(const pvid_estimator_config_f32 *config)
{
    if (!model_is_valid(config->model)) {
        return PVID_BAD_MODEL;
    }
    const pvid_status parameters = parameters_are_valid(config);
    if (parameters != PVID_OK) {
        return parameters;
    }
    if (!pvid_within_f32(config->row_sd, 1.0e-12f, 1.0e12f)) {
        return PVID_BAD_ROW_SD;
    }
    if (!pvid_within_f32(config->update_rate_hz, 1.0e-6f, 1.0e6f)) {
        return PVID_BAD_UPDATE_RATE;
    }
    const float groups = config->forgetting_s * config->update_rate_hz;
    if (!pvid_within_f32(config->forgetting_s, 0.0f, 1.0e12f) || ((config->forgetting_s > 0.0f) && (groups < 4.0f))) {
        return PVID_BAD_FORGETTING;
    }
    if (!pvid_within_f32(config->feedback_hz, 0.0f, 1.0e12f)) {
        return PVID_BAD_FEEDBACK;
    }
    if (!pvid_within_f32(config->correlation, 1.0f, 1.0e6f)) {
        return PVID_BAD_CORRELATION;
    }
    if (!pvid_within_f32(config->row_weight, 1.0e-6f, 1.0f) ||
        (!pvid_is_relative_f32(config->model) && (config->row_weight < 1.0f))) {
        return PVID_BAD_ROW_WEIGHT;
    }
    if (!pvid_within_f32(config->step_limit, 1.0e-6f, 0.9f)) {
        return PVID_BAD_STEP_LIMIT;
    }
    if (!pvid_within_f32(config->kappa_min, 0.0f, 0.999f)) {
        return PVID_BAD_KAPPA_MIN;
    }
    if (!pvid_within_f32(config->noise_margin, 0.0f, 1.0e6f)) {
        return PVID_BAD_NOISE_MARGIN;
    }
    if (!pvid_within_f32(config->dead_zone, 0.0f, 100.0f)) {
        return PVID_BAD_DEAD_ZONE;
    }
    if ((config->law != PVID_LAW_STATIONARY) && (config->law != PVID_LAW_PSEUDOVELOCITY)) {
        return PVID_BAD_LAW;
    }
    return (config->divider >= 1u) ? PVID_OK : PVID_BAD_DIVIDER;
}

static float feedback_gain(const pvid_estimator_config_f32 *config)
{
    if (config->law == PVID_LAW_PSEUDOVELOCITY) {
        return 0.0f;
    }
    const float gain = (config->feedback_hz * (float)config->divider) / config->update_rate_hz;
    return ((config->feedback_hz > 0.0f) && (gain < 1.0f)) ? gain : 1.0f;
}

static pvid_status prepare(pvid_estimator_f32 *self, const pvid_estimator_config_f32 *config)
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
        self->prior[i] = ratio * ratio;
        self->start_sd[i] = config->start_sd[i];
        self->lower[i] = config->lower[i];
        self->upper[i] = config->upper[i];
    }
    config->model->theta(self->p, self->theta);
    self->row_variance = config->row_sd * config->row_sd;
    self->gain = feedback_gain(config);
    self->correlation = config->correlation;
    self->step_limit = config->step_limit;
    self->kappa_min = config->kappa_min;
    self->noise_margin = config->noise_margin;
    self->dead_zone = config->dead_zone * config->dead_zone;
    self->divider = config->divider;
    return PVID_OK;
}

pvid_status pvid_estimator_init_f32(pvid_estimator_f32 *self, const pvid_estimator_config_f32 *config)
{
    const bool given = (self != NULL) && (config != NULL);
    PVID_ASSERT(given);
    const pvid_status status = given ? prepare(self, config) : PVID_BAD_POINTER;
    if ((status != PVID_OK) && (self != NULL)) {
        memset(self, 0, sizeof *self); /* not ready */
    }
    return status;
}

/* ---- rows ---- */

static inline float sum_of_squares(size_t n_theta, const float n[], float y)
{
    float squares = y * y;
    for (size_t i = 0; i < n_theta; i++) {
        squares += n[i] * n[i];
    }
    return squares;
}

/* The same for the strong form's 11 entries, at every tick. */
static inline float sum_of_squares_strong(const float n[], float y)
{
    float squares = y * y;
    PVID_UNROLL
    for (size_t i = 0; i < PVID_KAPITZA_STRONG_THETA; i++) {
        squares += n[i] * n[i];
    }
    return squares;
}

/* Counts a row that is refused. The sum of squares of a row is within its limit only if every entry is a number of
 * reasonable size: one comparison for all of them. Which it was that broke the rule is asked only afterwards. */
static inline pvid_reason accept_row(pvid_estimator_f32 *self, const float n[], float y)
{
    const size_t n_theta = self->model->n_theta;
    const float squares =
        (n_theta == (size_t)PVID_KAPITZA_STRONG_THETA) ? sum_of_squares_strong(n, y) : sum_of_squares(n_theta, n, y);
    if (squares <= (PVID_ROW_LIMIT * PVID_ROW_LIMIT)) {
        return PVID_ACCUMULATED;
    }
    bool finite = pvid_finite_f32(y);
    for (size_t i = 0; i < n_theta; i++) {
        finite = finite && pvid_finite_f32(n[i]);
    }
    pvid_count_up(finite ? &self->counters.rejected_saturated : &self->counters.rejected_not_finite);
    return finite ? PVID_REJECTED_SATURATED : PVID_REJECTED_NOT_FINITE;
}

/* e = y - N^T theta and, while g < 1, gradient = C^T N, by theta and the pattern of C. */
static inline float innovate(const pvid_estimator_f32 *self, const float n[], float y, float gradient[])
{
    const pvid_model_f32 *model = self->model;
    if (self->gain < 1.0f) {
        float c[PVID_MAX_THETA * PVID_MAX_P];
        model->jacobian(self->p, c);
        pvid_pattern_transpose_times_f32(model, c, n, gradient);
    }
    float e = y;
    for (size_t i = 0; i < model->n_theta; i++) {
        e -= n[i] * self->theta[i];
    }
    return e;
}

/* innovation += C^T N e */
static inline void accumulate_innovation(pvid_estimator_f32 *self, const float gradient[], float e)
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        self->innovation[a] += gradient[a] * e;
    }
}

/* Takes a row of a model without functions of its own in. */
static inline pvid_reason add_relative_row(pvid_estimator_f32 *self, const float n[], float y)
{
    const pvid_reason reason = accept_row(self, n, y);
    if (reason != PVID_ACCUMULATED) {
        return reason;
    }
    float gradient[PVID_MAX_P];
    const float e = innovate(self, n, y, gradient);
    if (!((e * e) <= (PVID_ROW_LIMIT * PVID_ROW_LIMIT))) {
        pvid_count_up(&self->counters.rejected_saturated);
        return PVID_REJECTED_SATURATED;
    }
    if (self->gain < 1.0f) {
        accumulate_innovation(self, gradient, e);
    }
    self->energy += e * e;
    self->group_weight += self->information.row_weight;
    pvid_information_add_f32(&self->information, self->model, n, e, NULL);
    pvid_count_up(&self->counters.rows);
    return PVID_ACCUMULATED;
}

/* What comes before a row of a model with functions of its own is added to the sums. */
static inline pvid_reason begin_row(pvid_estimator_f32 *self, const float n[], float y, float e, const float gradient[])
{
    const pvid_reason reason = accept_row(self, n, y);
    if (reason != PVID_ACCUMULATED) {
        return reason;
    }
    if (self->gain < 1.0f) {
        accumulate_innovation(self, gradient, e);
    }
    pvid_count_up(&self->counters.rows);
    return PVID_ACCUMULATED;
}

/* innovate's answers for begin_row, which listens to them only while g < 1. */
static inline float innovation_if_needed(const pvid_estimator_f32 *self, const float n[], float y, float gradient[])
{
    return (self->gain < 1.0f) ? self->model->innovate(self->p, n, y, gradient) : 0.0f;
}

pvid_reason pvid_estimator_add_f32(pvid_estimator_f32 *self, const float n[], float y)
{
    if (!pvid_estimator_is_ready_f32(self)) {
        return PVID_NOT_READY;
    }
    if (pvid_is_relative_f32(self->model)) {
        return add_relative_row(self, n, y);
    }
    float gradient[PVID_MAX_P] = {0};
    const float e = innovation_if_needed(self, n, y, gradient);
    const pvid_reason reason = begin_row(self, n, y, e, gradient);
    if (reason == PVID_ACCUMULATED) {
        float sums[PVID_MAX_SUMS];
        pvid_information_add_f32(&self->information, self->model, n, y, sums);
    }
    return reason;
}

/* ---- the solve ---- */

/* Counts why p stays where it is. */
static pvid_reason count_reason(uint32_t *counter, pvid_reason reason)
{
    pvid_count_up(counter);
    return reason;
}

/* Adds the prior and turns F into the right-hand side, for parameter a; `gain` is g of estimator.h. */
static inline void complete_system(pvid_estimator_f32 *self, size_t a, float gain, float s[][PVID_MAX_P], float rhs[])
{
    s[a][a] += self->prior[a];
    rhs[a] = (gain * rhs[a]) + ((1.0f - gain) * self->innovation[a]);
    self->innovation[a] = 0.0f;
}

/* For a model that projects its sums by itself. */
static bool sums_in_dead_zone(const pvid_estimator_f32 *self, const pvid_cholesky_f32 *factor)
{
    float sums[PVID_MAX_SUMS];
    float s[PVID_MAX_P][PVID_MAX_P];
    float force[PVID_MAX_P];
    pvid_information_read_f32(&self->information, sums);
    const float energy = self->model->project(self->p, sums, &sums[self->model->n_moments], s, force);
    return pvid_estimator_is_in_dead_zone_f32(self, factor, force, pvid_estimator_variance_f32(self, sums, energy));
}

/* One step of p from S and F, for a model that projects its sums by itself. */
static pvid_reason dense_step(pvid_estimator_f32 *self, float gain, float s[][PVID_MAX_P], float rhs[])
{
    const uint8_t n_p = self->model->n_p;
    float dp[PVID_MAX_P];
    pvid_cholesky_f32 factor;
    for (size_t a = 0; a < n_p; a++) {
        complete_system(self, a, gain, s, rhs);
    }
    if (!pvid_cholesky_factor_f32(&factor, n_p, (const float (*)[PVID_MAX_P])s)) {
        return count_reason(&self->counters.held_pivot, PVID_HELD_PIVOT);
    }
    if (!pvid_estimator_is_excited_f32(self, factor.first_pivot, s[0][0])) {
        return count_reason(&self->counters.held_not_excited, PVID_HELD_NOT_EXCITED);
    }
    if ((self->dead_zone > 0.0f) && sums_in_dead_zone(self, &factor)) {
        return count_reason(&self->counters.at_rest, PVID_UPDATED);
    }
    pvid_cholesky_solve_f32(&factor, rhs, dp);
    const float size = pvid_estimator_step_size_f32(self, dp);
    if (!pvid_finite_f32(size)) {
        return count_reason(&self->counters.held_pivot, PVID_HELD_PIVOT);
    }
    pvid_estimator_apply_step_f32(self, dp, size, self->p);
    pvid_count_up(&self->counters.updates);
    return PVID_UPDATED;
}

static inline float step_size_three(const pvid_estimator_f32 *self, const float dp[])
{
    const uint32_t first = pvid_estimator_relative_step_f32(self, 0, dp[0]);
    const uint32_t second = pvid_estimator_relative_step_f32(self, 1, dp[1]);
    const uint32_t third = pvid_estimator_relative_step_f32(self, 2, dp[2]);
    const uint32_t larger = (second > first) ? second : first;
    return pvid_from_bits_f32((third > larger) ? third : larger);
}

static inline void apply_step_three(pvid_estimator_f32 *self, const float dp[], float size)
{
    const float part = pvid_estimator_step_factor_f32(self, size);
    bool bounded = false;
    self->p[0] = pvid_estimator_bounded_f32(self, 0, part * dp[0], &bounded);
    self->p[1] = pvid_estimator_bounded_f32(self, 1, part * dp[1], &bounded);
    self->p[2] = pvid_estimator_bounded_f32(self, 2, part * dp[2], &bounded);
    if (bounded) {
        pvid_count_up(&self->counters.bounded);
    }
}

/* dense_step for three parameters, the paper's number, and no dead zone: the same, written out, so that S, its factor
 * and dp stay in registers. */
static pvid_reason dense_step_three(pvid_estimator_f32 *self, float gain, float s[][PVID_MAX_P], float rhs[])
{
    float dp[PVID_MAX_P];
    pvid_cholesky_f32 factor;
    complete_system(self, 0, gain, s, rhs);
    complete_system(self, 1, gain, s, rhs);
    complete_system(self, 2, gain, s, rhs);
    if (!pvid_cholesky_factor_three_f32(&factor, (const float (*)[PVID_MAX_P])s)) {
        return count_reason(&self->counters.held_pivot, PVID_HELD_PIVOT);
    }
    if (!pvid_estimator_is_excited_f32(self, factor.first_pivot, s[0][0])) {
        return count_reason(&self->counters.held_not_excited, PVID_HELD_NOT_EXCITED);
    }
    pvid_cholesky_solve_three_f32(&factor, rhs, dp);
    const float size = step_size_three(self, dp);
    if (!pvid_finite_f32(size)) {
        return count_reason(&self->counters.held_pivot, PVID_HELD_PIVOT);
    }
    apply_step_three(self, dp, size);
    pvid_count_up(&self->counters.updates);
    return PVID_UPDATED;
}

static inline pvid_reason step_of(pvid_estimator_f32 *self, float gain, float s[][PVID_MAX_P], float rhs[])
{
    const bool plain = (self->model->n_p == 3u) && !(self->dead_zone > 0.0f);
    return plain ? dense_step_three(self, gain, s, rhs) : dense_step(self, gain, s, rhs);
}

static pvid_reason solve_at_once(pvid_estimator_f32 *self, float gain, const float sums[])
{
    float s[PVID_MAX_P][PVID_MAX_P];
    float rhs[PVID_MAX_P];
    (void)self->model->project(self->p, sums, &sums[self->model->n_moments], s, rhs);
    return step_of(self, gain, s, rhs);
}

pvid_reason pvid_estimator_solve_sums_f32(pvid_estimator_f32 *self, bool ends_group)
{
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&self->information, sums);
    if (!ends_group) {
        return (self->gain < 1.0f) ? PVID_ACCUMULATED : solve_at_once(self, 1.0f, sums);
    }
    const pvid_reason reason =
        pvid_estimator_is_due_f32(self) ? solve_at_once(self, self->gain, sums) : PVID_ACCUMULATED;
    pvid_information_end_group_f32(&self->information);
    return reason;
}

/* Adds a row to the sums and solves with them. */
static inline pvid_reason add_and_solve(pvid_estimator_f32 *self, const float n[], float y)
{
    pvid_information_f32 *information = &self->information;
    if (self->model->absorb == NULL) {
        float sums[PVID_MAX_SUMS];
        pvid_information_add_f32(information, self->model, n, y, sums);
        return solve_at_once(self, self->gain, sums);
    }
    float s[PVID_MAX_P][PVID_MAX_P];
    float rhs[PVID_MAX_P];
    self->model->absorb(self->p, n, y, information->high, information->low, s, rhs);
    return step_of(self, self->gain, s, rhs);
}

/* As pvid_estimator_add_f32 and the end of a group, without reading the sums back in between. */
pvid_reason pvid_estimator_step_innovation_f32(pvid_estimator_f32 *self, const float n[], float y, float e,
                                               const float gradient[])
{
    pvid_reason reason = begin_row(self, n, y, e, gradient);
    if (reason != PVID_ACCUMULATED) {
        return reason;
    }
    if (pvid_estimator_is_due_f32(self)) {
        reason = add_and_solve(self, n, y);
    } else {
        float sums[PVID_MAX_SUMS];
        pvid_information_add_f32(&self->information, self->model, n, y, sums);
    }
    pvid_information_end_group_f32(&self->information);
    return reason;
}

pvid_reason pvid_estimator_step_f32(pvid_estimator_f32 *self, const float n[], float y)
{
    if (!pvid_estimator_is_ready_f32(self)) {
        return PVID_NOT_READY;
    }
    if (!pvid_is_relative_f32(self->model)) {
        float gradient[PVID_MAX_P] = {0};
        const float e = innovation_if_needed(self, n, y, gradient);
        return pvid_estimator_step_innovation_f32(self, n, y, e, gradient);
    }
    const pvid_reason added = add_relative_row(self, n, y);
    return (added == PVID_ACCUMULATED) ? pvid_estimator_update_f32(self) : added;
}

void pvid_estimator_place_f32(pvid_estimator_f32 *self, const float p[])
{
    if (!pvid_estimator_is_ready_f32(self)) {
        return;
    }
    for (size_t a = 0; a < self->model->n_p; a++) {
        if (pvid_finite_f32(p[a])) {
            const float x = (p[a] < self->lower[a]) ? self->lower[a] : p[a];
            self->p[a] = (x > self->upper[a]) ? self->upper[a] : x;
        }
    }
    self->model->theta(self->p, self->theta);
}
