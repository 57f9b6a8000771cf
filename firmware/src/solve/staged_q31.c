/* The solve and the assessment in stages. */
#include <string.h>

#include "number/unroll.h"
#include "solve/assess_q31.h"
#include "solve/commit.h"
#include "solve/row_q31.h"
#include "solve/step_q31.h"
#include "solve/system_q31.h"
#include "number/scaled_q31.h"

enum {
    STAGE_MATRIX,   /* a few rows of M at a time, scaled */
    STAGE_JACOBIAN, /* C at p, scaled */
    STAGE_FORCE,
    STAGE_PROJECT,     /* n_p times: a row of S */
    STAGE_ABOVE_NOISE, /* whether S contains more information than noise: subtracts this, then a few pivots per part */
    STAGE_FACTOR,      /* S + H0 and its factor, in the same parts */
    STAGE_SOLVE,       /* dp */
    STAGE_STEP,        /* p and theta after the step */
    STAGE_MOVE_B,      /* a few rows of M dtheta at a time */
    STAGE_COMMIT,
    STAGE_FOLD, /* in parts */
    STAGE_DONE,
    STAGE_RESIDUAL, /* of an assessment, before STAGE_ABOVE_NOISE */
    STAGE_KAPPA,    /* and after it: S, its factor, kappa and least pivot */
    STAGE_WIDEN,    /* S with the start's information, and its factor */
    STAGE_INVERT,   /* n_p times: a column */
    STAGE_ERRORS    /* n_p times: errors and correlations of a parameter */
};

#define ROWS_PER_STAGE 8u
#define STEP_MAX ((int64_t)1 << 40) /* of |dp|, far beyond the bounds of p */
#define REST_BITS 28                /* of F: products with a solution of 30 bits add up in 62 */

/* Returns the next row. */
static size_t matrix_stage(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, size_t row)
{
    if (solve->keeps_matrix) {
        return pvid_system_rows_end_q31(self->model, row);
    }
    if (row == 0u) {
        pvid_system_exponents_q31(&self->information, self->model, solve->h);
    }
    return pvid_system_scale_rows_q31(&self->information, self->model, solve->h, row, solve->matrix.m);
}

/* The score of the rows since the last solve, in units of rows that are not divided by 4^exponent. */
PVID_COLD static void project_fresh(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const pvid_model_q31 *model = self->model;
    int32_t force[PVID_MAX_THETA_Q31];
    int32_t largest = INT32_MIN;
    for (size_t i = 0; i < model->n_theta; i++) {
        const int32_t length = pvid_length_q31(self->fresh[i]) - solve->h[i];
        largest = (length > largest) ? length : largest;
    }
    largest -= 30;
    for (size_t i = 0; i < model->n_theta; i++) {
        force[i] = (int32_t)pvid_clamp_q31(pvid_scale_q31(self->fresh[i], largest + solve->h[i]), PVID_ONE_Q30);
    }
    for (size_t a = 0; a < model->n_p; a++) {
        solve->score[a] = 0;
        solve->score_exponent[a] = solve->now.system.f[a] + largest + 32 + (2 * (int32_t)self->information.exponent);
    }
    for (size_t k = 0; k < model->n_c; k++) {
        solve->score[model->c_column[k]] += pvid_upper_product_q31(solve->part.early.c[k], force[model->c_row[k]]);
    }
}

/* Right-hand side of the step by rows of C, gamma b + (1 - gamma) sum N e since the last solve, scaled as these rows.
 */
static void scale_force(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const size_t n = self->model->n_theta;
    const int64_t *b = pvid_b_of_q31(&self->information);
    int64_t force[PVID_MAX_THETA_Q31];
    if (solve->ends_group) {
        project_fresh(self, solve);
    }
    for (size_t i = 0; i < n; i++) {
        int64_t driving = b[i];
        if (solve->gain == 0) {
            driving = self->fresh[i];
        } else if (solve->gain < PVID_ONE_Q30) {
            driving = pvid_times_q31(b[i], (int32_t)(2 * (int64_t)solve->gain)) +
                      pvid_times_q31(self->fresh[i], (int32_t)(2 * (int64_t)(PVID_ONE_Q30 - solve->gain)));
        }
        force[i] = pvid_scale_q31(driving, solve->h[i]);
        self->fresh[i] = 0;
    }
    solve->part.early.force_exponent = pvid_to_block_q31((uint32_t)n, force, 30, solve->part.early.force);
}

static void project_stage(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    int64_t *row = solve->now.system.s[solve->index];
    solve->start =
        (uint8_t)pvid_system_project_q31(self->model, solve->matrix.m, solve->part.early.c, solve->start, row);
}

/* Parts of a stage that factors: one prepares the matrix, then the parameters are eliminated, from the last, a few at a
 * time. */
static size_t factor_parts(size_t n_p)
{
    return 1u + ((n_p + (PVID_PIVOTS_PER_PART - 1u)) / PVID_PIVOTS_PER_PART);
}

static bool checks_noise(const pvid_estimator_q31 *self)
{
    return (self->settings.noise_margin > 0u) && (self->noise_rows > 0u);
}

static void above_noise_stage(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, size_t part)
{
    const uint8_t n_p = self->model->n_p;
    solve->above_noise = true;
    if (!checks_noise(self)) {
        return;
    }
    if (part == 0u) {
        int64_t rest[PVID_MAX_P][PVID_MAX_P];
        pvid_system_without_noise_q31(self, solve, rest);
        pvid_system_begin_factor_q31(&solve->now.system, n_p, (const int64_t (*)[PVID_MAX_P])rest);
        return;
    }
    pvid_system_eliminate_q31(&solve->now.system, n_p, part - 1u);
    solve->above_noise = solve->now.system.factor.positive;
}

static void add_prior(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        const int32_t exponent = (int32_t)self->settings.prior_exponent[a] + (2 * (int32_t)self->information.exponent);
        const int64_t prior = pvid_system_prior_q31(self->settings.prior[a], exponent, solve->now.system.f[a]);
        solve->now.system.s[a][a] += prior;
        solve->now.system.first_prior = (a == 0u) ? prior : solve->now.system.first_prior;
    }
}

/* b by rows of C, all data: force_i 2^(the result + h_i). */
static int32_t whole_force(const pvid_estimator_q31 *self, const pvid_estimator_solve_q31 *solve, int32_t force[])
{
    const size_t n = self->model->n_theta;
    const int64_t *b = pvid_b_of_q31(&self->information);
    int64_t wide[PVID_MAX_THETA_Q31];
    for (size_t i = 0; i < n; i++) {
        wide[i] = pvid_scale_q31(b[i], solve->h[i]);
    }
    return pvid_to_block_q31((uint32_t)n, wide, 30, force);
}

/* projected = C^T force. */
static void project_force(const pvid_model_q31 *model, const pvid_estimator_solve_q31 *solve, const int32_t force[],
                          int64_t projected[PVID_MAX_P])
{
    memset(projected, 0, PVID_MAX_P * sizeof projected[0]);
    for (size_t k = 0; k < model->n_c; k++) {
        projected[model->c_column[k]] += pvid_product_q31(solve->part.early.c[k], force[model->c_row[k]]);
    }
}

/* Whether p[a] is at a bound from which this force pulls it outwards. */
static bool is_held_by(const pvid_estimator_q31 *self, size_t a, int64_t force)
{
    const pvid_solve_settings_q31 *settings = &self->settings;
    return ((self->p[a] <= settings->lower[a]) && (force < 0)) || ((self->p[a] >= settings->upper[a]) && (force > 0));
}

/* The parameters of which this holds, a bit for each. */
static uint32_t outwards(const pvid_estimator_q31 *self, const int64_t force[])
{
    uint32_t bits = 0;
    for (size_t a = 0; a < self->model->n_p; a++) {
        bits |= is_held_by(self, a, force[a]) ? ((uint32_t)1u << a) : 0u;
    }
    return bits;
}

/* Bounds are one-sided constraints. Those that act keep their parameters, a bit for each: F pulls these outwards, or
 * the last solve would have (`blocked`). They leave S, and the others are solved without them. Source: theory.md 4,
 * (6a). */
static void pin(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const size_t n_p = self->model->n_p;
    bool any = false;
    for (size_t a = 0; a < n_p; a++) {
        any = any || is_held_by(self, a, -1) || is_held_by(self, a, 1);
    }
    if (!any || (solve->gain == 0)) { /* equation (5) alone has no solution to stay at */
        return;
    }
    int32_t of_b[PVID_MAX_THETA_Q31];
    int64_t force[PVID_MAX_P];
    (void)whole_force(self, solve, of_b);
    project_force(self->model, solve, of_b, force);
    const uint32_t pinned = outwards(self, force) | (uint32_t)self->settings.blocked;
    for (size_t a = 0; a < n_p; a++) {
        for (size_t b = a + 1u; b < n_p; b++) {
            const bool free = (((pinned >> a) | (pinned >> b)) & 1u) == 0u;
            solve->now.system.s[a][b] = free ? solve->now.system.s[a][b] : 0;
        }
    }
    solve->pinned = (pvid_p_bits)pinned;
}

static void factor_stage(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, size_t part)
{
    const uint8_t n_p = self->model->n_p;
    if (part == 0u) {
        add_prior(self, solve);
        pin(self, solve);
        pvid_system_begin_factor_q31(&solve->now.system, n_p, (const int64_t (*)[PVID_MAX_P])solve->now.system.s);
        return;
    }
    pvid_system_eliminate_q31(&solve->now.system, n_p, part - 1u);
    if ((part + 1u) < factor_parts(n_p)) {
        return;
    }
    solve->reason = PVID_UPDATED;
    if (!solve->now.system.factor.positive) {
        solve->reason = pvid_count_held(&self->counters, PVID_HELD_SINGULAR);
    } else if (!solve->above_noise || !pvid_step_is_excited_q31(&solve->now.system, &self->settings)) {
        solve->reason = pvid_count_held(&self->counters, PVID_HELD_NOT_EXCITED);
    } else {
        /* a step is allowed */
    }
}

/* rhs = C^T force, 0 for pinned parameters, scaled as the rows of q, and x, its solution; returns the exponent of x. */
static int32_t solve_for(const pvid_model_q31 *model, const pvid_estimator_solve_q31 *solve, const int32_t force[],
                         int64_t rhs[PVID_MAX_P], int32_t x[])
{
    project_force(model, solve, force, rhs);
    for (size_t a = 0; a < model->n_p; a++) {
        const bool free = (((uint32_t)solve->pinned >> a) & 1u) == 0u;
        rhs[a] = free ? pvid_scale_q31(rhs[a], solve->now.system.g[a]) : 0;
    }
    return pvid_cholesky_solve_q31(&solve->now.system.factor, rhs, x);
}

/* F^T (S + H0)^-1 F, F of all data, in the unit of the sums of squares. */
static pvid_scaled_q31 newton_decrement_square(const pvid_estimator_q31 *self, const pvid_estimator_solve_q31 *solve)
{
    int32_t force[PVID_MAX_THETA_Q31];
    const int32_t down = whole_force(self, solve, force);
    int64_t rhs[PVID_MAX_P];
    int32_t x[PVID_MAX_P];
    int32_t f[PVID_MAX_P];
    const int32_t of_x = solve_for(self->model, solve, force, rhs, x);
    const int32_t of_f = pvid_to_block_q31(self->model->n_p, rhs, REST_BITS, f);
    int64_t sum = 0;
    for (size_t a = 0; a < self->model->n_p; a++) {
        sum += pvid_product_q31(f[a], x[a]);
    }
    return pvid_scaled_of_q31(sum, ((of_x + of_f + (2 * down)) - PVID_S_BITS) - 30);
}

static bool solve_in_dead_zone(const pvid_estimator_q31 *self, const pvid_estimator_solve_q31 *solve)
{
    if ((PVID_DEAD_ZONE == 0) || (self->settings.dead_zone == 0u)) {
        return false;
    }
    const pvid_residual_q31 residual = pvid_residual_of_q31(&self->information);
    return pvid_step_is_in_dead_zone_q31(&residual, &self->settings, self->expected,
                                         newton_decrement_square(self, solve));
}

/* Inlined, so that its arrays share the stack of the other stages. */
PVID_ALWAYS_INLINE void solve_stage(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const pvid_model_q31 *model = self->model;
    if (solve->reason != PVID_UPDATED) {
        return;
    }
    solve->in_dead_zone = solve_in_dead_zone(self, solve);
    int64_t rhs[PVID_MAX_P];
    int32_t x[PVID_MAX_P];
    const int32_t exponent =
        solve_for(model, solve, solve->part.early.force, rhs, x) + solve->part.early.force_exponent;
    for (size_t a = 0; a < model->n_p; a++) {
        const int32_t shift = ((solve->now.system.f[a] + solve->now.system.g[a]) - exponent) + PVID_S_BITS + 30;
        solve->part.dp[a] = pvid_clamp_q31(pvid_scale_q31(x[a], shift), STEP_MAX);
    }
}

/* The step of an allowed solve, as a part of `solve`. */
static void take_step(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    pvid_solution_q31 solution = {.p = solve->now.step.p};
    pvid_step_take_q31(&self->settings, self->p, solve->part.dp, &solution);
    solve->size = solution.size;
    const uint32_t blocked = (self->settings.gain != 0) ? outwards(self, solve->part.dp) : 0u;
    if (blocked != 0u) { /* the others would go elsewhere without it: no step */
        memcpy(solve->now.step.p, self->p, sizeof solve->now.step.p);
    }
    self->settings.blocked = (pvid_p_bits)((blocked != 0u) ? (blocked | (uint32_t)solve->pinned) : 0u);
    pvid_count_step(&self->counters, solution.limited, solution.bounded || (solve->pinned != 0u));
}

/* theta_step and its exponent: dtheta scaled as the columns of m. */
static void scale_theta_step(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const size_t n = self->model->n_theta;
    int64_t step[PVID_MAX_THETA_Q31];
    int32_t largest = INT32_MIN;
    for (size_t j = 0; j < n; j++) {
        step[j] = solve->now.step.theta[j] - self->theta[j];
        const int32_t length = (pvid_length_q31(step[j]) - self->align[j]) + solve->h[j];
        largest = (length > largest) ? length : largest;
    }
    solve->now.step.step_exponent = largest - (29 - pvid_system_guard_bits_q31(n));
    for (size_t j = 0; j < n; j++) {
        const int64_t scaled = pvid_scale_q31(step[j], (solve->now.step.step_exponent + self->align[j]) - solve->h[j]);
        solve->now.step.theta_step[j] = (int32_t)pvid_clamp_q31(scaled, PVID_ONE_Q30 / 2);
    }
}

static void step_stage(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    memcpy(solve->now.step.p, self->p, sizeof solve->now.step.p);
    if (solve->in_dead_zone) {
        pvid_count_up(&self->counters.in_dead_zone);
    } else if (solve->reason == PVID_UPDATED) {
        take_step(self, solve);
    } else if (solve->has_fallback) {
        memcpy(solve->now.step.p, solve->fallback, sizeof solve->now.step.p);
    }
    pvid_estimator_theta_q31(self, solve->now.step.p, solve->now.step.theta);
    scale_theta_step(self, solve);
}

/* Entry i of m x for the packed upper triangle m by rows. */
static inline int64_t row_times(size_t n, const int32_t m[], size_t i, const int32_t x[])
{
    size_t at = i;
    int64_t sum = 0;
    for (size_t j = 0; j < i; j++) {
        sum += pvid_short_product_q31(m[at], x[j]);
        at += (n - 1u) - j;
    }
    for (size_t j = i; j < n; j++) {
        sum += pvid_short_product_q31(m[at], x[j]);
        at++;
    }
    return sum;
}

/* Rows first.. of M dtheta; returns the next row. */
static size_t move_b_stage(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, size_t first)
{
    const size_t n = self->model->n_theta;
    const size_t last = ((n - first) > ROWS_PER_STAGE) ? (first + ROWS_PER_STAGE) : n;
    pvid_block block = {0, 0, 0};
    for (size_t i = first; i < last; i++) {
        if (i >= (block.first + block.n)) {
            pvid_information_block_q31(self->model, i, &block);
        }
        const int64_t sum = row_times(block.n, &solve->matrix.m[block.moment], i - block.first,
                                      &solve->now.step.theta_step[block.first]);
        solve->now.step.moved[i] =
            pvid_clamp_q31(pvid_scale_q31(sum, -(solve->h[i] + solve->now.step.step_exponent)), PVID_CLAMP_LIMIT);
    }
    return last;
}

/* Decrease of rr by the step: dtheta^T (b_old + b_new). */
static int64_t fall_of(const pvid_estimator_q31 *self, const pvid_estimator_solve_q31 *solve)
{
    const size_t n = self->model->n_theta;
    int64_t both[PVID_MAX_THETA_Q31] = {0};
    int32_t mantissa[PVID_MAX_THETA_Q31];
    const int64_t *b = pvid_b_of_q31(&self->information);
    for (size_t j = 0; j < n; j++) {
        both[j] = pvid_scale_q31((2 * pvid_clamp_q31(b[j], PVID_CLAMP_LIMIT)) - solve->now.step.moved[j], solve->h[j]);
    }
    const int32_t exponent = pvid_to_block_q31((uint32_t)n, both, 30, mantissa);
    int64_t fall = 0;
    for (size_t j = 0; j < n; j++) {
        fall += pvid_product_q31(solve->now.step.theta_step[j], mantissa[j]);
    }
    return pvid_clamp_q31(pvid_scale_q31(fall, -(solve->now.step.step_exponent + exponent)), PVID_CLAMP_LIMIT);
}

/* Moves p, theta, b and rr together: b -= M dtheta. */
static void commit_stage(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const bool steps = solve->reason == PVID_UPDATED;
    if (solve->in_dead_zone || (!steps && !solve->has_fallback)) {
        return;
    }
    const size_t n = self->model->n_theta;
    pvid_information_q31 *information = &self->information;
    int64_t *sums = &information->sums[((size_t)information->n_sums - 2u) - n]; /* b, rr */
    int64_t b[PVID_MAX_THETA_Q31];
    bool fits = true;
    for (size_t i = 0; i < n; i++) {
        b[i] = pvid_clamp_q31(sums[i], PVID_CLAMP_LIMIT);
        fits = fits && (pvid_magnitude_q31(b[i] - solve->now.step.moved[i]) <= (uint64_t)PVID_CLAMP_LIMIT);
    }
    const int64_t residual = sums[n] - fall_of(self, solve);
    if (!fits || (residual > PVID_CLAMP_LIMIT)) {
        if (steps) {
            solve->reason = pvid_count_held(&self->counters, PVID_HELD_SINGULAR);
        }
        return;
    }
    for (size_t i = 0; i < n; i++) {
        sums[i] = b[i] - solve->now.step.moved[i];
    }
    sums[n] = (residual > 0) ? residual : 0;
    pvid_estimator_set_theta_q31(self, solve->now.step.theta);
    memcpy(self->p, solve->now.step.p, sizeof self->p);
    if (steps) {
        pvid_count_up(&self->counters.updates);
    }
}

static void reset_solve(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    solve->reason = PVID_ACCUMULATED;
    solve->stage = STAGE_MATRIX;
    solve->index = 0;
    solve->start = 0;
    solve->ends_group = false;
    solve->judging = false;
    solve->above_noise = true;
    solve->has_fallback = false;
    solve->in_dead_zone = false;
    solve->pinned = 0;
    solve->keeps_matrix = false;
    solve->gain = PVID_ONE_Q30;
    solve->size = 0;
    solve->variance =
        pvid_assess_row_variance_q31(&self->settings, self->information.exponent); /* while p may still be far off */
}

void pvid_estimator_begin_q31(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, bool ends_group)
{
    reset_solve(self, solve);
    solve->ends_group = ends_group;
    if (ends_group) {
        solve->group_rss = self->group_rss;
        self->group_rss = 0;
        self->group_weight = 0;
        solve->gain = self->settings.gain;
        solve->stage = (uint8_t)(pvid_solve_is_due(&self->phase, self->divider) ? STAGE_MATRIX : STAGE_FOLD);
    } else if (self->settings.gain < PVID_ONE_Q30) {
        solve->stage = STAGE_DONE; /* with gamma < 1 there is one step per group */
    }
}

void pvid_estimator_begin_assessment_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    reset_solve(self, solve);
    solve->judging = true;
}

/* The stage after a stage. */
static uint8_t next_stage(const pvid_estimator_solve_q31 *solve)
{
    switch (solve->stage) {
    case STAGE_JACOBIAN:
        return solve->judging ? (uint8_t)STAGE_PROJECT : (uint8_t)STAGE_FORCE;
    case STAGE_PROJECT:
        return solve->judging ? (uint8_t)STAGE_RESIDUAL : (uint8_t)STAGE_ABOVE_NOISE;
    case STAGE_RESIDUAL:
        return STAGE_ABOVE_NOISE;
    case STAGE_ABOVE_NOISE:
        return solve->judging ? (uint8_t)STAGE_KAPPA : (uint8_t)STAGE_FACTOR;
    case STAGE_COMMIT:
        return solve->ends_group ? (uint8_t)STAGE_FOLD : (uint8_t)STAGE_DONE;
    case STAGE_ERRORS:
        return STAGE_DONE;
    default:
        return (uint8_t)(solve->stage + 1u);
    }
}

/* Sets the index after a stage and ends the stage after its last part; returns whether all stages are done. */
static bool finish_stage(pvid_estimator_solve_q31 *solve, size_t next, size_t all)
{
    solve->index = (uint8_t)next;
    if (next >= all) {
        solve->index = 0;
        solve->stage = next_stage(solve);
    }
    return solve->stage == STAGE_DONE;
}

/* The stages that a solve and an assessment share. */
static bool advance_shared(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const size_t index = solve->index;
    size_t next = index + 1u;
    size_t all = 1;
    switch (solve->stage) {
    case STAGE_MATRIX:
        next = matrix_stage(self, solve, index);
        all = self->model->n_theta;
        break;
    case STAGE_JACOBIAN:
        pvid_system_jacobian_q31(self, solve->h, solve->part.early.c, solve->now.system.f);
        break;
    case STAGE_PROJECT:
        project_stage(self, solve);
        all = self->model->n_p;
        break;
    default: /* STAGE_ABOVE_NOISE */
        above_noise_stage(self, solve, index);
        all = factor_parts(self->model->n_p);
        break;
    }
    return finish_stage(solve, next, all);
}

bool pvid_estimator_advance_q31(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const size_t index = solve->index;
    size_t next = index + 1u;
    size_t all = 1;
    switch (solve->stage) {
    case STAGE_FORCE:
        scale_force(self, solve);
        break;
    case STAGE_FACTOR:
        factor_stage(self, solve, index);
        all = factor_parts(self->model->n_p);
        break;
    case STAGE_SOLVE:
        solve_stage(self, solve);
        break;
    case STAGE_STEP:
        step_stage(self, solve);
        break;
    case STAGE_MOVE_B:
        next = move_b_stage(self, solve, index);
        all = self->model->n_theta;
        break;
    case STAGE_COMMIT:
        commit_stage(self, solve);
        break;
    case STAGE_FOLD:
        pvid_information_end_group_q31(&self->information, self->model, index, self->fresh);
        all = PVID_INFORMATION_END_PARTS;
        break;
    case STAGE_DONE:
        return true;
    default:
        return advance_shared(self, solve);
    }
    return finish_stage(solve, next, all);
}

static void residual_stage(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, pvid_estimate_q31 *estimate)
{
    const pvid_residual_q31 residual = pvid_residual_of_q31(&self->information);
    memset(estimate, 0, sizeof *estimate);
    memcpy(estimate->p, self->p, sizeof estimate->p);
    pvid_assess_residual_q31(&residual, &self->settings, self->expected, &solve->variance, &solve->part.inverse.wide,
                             estimate);
}

static void kappa_stage(pvid_estimator_solve_q31 *solve, size_t n_p, size_t part, pvid_estimate_q31 *estimate)
{
    if (part == 0u) {
        pvid_system_begin_factor_q31(&solve->now.system, (uint8_t)n_p,
                                     (const int64_t (*)[PVID_MAX_P])solve->now.system.s);
        return;
    }
    if (part < factor_parts(n_p)) {
        pvid_system_eliminate_q31(&solve->now.system, n_p, part - 1u);
    } else if (solve->now.system.factor.positive) {
        estimate->kappa = solve->now.system.factor.first_pivot;
        estimate->least_pivot = pvid_cholesky_least_pivot_q31(&solve->now.system.factor,
                                                              (const int32_t (*)[PVID_MAX_P])solve->now.system.q);
    }
}

static void widen_stage(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, size_t part)
{
    const uint8_t n_p = self->model->n_p;
    if (part == 0u) {
        pvid_assess_widen_q31(&solve->now.system, &self->settings, solve->part.inverse.wide);
        pvid_system_begin_factor_q31(&solve->now.system, n_p, (const int64_t (*)[PVID_MAX_P])solve->now.system.s);
    } else {
        pvid_system_eliminate_q31(&solve->now.system, n_p, part - 1u);
    }
}

bool pvid_estimator_assess_advance_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve,
                                       pvid_estimate_q31 *estimate)
{
    const size_t n_p = self->model->n_p;
    const size_t index = solve->index;
    size_t all = n_p;
    switch (solve->stage) {
    case STAGE_RESIDUAL:
        residual_stage(self, solve, estimate);
        all = 1;
        break;
    case STAGE_KAPPA:
        kappa_stage(solve, n_p, index, estimate);
        all = factor_parts(n_p) + 1u;
        break;
    case STAGE_WIDEN:
        widen_stage(self, solve, index);
        all = factor_parts(n_p);
        break;
    case STAGE_INVERT:
        pvid_assess_invert_q31(&solve->now.system.factor, index, &solve->part.inverse);
        break;
    case STAGE_ERRORS:
        pvid_assess_errors_q31(&solve->now.system, &self->settings, &solve->part.inverse, index, estimate);
        break;
    case STAGE_DONE:
        return true;
    default:
        return advance_shared(self, solve);
    }
    return finish_stage(solve, index + 1u, all);
}

/* Number of stages of M, C, S and the noise check. */
static size_t shared_stages(const pvid_model_q31 *model)
{
    return pvid_system_row_stages_q31(model) + 1u + model->n_p + factor_parts(model->n_p);
}

uint16_t pvid_estimator_stages_q31(const pvid_estimator_q31 *self, bool ends_group)
{
    const pvid_model_q31 *model = self->model;
    const size_t follow = (model->n_theta + (ROWS_PER_STAGE - 1u)) / ROWS_PER_STAGE;
    const size_t fold = ends_group ? PVID_INFORMATION_END_PARTS : 0u;
    /* and four single ones: force, solve, step, commit */
    return (uint16_t)(shared_stages(model) + factor_parts(model->n_p) + follow + fold + 4u);
}

uint16_t pvid_estimator_assessment_stages_q31(const pvid_estimator_q31 *self)
{
    const pvid_model_q31 *model = self->model;
    return (uint16_t)(shared_stages(model) + 2u + (2u * factor_parts(model->n_p)) + (2u * model->n_p));
}
