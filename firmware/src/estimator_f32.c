#include "pvid/estimator.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "cholesky_f32.h"
#include "finite_f32.h"

const pvid_estimator_config_f32 pvid_estimator_defaults_f32 = {
    .correlation = 1.0f,
    .step_limit = 0.3f,
    .kappa_min = 1.0e-5f,
    .law = PVID_LAW_STATIONARY,
    .divider = 1,
};

/* Rounding floor of yy - 2 B^T theta + theta^T M theta, relative to yy: a few ulp of each term. */
#define RESIDUAL_FLOOR 4.8e-7f

static bool is_positive(const pvid_model_f32 *model, size_t i)
{
    return ((model->positive >> i) & 1u) != 0u;
}

static bool relative_to_estimate(const pvid_model_f32 *model)
{
    return model->project == NULL;
}

static void count(uint32_t *counter)
{
    if (*counter < UINT32_MAX) {
        (*counter)++;
    }
}

/* ---- configuration ---- */

static bool model_is_valid(const pvid_model_f32 *model)
{
    return (model != NULL) && (model->theta != NULL) && (model->jacobian != NULL) && (model->c_row != NULL) &&
           (model->c_column != NULL) && (model->n_theta >= 1u) && (model->n_theta <= PVID_MAX_THETA) &&
           (model->n_p >= 1u) && (model->n_p <= PVID_MAX_P) && (model->n_p <= model->n_theta) && (model->n_c >= 1u) &&
           (model->n_c <= PVID_MAX_THETA * PVID_MAX_P) && (model->n_moments >= 1u) &&
           (model->n_moments <= PVID_MAX_MOMENTS) && ((model->accumulate == NULL) == (model->project == NULL)) &&
           ((model->innovate == NULL) == (model->project == NULL)) &&
           ((model->accumulate != NULL) || (model->n_moments == (model->n_theta * (model->n_theta + 1)) / 2));
}

static pvid_status parameters_are_valid(const pvid_estimator_config_f32 *config)
{
    for (size_t i = 0; i < config->model->n_p; i++) {
        const float lower = config->lower[i];
        const float upper = config->upper[i];
        if (!pvid_finite_f32(lower) || !pvid_finite_f32(upper) || !(lower < upper) ||
            (is_positive(config->model, i) && !(lower > 0.0f))) {
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
    if (!pvid_within_f32(config->step_limit, 1.0e-6f, 0.9f)) {
        return PVID_BAD_STEP_LIMIT;
    }
    if (!pvid_within_f32(config->kappa_min, 0.0f, 0.999f)) {
        return PVID_BAD_KAPPA_MIN;
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

pvid_status pvid_estimator_init_f32(pvid_estimator_f32 *self, const pvid_estimator_config_f32 *config)
{
    PVID_ASSERT((self != NULL) && (config != NULL));
    const pvid_status status = config_is_valid(config);
    if (status != PVID_OK) {
        return status;
    }
    memset(self, 0, sizeof *self);
    self->model = config->model;
    pvid_information_init_f32(&self->information, config->model, config->forgetting_s * config->update_rate_hz);
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
    self->divider = config->divider;
    return PVID_OK;
}

/* ---- rows ---- */

/* The sum of squares of a row is within its limit only if every entry is a number of reasonable size:
 * one comparison for all of them. Which it was that broke the rule is asked only afterwards. */
static pvid_reason row_is_usable(size_t n_theta, const float n[], float y)
{
    float squares = y * y;
    for (size_t i = 0; i < n_theta; i++) {
        squares += n[i] * n[i];
    }
    if (squares <= (PVID_ROW_LIMIT * PVID_ROW_LIMIT)) {
        return PVID_ACCUMULATED;
    }
    bool finite = pvid_finite_f32(y);
    for (size_t i = 0; i < n_theta; i++) {
        finite = finite && pvid_finite_f32(n[i]);
    }
    return finite ? PVID_REJECTED_SATURATED : PVID_REJECTED_NOT_FINITE;
}

/* out[n_p] = C^T x for the non-zeros c of C. */
static void transpose_times(const pvid_model_f32 *model, const float c[], const float x[], float out[])
{
    for (size_t a = 0; a < model->n_p; a++) {
        out[a] = 0.0f;
    }
    for (size_t k = 0; k < model->n_c; k++) {
        out[model->c_column[k]] += c[k] * x[model->c_row[k]];
    }
}

/* e = y - N^T theta and gradient = C^T N, by the model's own function or by the pattern of C. */
static float innovate(const pvid_estimator_f32 *self, const float n[], float y, float gradient[])
{
    const pvid_model_f32 *model = self->model;
    if (model->innovate != NULL) {
        return model->innovate(self->p, n, y, gradient);
    }
    float c[PVID_MAX_THETA * PVID_MAX_P];
    model->jacobian(self->p, c);
    transpose_times(model, c, n, gradient);
    float e = y;
    for (size_t i = 0; i < model->n_theta; i++) {
        e -= n[i] * self->theta[i];
    }
    return e;
}

/* Takes one row in and writes the sums with it. */
static pvid_reason add_row(pvid_estimator_f32 *self, const float n[], float y, float sums[])
{
    const pvid_model_f32 *model = self->model;
    const pvid_reason reason = row_is_usable(model->n_theta, n, y);
    if (reason == PVID_REJECTED_NOT_FINITE) {
        count(&self->counters.rejected_not_finite);
        return reason;
    }
    if (reason == PVID_REJECTED_SATURATED) {
        count(&self->counters.rejected_saturated);
        return reason;
    }
    const bool relative = relative_to_estimate(model);
    float e = y;
    if (relative || (self->gain < 1.0f)) {
        float gradient[PVID_MAX_P];
        e = innovate(self, n, y, gradient);
        if (self->gain < 1.0f) {
            for (size_t a = 0; a < model->n_p; a++) {
                self->innovation[a] += gradient[a] * e;
            }
        }
    }
    pvid_information_add_f32(&self->information, model, n, relative ? e : y, sums);
    count(&self->counters.rows);
    return PVID_ACCUMULATED;
}

pvid_reason pvid_estimator_add_f32(pvid_estimator_f32 *self, const float n[], float y)
{
    float sums[PVID_MAX_SUMS];
    return add_row(self, n, y, sums);
}

/* ---- the solve ---- */

/* Entry (i, j) of M kept as its packed upper triangle by rows. */
static float moment_at(const float m[], size_t n, size_t i, size_t j)
{
    const size_t row = (i < j) ? i : j;
    const size_t column = (i < j) ? j : i;
    return m[((row * ((2u * n) - row - 1u)) / 2u) + column];
}

/* S = C^T M C by columns of C: t = M c_a, then S_ab = c_b^T t. */
static void project_by_pattern(const pvid_model_f32 *model, const float c[], const float m[], float s[][PVID_MAX_P])
{
    size_t first = 0; /* non-zeros of column a: first..last-1 */
    for (size_t a = 0; a < model->n_p; a++) {
        size_t last = first;
        while ((last < model->n_c) && (model->c_column[last] == a)) {
            last++;
        }
        float t[PVID_MAX_THETA];
        for (size_t i = 0; i < model->n_theta; i++) {
            float sum = 0.0f;
            for (size_t k = first; k < last; k++) {
                sum += moment_at(m, model->n_theta, i, model->c_row[k]) * c[k];
            }
            t[i] = sum;
        }
        for (size_t b = a; b < model->n_p; b++) {
            s[a][b] = 0.0f;
        }
        for (size_t k = first; k < model->n_c; k++) {
            s[a][model->c_column[k]] += c[k] * t[model->c_row[k]];
        }
        first = last;
    }
}

/* S = C^T M C and F = C^T (B - M theta) at the present p. Returns what to add to yy for the sum of
 * squared residuals. */
static inline float project(const pvid_estimator_f32 *self, const float sums[], float s[][PVID_MAX_P], float f[])
{
    const pvid_model_f32 *model = self->model;
    const float *b = &sums[model->n_moments];
    if (model->project != NULL) {
        return model->project(self->p, sums, b, s, f);
    }
    float c[PVID_MAX_THETA * PVID_MAX_P];
    model->jacobian(self->p, c);
    project_by_pattern(model, c, sums, s);
    transpose_times(model, c, b, f);
    return 0.0f;
}

/* Moves theta, b and rr to the new p: b -= M dtheta, rr -= dtheta^T (b_old + b_new). */
static void follow_estimate(pvid_estimator_f32 *self, const float sums[])
{
    const size_t n = self->model->n_theta;
    const float *b = &sums[self->model->n_moments];
    float *low = &self->information.low[self->model->n_moments];
    float theta[PVID_MAX_THETA];
    float step[PVID_MAX_THETA];
    self->model->theta(self->p, theta);
    for (size_t i = 0; i < n; i++) {
        step[i] = theta[i] - self->theta[i];
        self->theta[i] = theta[i];
    }
    float fall = 0.0f;
    for (size_t i = 0; i < n; i++) {
        float moved = 0.0f;
        for (size_t j = 0; j < n; j++) {
            moved += moment_at(sums, n, i, j) * step[j];
        }
        low[i] -= moved;
        fall += step[i] * (b[i] + (b[i] - moved));
    }
    low[n] -= fall;
}

/* How far dp goes, as a part of what each parameter is measured by: its own value where it is
 * positive, else the standard deviation of its start. Not finite if dp is not: the bits of |x| order
 * as |x| does, infinity and NaN last. */
static float relative_size(const pvid_estimator_f32 *self, const float dp[])
{
    uint32_t largest = 0;
    for (size_t a = 0; a < self->model->n_p; a++) {
        const float *reference = is_positive(self->model, a) ? self->p : self->start_sd;
        const uint32_t bits = pvid_bits_f32(dp[a] / reference[a]) & 0x7FFFFFFFu;
        largest = (bits > largest) ? bits : largest;
    }
    return pvid_from_bits_f32(largest);
}

/* p += dp, shortened to the step limit, within the bounds. */
static void take_step(pvid_estimator_f32 *self, const float dp[], float size)
{
    float factor = 1.0f;
    bool bounded = false;
    if (size > self->step_limit) {
        factor = self->step_limit / size;
        count(&self->counters.limited);
    }
    for (size_t a = 0; a < self->model->n_p; a++) {
        float x = self->p[a] + (factor * dp[a]);
        if (x > self->upper[a]) {
            x = self->upper[a];
            bounded = true;
        }
        if (x < self->lower[a]) {
            x = self->lower[a];
            bounded = true;
        }
        self->p[a] = x;
    }
    if (bounded) {
        count(&self->counters.bounded);
    }
}

/* Whether the data speak of p[0]: what of its information no other parameter can imitate is a part
 * kappa of its diagonal entry, and more than the start brought along. */
static bool is_excited(const pvid_estimator_f32 *self, float kappa, float diagonal)
{
    const bool own = (kappa * diagonal) >= (2.0f * self->prior[0]);
    return (kappa >= self->kappa_min) && (own || !(self->kappa_min > 0.0f));
}

/* One step of p from the sums; `gain` is g of estimator.h. */
static inline pvid_reason solve(pvid_estimator_f32 *self, float gain, const float sums[])
{
    float s[PVID_MAX_P][PVID_MAX_P];
    float rhs[PVID_MAX_P];
    float dp[PVID_MAX_P];
    pvid_cholesky_f32 factor;
    (void)project(self, sums, s, rhs);
    for (size_t a = 0; a < self->model->n_p; a++) {
        s[a][a] += self->prior[a];
        rhs[a] = (gain * rhs[a]) + ((1.0f - gain) * self->innovation[a]);
        self->innovation[a] = 0.0f;
    }
    if (!pvid_cholesky_factor_f32(&factor, self->model->n_p, (const float(*)[PVID_MAX_P])s)) {
        count(&self->counters.held_pivot);
        return PVID_HELD_PIVOT;
    }
    if (!is_excited(self, factor.first_pivot, s[0][0])) {
        count(&self->counters.held_not_excited);
        return PVID_HELD_NOT_EXCITED;
    }
    pvid_cholesky_solve_f32(&factor, rhs, dp);
    const float size = relative_size(self, dp);
    if (!pvid_finite_f32(size)) {
        count(&self->counters.held_pivot);
        return PVID_HELD_PIVOT;
    }
    take_step(self, dp, size);
    if (relative_to_estimate(self->model)) {
        follow_estimate(self, sums);
    }
    count(&self->counters.updates);
    return PVID_UPDATED;
}

/* Ends a group whose sums are known and solves if it is time to. */
static pvid_reason end_group(pvid_estimator_f32 *self, const float sums[])
{
    self->phase++;
    if (self->phase < self->divider) {
        return PVID_ACCUMULATED;
    }
    self->phase = 0;
    return solve(self, self->gain, sums);
}

pvid_reason pvid_estimator_step_f32(pvid_estimator_f32 *self, const float n[], float y)
{
    float sums[PVID_MAX_SUMS];
    const pvid_reason added = add_row(self, n, y, sums);
    if (added != PVID_ACCUMULATED) {
        return added;
    }
    const pvid_reason reason = end_group(self, sums);
    pvid_information_end_group_f32(&self->information);
    return reason;
}

pvid_reason pvid_estimator_update_f32(pvid_estimator_f32 *self)
{
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&self->information, sums);
    const pvid_reason reason = end_group(self, sums);
    pvid_information_end_group_f32(&self->information);
    return reason;
}

pvid_reason pvid_estimator_iterate_f32(pvid_estimator_f32 *self)
{
    if (self->gain < 1.0f) {
        return PVID_ACCUMULATED; /* the law of g < 1 is a rate, not an iteration */
    }
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&self->information, sums);
    return solve(self, 1.0f, sums);
}

/* ---- what is published ---- */

/* s^2 of a row; `energy` is what project returned. */
static float row_variance(const pvid_estimator_f32 *self, const float sums[], float energy)
{
    const pvid_model_f32 *model = self->model;
    const float *tail = &sums[model->n_moments + model->n_theta];
    const float yy = tail[0];
    const float freedom = tail[1] - (float)model->n_p;
    if (!(freedom >= 1.0f)) {
        return self->row_variance;
    }
    const float floor = relative_to_estimate(model) ? 0.0f : (RESIDUAL_FLOOR * yy);
    const float residual = yy + energy;
    return ((residual > floor) ? residual : floor) / freedom;
}

static void assess_as_start(const pvid_estimator_f32 *self, pvid_estimate_f32 *estimate)
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        for (size_t b = 0; b < self->model->n_p; b++) {
            estimate->covariance[a][b] = 0.0f;
        }
        estimate->covariance[a][a] = self->start_sd[a] * self->start_sd[a];
        estimate->se[a] = self->start_sd[a];
    }
}

void pvid_estimator_assess_f32(const pvid_estimator_f32 *self, pvid_estimate_f32 *estimate)
{
    const uint8_t n_p = self->model->n_p;
    float sums[PVID_MAX_SUMS];
    float s[PVID_MAX_P][PVID_MAX_P];
    float f[PVID_MAX_P];
    pvid_cholesky_f32 factor;
    memset(estimate, 0, sizeof *estimate);
    memcpy(estimate->p, self->p, sizeof estimate->p);
    pvid_information_read_f32(&self->information, sums);
    estimate->weight = sums[self->model->n_moments + self->model->n_theta + 1u];
    const float variance = row_variance(self, sums, project(self, sums, s, f));
    estimate->residual_sd = sqrtf(variance);
    if (pvid_cholesky_factor_f32(&factor, n_p, (const float(*)[PVID_MAX_P])s)) {
        estimate->kappa = factor.first_pivot;
    }
    const float wide = variance * self->correlation;
    for (size_t a = 0; a < n_p; a++) {
        s[a][a] += wide / (self->start_sd[a] * self->start_sd[a]);
    }
    bool known = pvid_cholesky_factor_f32(&factor, n_p, (const float(*)[PVID_MAX_P])s);
    if (known) {
        pvid_cholesky_inverse_f32(&factor, estimate->covariance);
    }
    for (size_t a = 0; known && (a < n_p); a++) {
        for (size_t b = 0; b < n_p; b++) {
            estimate->covariance[a][b] *= wide;
            known = known && pvid_finite_f32(estimate->covariance[a][b]);
        }
        estimate->se[a] = sqrtf(estimate->covariance[a][a]);
        known = known && pvid_finite_f32(estimate->se[a]);
    }
    if (!known) {
        assess_as_start(self, estimate);
    }
}
