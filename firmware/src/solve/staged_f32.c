#include "number/uncontracted.h"

/* The solve: it needs theta, C and the pattern of C. A row is added as (e, N)
 * with e = Y - N^T theta, so that the sums are b = B - M theta and rr = sum e^2. Solve and assessment run in stages. */
#include "solve/staged_f32.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "number/count.h"
#include "number/finite_f32.h"
#include "solve/assess_f32.h"
#include "solve/commit.h"
#include "solve/constraints_f32.h"
#include "solve/drift_f32.h"
#include "solve/information_f32.h"
#include "solve/pattern_f32.h"
#include "solve/row_f32.h"
#include "solve/state_f32.h"
#include "solve/step_f32.h"
#include "number/unroll.h"

enum {
    STAGE_READ,        /* the sums */
    STAGE_PROJECT,     /* for each column c_a of C: M c_a, a few non-zeros at a time, then row a of S */
    STAGE_FORCE,       /* F */
    STAGE_ABOVE_NOISE, /* whether S contains more information than noise alone */
    STAGE_FACTOR,      /* Cholesky factor of S + H0; whether p[0] is excited */
    STAGE_STEP,        /* dp, and p after the step */
    STAGE_THETA,       /* theta after the step */
    STAGE_MOVE_B,      /* M dtheta, a few columns of M at a time */
    STAGE_COMMIT,      /* writes p, theta, b and rr */
    STAGE_FOLD,        /* ends the group: information.h */
    STAGE_DONE,
    STAGE_KAPPA,  /* in an assessment after STAGE_ABOVE_NOISE: kappa, residual, misfit */
    STAGE_WIDEN,  /* Cholesky factor of S + prior, for the covariance */
    STAGE_INVERT, /* n_p times: a column of its inverse */
    STAGE_SCALE   /* covariance and standard errors */
};

/* Rounding error of rr per step, relative to the sum of M_ii dtheta_i^2: four ulp of M, whose terms cancel. */
#define ROUNDING 2.4e-7f

/* Columns of M that a stage adds. */
#define ROWS_PER_STAGE 3u
#define COLUMNS_PER_STAGE 2u

/* ---- rows ---- */

/* e = y - N^T theta and, while gamma < 1, gradient = C^T N, by theta and the pattern of C, for a row of this block. */
static inline float innovate(const pvid_estimator_f32 *self, const pvid_block *block, const float n[], float y,
                             float gradient[])
{
    const pvid_model_f32 *model = self->model;
    if (pvid_feeds_back_f32(self)) {
        float c[PVID_MAX_C];
        model->jacobian(self->p, c);
        pvid_pattern_transpose_times_f32(model, c, block, n, gradient);
    }
    const float *theta = &self->theta[block->first];
    float e = y;
    for (size_t i = 0; i < block->n; i++) {
        e -= n[i] * theta[i];
    }
    return e;
}

pvid_reason pvid_staged_add_f32(pvid_estimator_f32 *self, uint8_t kind, const float n[], float y)
{
    const pvid_model_f32 *model = self->model;
    pvid_block block;
    pvid_information_block_f32(model, pvid_kind_first(model->kind_end, kind), &block);
    const pvid_reason reason = pvid_row_accept_f32(self, block.n, n, y, pvid_row_squares_f32(block.n, n, y));
    if (reason != PVID_ACCUMULATED) {
        return reason;
    }
    float gradient[PVID_MAX_P];
    const float e = innovate(self, &block, n, y, gradient);
    if (!((e * e) <= (PVID_ROW_LIMIT * PVID_ROW_LIMIT))) {
        pvid_count_up(&self->counters.rejected_saturated);
        return PVID_REJECTED_SATURATED;
    }
    if (pvid_feeds_back_f32(self)) {
        pvid_row_accumulate_innovation_f32(self, model->n_p, gradient, e);
    }
    self->group_rss += e * e;
    self->group_weight += self->information.row_weight;
    pvid_information_add_block_f32(&self->information, model, &block, n, e);
    pvid_count_up(&self->counters.rows);
    return PVID_ACCUMULATED;
}

PVID_COLD void pvid_estimator_set_expected_f32(pvid_estimator_f32 *self, float variance)
{
    float tail[2];
    pvid_information_tail_f32(&self->information, tail);
    const float share = (self->group_weight < tail[1]) ? (self->group_weight / tail[1]) : 1.0f;
    const float clamped = (variance <= PVID_RESIDUAL_MAX) ? variance : PVID_RESIDUAL_MAX;
    if (self->group_weight > 0.0f) {
        self->expected += (clamped - self->expected) * share;
    }
}

bool pvid_estimator_is_rounded_f32(const pvid_estimator_f32 *self)
{
    float tail[2];
    pvid_information_tail_f32(&self->information, tail);
    return self->information.rounding > tail[0];
}

/* ---- the solve ---- */

static void read_stage(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    pvid_information_read_f32(&self->information, solve->sums);
    const float *tail = &solve->sums[self->model->n_moments + self->model->n_theta]; /* rr, weight */
    solve->system.rss = tail[0];
    solve->system.rounding = self->information.rounding;
    solve->system.floor = self->expected * (tail[1] - (float)self->model->n_p);
    solve->system.weight = tail[1];
}

/* Adds a part of M c_a; when it is complete, computes row a of S. Returns whether the stage is to be repeated. */
static bool project_stage(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    const pvid_model_f32 *model = self->model;
    const size_t a = solve->index;
    const size_t next = solve->next;
    const size_t end = solve->end;
    if (next == solve->start) {
        for (size_t i = 0; i < model->n_theta; i++) {
            solve->product[i] = 0.0f;
        }
    }
    if (next < end) {
        const size_t last = ((end - next) > COLUMNS_PER_STAGE) ? (next + COLUMNS_PER_STAGE) : end;
        for (size_t k = next; k < last; k++) {
            pvid_pattern_add_column_f32(model, model->c_row[k], solve->work.c[k], solve->sums, solve->product);
        }
        solve->next = (uint8_t)last;
        return true;
    }
    pvid_pattern_project_row_f32(model, solve->work.c, solve->start, solve->product, solve->system.s[a]);
    solve->start = (uint8_t)end;
    solve->end = (uint8_t)pvid_pattern_end_f32(model, end);
    solve->index++;
    return solve->index < model->n_p;
}

/* S and F of the independent parameters. */
static void constrain(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
#if PVID_MAX_CONSTRAINTS > 0
    pvid_constraints_reduce_f32(&solve->system, self->model, &self->settings, self->p);
#else
    (void)self;
    (void)solve;
#endif
}

static void force_stage(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    pvid_pattern_project_row_f32(self->model, solve->work.c, 0, &solve->sums[self->model->n_moments],
                                 solve->system.force);
    constrain(self, solve);
}

/* The noise has row_sd^2 in a solve, because the residuals are larger while p is far from the solution, and the
 * variance of the residuals in an assessment. */
static void above_noise_stage(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    const pvid_solve_settings_f32 *settings = &self->settings;
    const bool judging = solve->estimate != NULL;
    solve->variance = judging ? pvid_assess_variance_f32(&solve->system, settings) : settings->row_variance;
    solve->above_noise = true;
    if ((solve->noise != NULL) && (settings->noise_margin > 0.0f)) {
        solve->above_noise = pvid_assess_above_noise_f32(&solve->system, settings, solve->variance, solve->noise);
    }
}

static void factor_stage(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        solve->diagonal[a] = solve->system.s[a][a];
        solve->system.s[a][a] += self->settings.prior[a];
    }
    if (solve->gain > 0.0f) { /* equation (5) alone has no solution to stay at */
        solve->pinned = pvid_step_pin_f32(&solve->system, &self->settings, self->p);
    }
    const pvid_reason reason = pvid_step_factor_f32(&solve->system, &self->settings, &solve->work.factor);
    const bool noise = (reason == PVID_UPDATED) && !solve->above_noise;
    solve->reason = noise ? PVID_HELD_NOT_EXCITED : reason;
    if (solve->reason != PVID_UPDATED) {
        (void)pvid_count_held(&self->counters, solve->reason);
    }
}

/* The step of an allowed solve, as a part of `solve`. */
static void take_step(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve, const float rhs[])
{
    pvid_solution_f32 solution = {.p = solve->p};
    pvid_step_take_f32(&solve->system, &self->settings, &solve->work.factor, solve->pinned, self->p, rhs, &solution);
    if (solution.reason != PVID_UPDATED) {
        solve->reason = pvid_count_held(&self->counters, solution.reason);
    }
    if (solution.in_dead_zone) {
        pvid_count_up(&self->counters.in_dead_zone);
    }
    pvid_count_step(&self->counters, solution.limited, solution.bounded);
    self->settings.blocked =
        (pvid_p_bits)((solution.blocked != 0u) ? (solution.blocked | (uint32_t)solve->pinned) : 0u);
    solve->in_dead_zone = solution.in_dead_zone;
    solve->size = solution.size;
}

/* The step ends on the constraints. */
static void return_step(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
#if PVID_MAX_CONSTRAINTS > 0
    const bool tied = (self->model->n_constraints > 0u) && (solve->reason == PVID_UPDATED) && !solve->in_dead_zone;
    if (tied && !pvid_constraints_end_f32(self->model, &self->settings, self->p, solve->p)) {
        solve->reason = pvid_count_held(&self->counters, PVID_HELD_SINGULAR);
    }
#else
    (void)self;
    (void)solve;
#endif
}

static void step_stage(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
#if !PVID_FEEDBACK
    const float *rhs = solve->system.force;
#else
    float damped[PVID_MAX_P];
    for (size_t a = 0; a < self->model->n_p; a++) {
        damped[a] = (solve->gain * solve->system.force[a]) + ((1.0f - solve->gain) * self->innovation[a]);
        self->innovation[a] = 0.0f;
    }
    const float *rhs = damped;
#endif
    memcpy(solve->p, self->p, sizeof solve->p);
    if (solve->reason == PVID_UPDATED) {
        take_step(self, solve, rhs);
        return_step(self, solve);
    }
    if ((solve->reason != PVID_UPDATED) && (solve->fallback != NULL)) {
        memcpy(solve->p, solve->fallback, sizeof solve->p);
    }
}

static void theta_stage(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    self->model->theta(solve->p, solve->work.theta.after);
    for (size_t i = 0; i < self->model->n_theta; i++) {
        solve->work.theta.step[i] = solve->work.theta.after[i] - self->theta[i];
        solve->product[i] = 0.0f;
    }
}

/* A few columns of M times their dtheta. Returns whether the stage is to be repeated. */
static bool move_b_stage(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    const size_t n = self->model->n_theta;
    const size_t first = solve->index;
    const size_t last = ((n - first) > ROWS_PER_STAGE) ? (first + ROWS_PER_STAGE) : n;
    for (size_t j = first; j < last; j++) {
        pvid_pattern_add_column_f32(self->model, j, solve->work.theta.step[j], solve->sums, solve->product);
    }
    solve->index = (uint8_t)last;
    return last < n;
}

/* The decrease of rr, dtheta^T (b_old + b_new), and the size of its terms. */
static void find_fall(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    const float *b = &solve->sums[self->model->n_moments];
    float fall = 0.0f;
    float scale = 0.0f;
    pvid_block block = {0, 0, 0};
    for (size_t i = 0; i < self->model->n_theta; i++) {
        const float step = solve->work.theta.step[i];
        pvid_information_block_f32(self->model, i, &block);
        fall += step * (b[i] + (b[i] - solve->product[i]));
        scale += solve->sums[block.moment + pvid_pattern_diagonal_f32(block.n, i - block.first)] * (step * step);
    }
    solve->fall = fall;
    solve->scale = scale;
}

/* Writes p, theta, b -= M dtheta and rr -= fall together. If a sum would overflow, `fall` is not finite, and p is held.
 */
static void commit_stage(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    const bool steps = solve->reason == PVID_UPDATED;
    if (solve->in_dead_zone || (!steps && (solve->fallback == NULL))) {
        return;
    }
    find_fall(self, solve);
    const size_t n = self->model->n_theta;
    float *low = &self->information.low[self->model->n_moments];
    if (!pvid_finite_f32(solve->fall) || !pvid_finite_f32(low[n] - solve->fall)) {
        if (steps) {
            solve->reason = pvid_count_held(&self->counters, PVID_HELD_SINGULAR);
        }
        return;
    }
    for (size_t i = 0; i < n; i++) {
        low[i] -= solve->product[i];
        self->theta[i] = solve->work.theta.after[i];
    }
    low[n] -= solve->fall;
    const float lost = self->information.rounding + (ROUNDING * solve->scale);
    self->information.rounding = (lost <= PVID_RESIDUAL_MAX) ? lost : PVID_RESIDUAL_MAX;
    for (size_t a = 0; a < self->model->n_p; a++) {
        self->p[a] = solve->p[a];
    }
    solve->system.rss = self->information.high[self->model->n_moments + n] + low[n];
    solve->system.rounding = self->information.rounding;
    if (steps) {
        pvid_count_up(&self->counters.updates);
    }
}

/* The stage after a stage that is not to be repeated. */
static uint8_t next_stage(const pvid_estimator_solve_f32 *solve)
{
    switch (solve->stage) {
    case STAGE_ABOVE_NOISE:
        return (solve->estimate == NULL) ? (uint8_t)STAGE_FACTOR : (uint8_t)STAGE_KAPPA;
    case STAGE_COMMIT:
        return solve->ends_group ? (uint8_t)STAGE_FOLD : (uint8_t)STAGE_DONE;
    case STAGE_SCALE:
        return STAGE_DONE;
    default:
        return (uint8_t)(solve->stage + 1u);
    }
}

static void reset_solve(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    self->model->jacobian(self->p, solve->work.c);
    solve->end = (uint8_t)pvid_pattern_end_f32(self->model, 0);
    solve->reason = PVID_ACCUMULATED;
    solve->index = 0;
    solve->start = 0;
    solve->next = 0;
    solve->stage = STAGE_READ;
    solve->gain = 1.0f;
    solve->variance = 0.0f;
    solve->size = 0.0f;
    solve->ends_group = false;
    solve->in_dead_zone = false;
    solve->pinned = 0;
    solve->fallback = NULL;
    solve->noise = NULL;
    solve->estimate = NULL;
}

PVID_COLD void pvid_estimator_begin_f32(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve, bool ends_group)
{
    reset_solve(self, solve);
    solve->ends_group = ends_group;
    if (ends_group) {
        solve->group_rss = self->group_rss;
        self->group_rss = 0.0f;
        self->group_weight = 0.0f;
        solve->gain = self->settings.gain;
        solve->stage = (uint8_t)(pvid_solve_is_due(&self->phase, self->divider) ? STAGE_READ : STAGE_FOLD);
    } else if (pvid_feeds_back_f32(self)) {
        solve->stage = STAGE_DONE; /* with gamma < 1 there is one step per group */
    }
}

void pvid_estimator_begin_assessment_f32(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve,
                                         pvid_estimate_f32 *estimate)
{
    reset_solve(self, solve);
    memset(estimate, 0, sizeof *estimate);
    memcpy(estimate->p, self->p, sizeof estimate->p);
    solve->estimate = estimate;
}

void pvid_estimator_assess_solved_f32(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve,
                                      pvid_estimate_f32 *estimate)
{
    memset(estimate, 0, sizeof *estimate);
    memcpy(estimate->p, self->p, sizeof estimate->p);
    for (size_t a = 0; a < self->model->n_p; a++) {
        solve->system.s[a][a] = solve->diagonal[a];
    }
    solve->estimate = estimate;
    solve->noise = NULL;
    solve->index = 0;
    solve->stage = STAGE_ABOVE_NOISE;
}

static void kappa_stage(const pvid_estimator_f32 *self, const pvid_estimator_solve_f32 *solve)
{
    pvid_estimate_f32 *estimate = solve->estimate;
    estimate->weight = solve->system.weight;
    estimate->residual_sd = sqrtf(solve->variance);
    estimate->misfit = pvid_assess_misfit_f32(&solve->system, &self->settings);
    pvid_assess_kappa_f32(&solve->system, &self->settings, estimate);
}

/* The stages that a solve and an assessment share; returns whether the stage is to be repeated. */
static bool advance_shared(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    switch (solve->stage) {
    case STAGE_READ:
        read_stage(self, solve);
        return false;
    case STAGE_PROJECT:
        return project_stage(self, solve);
    case STAGE_FORCE:
        constrain(self, solve); /* an assessment needs no F */
        return false;
    default:
        above_noise_stage(self, solve);
        return false;
    }
}

static bool finish_stage(pvid_estimator_solve_f32 *solve, bool repeat)
{
    if (!repeat) {
        solve->index = 0;
        solve->stage = next_stage(solve);
    }
    return solve->stage == STAGE_DONE;
}

bool pvid_estimator_advance_f32(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    bool repeat = false;
    switch (solve->stage) {
    case STAGE_READ:
        read_stage(self, solve);
        break;
    case STAGE_PROJECT:
        repeat = project_stage(self, solve);
        break;
    case STAGE_FORCE:
        force_stage(self, solve);
        break;
    case STAGE_ABOVE_NOISE:
        above_noise_stage(self, solve);
        break;
    case STAGE_FACTOR:
        factor_stage(self, solve);
        break;
    case STAGE_STEP:
        step_stage(self, solve);
        break;
    case STAGE_THETA:
        theta_stage(self, solve);
        break;
    case STAGE_MOVE_B:
        repeat = move_b_stage(self, solve);
        break;
    case STAGE_COMMIT:
        commit_stage(self, solve);
        break;
    case STAGE_FOLD:
#if PVID_MAX_DRIFTS > 0
        pvid_drift_forget_f32(self);
#endif
        pvid_information_end_group_f32(&self->information);
        break;
    default:
        return true;
    }
    return finish_stage(solve, repeat);
}

PVID_COLD bool pvid_estimator_assess_advance_f32(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve)
{
    const float wide = solve->variance * self->settings.correlation;
    bool repeat = false;
    switch (solve->stage) {
    case STAGE_READ:
    case STAGE_PROJECT:
    case STAGE_FORCE:
    case STAGE_ABOVE_NOISE:
        repeat = advance_shared(self, solve);
        break;
    case STAGE_KAPPA:
        kappa_stage(self, solve);
        break;
    case STAGE_WIDEN:
        pvid_assess_widen_f32(&solve->system, &self->settings, wide);
        solve->solvable = pvid_cholesky_factor_f32(&solve->work.factor, self->settings.n_p,
                                                   (const float (*)[PVID_MAX_P])solve->system.s);
        break;
    case STAGE_INVERT:
        if (solve->solvable) {
            pvid_cholesky_inverse_column_f32(&solve->work.factor, solve->index, solve->estimate->covariance);
        }
        solve->index++;
        repeat = solve->index < self->model->n_p;
        break;
    case STAGE_SCALE:
#if PVID_MAX_CONSTRAINTS > 0
        if (solve->solvable) {
            pvid_constraints_spread_f32(&solve->system.ties, self->settings.n_p, solve->estimate->covariance);
        }
#endif
        pvid_assess_scale_f32(&self->settings, wide, solve->solvable, solve->estimate);
        break;
    default:
        return true;
    }
    return finish_stage(solve, repeat);
}

/* Number of stages of READ, PROJECT and FORCE. */
static size_t projection_stages(const pvid_model_f32 *model)
{
    size_t stages = 2u + model->n_p;
    size_t start = 0;
    for (size_t a = 0; a < model->n_p; a++) {
        const size_t end = pvid_pattern_end_f32(model, start);
        stages += ((end - start) + (COLUMNS_PER_STAGE - 1u)) / COLUMNS_PER_STAGE;
        start = end;
    }
    return stages;
}

uint16_t pvid_estimator_stages_f32(const pvid_estimator_f32 *self, bool ends_group)
{
    const pvid_model_f32 *model = self->model;
    const size_t follow = (model->n_theta + (ROWS_PER_STAGE - 1u)) / ROWS_PER_STAGE;
    return (uint16_t)(projection_stages(model) + 5u + follow + (ends_group ? 1u : 0u));
}

uint16_t pvid_estimator_assessment_stages_f32(const pvid_estimator_f32 *self)
{
    return (uint16_t)(projection_stages(self->model) + pvid_estimator_assess_solved_stages_f32(self));
}

uint16_t pvid_estimator_assess_solved_stages_f32(const pvid_estimator_f32 *self)
{
    return (uint16_t)(4u + (uint32_t)self->model->n_p); /* ABOVE_NOISE, KAPPA, WIDEN, SCALE; INVERT */
}
