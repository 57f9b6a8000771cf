#include "pvid/estimator.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "cholesky_f32.h"
#include "finite_f32.h"
#include "pattern_f32.h"

const pvid_estimator_config_f32 pvid_estimator_defaults_f32 = {
    .correlation = 1.0f,
    .row_weight = 1.0f,
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
           ((model->accumulate != NULL) || (model->n_moments == ((uint16_t)model->n_theta * (model->n_theta + 1u)) / 2u));
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
    if (!pvid_within_f32(config->row_weight, 1.0e-6f, 1.0f) ||
        (!relative_to_estimate(config->model) && (config->row_weight < 1.0f))) {
        return PVID_BAD_ROW_WEIGHT;
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

/* e = y - N^T theta and, while g < 1, gradient = C^T N: by the model's own function or by theta and
 * the pattern of C. */
static float innovate(const pvid_estimator_f32 *self, const float n[], float y, float gradient[])
{
    const pvid_model_f32 *model = self->model;
    if (model->innovate != NULL) {
        return model->innovate(self->p, n, y, gradient);
    }
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

/* Takes one row in and writes the sums with it; sums may be NULL where the model does not insist. */
static inline pvid_reason add_row(pvid_estimator_f32 *self, const float n[], float y, float sums[])
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
        if (relative && !((e * e) <= (PVID_ROW_LIMIT * PVID_ROW_LIMIT))) {
            count(&self->counters.rejected_saturated);
            return PVID_REJECTED_SATURATED;
        }
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
    if (relative_to_estimate(self->model)) {
        return add_row(self, n, y, NULL);
    }
    float sums[PVID_MAX_SUMS];
    return add_row(self, n, y, sums);
}

/* ---- the solve ---- */

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
    for (size_t a = 0; a < model->n_p; a++) {
        float column[PVID_MAX_THETA] = {0.0f};
        const size_t start = pvid_pattern_start_f32(model, a);
        pvid_pattern_add_columns_f32(model, c, start, pvid_pattern_end_f32(model, start), sums, column);
        pvid_pattern_project_row_f32(model, c, start, column, s[a]);
    }
    pvid_pattern_transpose_times_f32(model, c, b, f);
    return 0.0f;
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

/* p[n_p] = where the step dp leads: shortened to the step limit, within the bounds. */
static inline void take_step(pvid_estimator_f32 *self, const float dp[], float size, float p[])
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
        p[a] = x;
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

/* One step of p from the sums, for a model that projects them by itself; `gain` is g of estimator.h. */
static inline pvid_reason solve_at_once(pvid_estimator_f32 *self, float gain, const float sums[])
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
    take_step(self, dp, size, self->p);
    count(&self->counters.updates);
    return PVID_UPDATED;
}

/* Counts a group; whether a solve is due. */
static bool is_due(pvid_estimator_f32 *self)
{
    self->phase++;
    if (self->phase < self->divider) {
        return false;
    }
    self->phase = 0;
    return true;
}

/* Ends a group whose sums are known and solves if it is time to. */
static inline pvid_reason end_group(pvid_estimator_f32 *self, const float sums[])
{
    const pvid_reason reason = is_due(self) ? solve_at_once(self, self->gain, sums) : PVID_ACCUMULATED;
    pvid_information_end_group_f32(&self->information);
    return reason;
}

/* ---- the solve in stages, for a model without functions of its own ---- */

enum {
    STAGE_READ,    /* the sums and C */
    STAGE_PROJECT, /* n_p times: M c_a, a few non-zeros of c_a at a time, then row a of S and F */
    STAGE_FACTOR,
    STAGE_STEP,    /* dp, and where p and theta go with it */
    STAGE_FOLLOW, /* a few rows of M dtheta at a time */
    STAGE_COMMIT,
    STAGE_FOLD,
    STAGE_DONE
};

#define ROWS_A_STAGE 4u
#define COLUMNS_A_STAGE 3u

static void hold(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve, pvid_reason reason)
{
    count((reason == PVID_HELD_PIVOT) ? &self->counters.held_pivot : &self->counters.held_not_excited);
    solve->reason = reason;
}

static void read_stage(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    pvid_information_read_f32(&self->information, solve->sums);
    self->model->jacobian(self->p, solve->c);
}

/* A part of M c_a, or, once it is complete, row a of S and F; returns whether anything is left. */
static bool project_stage(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    const pvid_model_f32 *model = self->model;
    const size_t a = solve->index;
    const size_t next = solve->next;
    const size_t end = pvid_pattern_end_f32(model, solve->start);
    if (next == solve->start) {
        memset(solve->column, 0, sizeof solve->column);
    }
    if (next < end) {
        const size_t last = ((end - next) > COLUMNS_A_STAGE) ? (next + COLUMNS_A_STAGE) : end;
        pvid_pattern_add_columns_f32(model, solve->c, next, last, solve->sums, solve->column);
        solve->next = (uint8_t)last;
        return true;
    }
    pvid_pattern_project_row_f32(model, solve->c, solve->start, solve->column, solve->s[a]);
    solve->force[a] = pvid_pattern_dot_f32(model, solve->c, solve->start, &solve->sums[model->n_moments]);
    solve->start = (uint8_t)end;
    solve->index++;
    return solve->index < model->n_p;
}

static void factor_stage(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        solve->s[a][a] += self->prior[a];
    }
    solve->reason = PVID_UPDATED;
    if (!pvid_cholesky_factor_f32(&solve->factor, self->model->n_p, (const float(*)[PVID_MAX_P])solve->s)) {
        hold(self, solve, PVID_HELD_PIVOT);
    } else if (!is_excited(self, solve->factor.first_pivot, solve->s[0][0])) {
        hold(self, solve, PVID_HELD_NOT_EXCITED);
    }
}

static void step_stage(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    const pvid_model_f32 *model = self->model;
    float rhs[PVID_MAX_P];
    for (size_t a = 0; a < model->n_p; a++) {
        rhs[a] = (solve->gain * solve->force[a]) + ((1.0f - solve->gain) * self->innovation[a]);
        self->innovation[a] = 0.0f;
    }
    memcpy(solve->p, self->p, sizeof solve->p);
    if (solve->reason == PVID_UPDATED) {
        float dp[PVID_MAX_P];
        pvid_cholesky_solve_f32(&solve->factor, rhs, dp);
        const float size = relative_size(self, dp);
        if (pvid_finite_f32(size)) {
            take_step(self, dp, size, solve->p);
        } else {
            hold(self, solve, PVID_HELD_PIVOT);
        }
    }
    model->theta(solve->p, solve->theta);
    for (size_t i = 0; i < model->n_theta; i++) {
        solve->theta_step[i] = solve->theta[i] - self->theta[i];
    }
    solve->fall = 0.0f;
}

/* Rows first.. of M dtheta, and of the fall of rr by dtheta^T (b_old + b_new); returns the next row. */
static size_t follow_stage(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve, size_t first)
{
    const size_t n = self->model->n_theta;
    const float *b = &solve->sums[self->model->n_moments];
    const size_t last = ((n - first) > ROWS_A_STAGE) ? (first + ROWS_A_STAGE) : n;
    for (size_t i = first; i < last; i++) {
        const float moved = pvid_pattern_times_f32(n, solve->sums, i, solve->theta_step);
        solve->moved[i] = moved;
        solve->fall += solve->theta_step[i] * (b[i] + (b[i] - moved));
    }
    return last;
}

/* Moves p, theta, b and rr together: b -= M dtheta. A sum that would overflow shows in `fall`. */
static void commit_stage(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    if (solve->reason != PVID_UPDATED) {
        return;
    }
    const size_t n = self->model->n_theta;
    float *low = &self->information.low[self->model->n_moments];
    if (!pvid_finite_f32(solve->fall) || !pvid_finite_f32(low[n] - solve->fall)) {
        hold(self, solve, PVID_HELD_PIVOT);
        return;
    }
    for (size_t i = 0; i < n; i++) {
        low[i] -= solve->moved[i];
        self->theta[i] = solve->theta[i];
    }
    low[n] -= solve->fall;
    memcpy(self->p, solve->p, sizeof self->p);
    count(&self->counters.updates);
}

/* What follows once a stage that is not repeated is over. */
static uint8_t after(uint8_t stage, bool ends_group)
{
    if ((stage == STAGE_COMMIT) && !ends_group) {
        return STAGE_DONE;
    }
    return (uint8_t)(stage + 1u);
}

static void advance_at_once(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    pvid_information_read_f32(&self->information, solve->sums);
    if (solve->ends_group) {
        solve->reason = end_group(self, solve->sums);
    } else if (!(self->gain < 1.0f)) {
        solve->reason = solve_at_once(self, 1.0f, solve->sums);
    }
    solve->stage = STAGE_DONE;
}

void pvid_estimator_begin_f32(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve, bool ends_group)
{
    solve->ends_group = ends_group;
    solve->reason = PVID_ACCUMULATED;
    solve->index = 0;
    solve->start = 0;
    solve->next = 0;
    solve->stage = STAGE_READ;
    solve->gain = 1.0f;
    if (!relative_to_estimate(self->model)) {
        return;
    }
    if (ends_group) {
        solve->gain = self->gain;
        solve->stage = (uint8_t)(is_due(self) ? STAGE_READ : STAGE_FOLD);
    } else if (self->gain < 1.0f) {
        solve->stage = STAGE_DONE; /* the law of g < 1 is a rate, not an iteration */
    }
}

bool pvid_estimator_advance_f32(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    const pvid_model_f32 *model = self->model;
    bool repeat = false;
    if (!relative_to_estimate(model) && (solve->stage != STAGE_DONE)) {
        advance_at_once(self, solve);
    }
    switch (solve->stage) {
    case STAGE_READ:
        read_stage(self, solve);
        break;
    case STAGE_PROJECT:
        repeat = project_stage(self, solve);
        break;
    case STAGE_FACTOR:
        factor_stage(self, solve);
        break;
    case STAGE_STEP:
        step_stage(self, solve);
        break;
    case STAGE_FOLLOW:
        solve->index = (uint8_t)follow_stage(self, solve, solve->index);
        repeat = solve->index < model->n_theta;
        break;
    case STAGE_COMMIT:
        commit_stage(self, solve);
        break;
    case STAGE_FOLD:
        pvid_information_end_group_f32(&self->information);
        break;
    default:
        return true;
    }
    if (!repeat) {
        solve->index = 0;
        solve->stage = after(solve->stage, solve->ends_group);
    }
    return solve->stage == STAGE_DONE;
}

uint16_t pvid_estimator_stages_f32(const pvid_estimator_f32 *self, bool ends_group)
{
    const pvid_model_f32 *model = self->model;
    if (!relative_to_estimate(model)) {
        return 1;
    }
    size_t stages = 4u + ((model->n_theta + (ROWS_A_STAGE - 1u)) / ROWS_A_STAGE) + (ends_group ? 1u : 0u);
    for (size_t start = 0; start < model->n_c;) {
        const size_t end = pvid_pattern_end_f32(model, start);
        stages += 1u + (((end - start) + (COLUMNS_A_STAGE - 1u)) / COLUMNS_A_STAGE);
        start = end;
    }
    return (uint16_t)stages;
}

/* All stages of a solve at once. */
static pvid_reason solve_in_stages(pvid_estimator_f32 *self, bool ends_group)
{
    pvid_estimator_solve_f32 solve;
    pvid_estimator_begin_f32(self, &solve, ends_group);
    while (!pvid_estimator_advance_f32(self, &solve)) {
    }
    return solve.reason;
}

pvid_reason pvid_estimator_step_f32(pvid_estimator_f32 *self, const float n[], float y)
{
    if (relative_to_estimate(self->model)) {
        const pvid_reason added = add_row(self, n, y, NULL);
        return (added == PVID_ACCUMULATED) ? solve_in_stages(self, true) : added;
    }
    float sums[PVID_MAX_SUMS];
    const pvid_reason added = add_row(self, n, y, sums);
    return (added == PVID_ACCUMULATED) ? end_group(self, sums) : added;
}

pvid_reason pvid_estimator_update_f32(pvid_estimator_f32 *self)
{
    return solve_in_stages(self, true);
}

pvid_reason pvid_estimator_iterate_f32(pvid_estimator_f32 *self)
{
    return solve_in_stages(self, false);
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
