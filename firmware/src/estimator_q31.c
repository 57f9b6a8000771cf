#include "pvid/estimator_q31.h"

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "cholesky_q31.h"
#include "count.h"
#include "information_q31.h"
#include "integer_q31.h"

#define HELD_LIMIT (2 * PVID_SUM_LIMIT) /* of |b|, rr and what a step may add to them */
#define STEP_MAX ((int64_t)1 << 40)     /* of |dp|, far beyond the bounds of p */
#define TERM_MAX ((int64_t)1 << 40)     /* of N_i theta_i, far beyond the limit of a row */
#define NOTHING (-200)                  /* exponent of 0: never the largest */
#define ROW_SD_BITS 8                   /* format of row_sd beyond Y's */
#define FORMAT_MAX 64
#define UNIT_BITS (PVID_RHS_BITS - 1)
#define S_BITS 32                       /* of the unit of s; see pvid_estimator_solve_q31 */

static bool is_positive(const pvid_model_q31 *model, size_t i)
{
    return ((model->positive >> i) & 1u) != 0u;
}

/* Bits of |x|, or NOTHING. */
static int32_t length_of(int64_t x)
{
    return (x == 0) ? NOTHING : (int32_t)pvid_bit_length_q31(pvid_magnitude_q31(x));
}

/* ---- configuration ---- */

static bool format_is_valid(int8_t bits)
{
    return (bits >= -FORMAT_MAX) && (bits <= FORMAT_MAX);
}

static bool model_is_valid(const pvid_estimator_config_q31 *config)
{
    const pvid_model_q31 *model = config->model;
    if ((model == NULL) || (model->theta == NULL) || (model->jacobian == NULL) || (model->formats == NULL) ||
        (model->c_row == NULL) || (model->c_column == NULL) || (model->n_theta < 1u) ||
        (model->n_theta > PVID_MAX_THETA_Q31) || (model->n_p < 1u) || (model->n_p > PVID_MAX_P) ||
        (model->n_p > model->n_theta) || (model->n_c < 1u) || (model->n_c > PVID_MAX_C_Q31)) {
        return false;
    }
    bool valid = format_is_valid(config->y_bits);
    for (size_t i = 0; i < model->n_theta; i++) {
        valid = valid && format_is_valid(config->n_bits[i]);
    }
    for (size_t i = 0; i < model->n_p; i++) {
        valid = valid && format_is_valid(config->p_bits[i]);
    }
    return valid;
}

static pvid_status parameters_are_valid(const pvid_estimator_config_q31 *config)
{
    for (size_t i = 0; i < config->model->n_p; i++) {
        const int32_t lower = config->lower[i];
        if ((lower >= config->upper[i]) || (lower == INT32_MIN) || (is_positive(config->model, i) && (lower <= 0))) {
            return PVID_BAD_BOUNDS;
        }
        if ((config->start[i] < lower) || (config->start[i] > config->upper[i])) {
            return PVID_BAD_START;
        }
        if (config->start_sd[i] <= 0) {
            return PVID_BAD_START_SD;
        }
    }
    return PVID_OK;
}

static pvid_status config_is_valid(const pvid_estimator_config_q31 *config)
{
    if (!model_is_valid(config)) {
        return PVID_BAD_MODEL;
    }
    const pvid_status parameters = parameters_are_valid(config);
    if (parameters != PVID_OK) {
        return parameters;
    }
    if (config->row_sd <= 0) {
        return PVID_BAD_ROW_SD;
    }
    if ((config->forgetting_groups != 0u) &&
        ((config->forgetting_groups < 4u) || (config->forgetting_groups > ((uint32_t)1 << 24)))) {
        return PVID_BAD_FORGETTING;
    }
    if ((config->gain < 0) || (config->gain > PVID_ONE_Q30)) {
        return PVID_BAD_FEEDBACK;
    }
    if ((config->correlation < ((uint32_t)1 << 16)) || (config->correlation > ((uint32_t)1 << 31))) {
        return PVID_BAD_CORRELATION;
    }
    if ((config->row_weight < 1u) || (config->row_weight > ((uint32_t)1 << 16))) {
        return PVID_BAD_ROW_WEIGHT;
    }
    if ((config->step_limit < 1u) || (config->step_limit > 58982u)) {
        return PVID_BAD_STEP_LIMIT;
    }
    if ((config->kappa_min < 0) || (config->kappa_min > (PVID_ONE_Q30 - (PVID_ONE_Q30 / 1000)))) {
        return PVID_BAD_KAPPA_MIN;
    }
    return (config->divider >= 1u) ? PVID_OK : PVID_BAD_DIVIDER;
}

/* (sd 2^exponent / start_sd)^2 = prior 2^-(returned), prior of 31 bits; 0 < sd < 2^31. */
static int32_t square_ratio(int32_t sd, int32_t exponent, int32_t start_sd, int32_t *prior)
{
    const int64_t ratio = ((int64_t)sd << 31) / start_sd;
    const int32_t up = 31 - (int32_t)pvid_bit_length_q31((uint64_t)ratio);
    const int64_t mantissa = pvid_scale_q31(ratio, -up);
    *prior = (int32_t)pvid_clamp_q31(pvid_round_shift_q31(mantissa * mantissa, 31), INT32_MAX);
    return (2 * ((31 + up) - exponent)) - 31;
}

static void take_theta(pvid_estimator_q31 *self, const int64_t theta[])
{
    for (size_t i = 0; i < self->model->n_theta; i++) {
        const int32_t exponent = (int32_t)pvid_bit_length_q31(pvid_magnitude_q31(theta[i])) - 30;
        self->theta[i] = theta[i];
        self->mantissa[i] = (int32_t)pvid_scale_q31(theta[i], exponent);
        self->shift[i] = (int16_t)(self->align[i] - exponent);
    }
}

static void init_formats(pvid_estimator_q31 *self, const pvid_estimator_config_q31 *config)
{
    const pvid_model_q31 *model = config->model;
    int16_t c_bits[PVID_MAX_C_Q31];
    model->formats(config->p_bits, self->theta_bits, c_bits);
    for (size_t i = 0; i < model->n_theta; i++) {
        self->align[i] = (int16_t)((self->theta_bits[i] + config->n_bits[i]) - config->y_bits);
    }
    for (size_t k = 0; k < model->n_c; k++) {
        const int32_t n_bits = config->n_bits[model->c_row[k]];
        const int32_t p_bits = config->p_bits[model->c_column[k]];
        self->c_exponent[k] = (int16_t)(((config->y_bits - n_bits) - p_bits) - c_bits[k]);
    }
}

pvid_status pvid_estimator_init_q31(pvid_estimator_q31 *self, const pvid_estimator_config_q31 *config)
{
    PVID_ASSERT((self != NULL) && (config != NULL));
    const pvid_status status = config_is_valid(config);
    if (status != PVID_OK) {
        return status;
    }
    memset(self, 0, sizeof *self);
    self->model = config->model;
    pvid_information_init_q31(&self->information, config->model->n_theta, config->forgetting_groups,
                              config->row_weight);
    init_formats(self, config);
    for (size_t i = 0; i < config->model->n_p; i++) {
        self->p[i] = config->start[i];
        self->start_sd[i] = config->start_sd[i];
        self->lower[i] = config->lower[i];
        self->upper[i] = config->upper[i];
        self->prior_exponent[i] =
            (int16_t)square_ratio(config->row_sd, -ROW_SD_BITS, config->start_sd[i], &self->prior[i]);
    }
    int64_t theta[PVID_MAX_THETA_Q31];
    config->model->theta(self->p, theta);
    take_theta(self, theta);
    self->row_sd = config->row_sd;
    self->gain = config->gain;
    self->correlation = config->correlation;
    self->step_limit = config->step_limit;
    self->kappa_min = config->kappa_min;
    self->divider = config->divider;
    return PVID_OK;
}

void pvid_estimator_place_q31(pvid_estimator_q31 *self, uint8_t index, int64_t value)
{
    int64_t theta[PVID_MAX_THETA_Q31];
    const int64_t above = (value < self->lower[index]) ? self->lower[index] : value;
    self->p[index] = (int32_t)((above > self->upper[index]) ? self->upper[index] : above);
    self->model->theta(self->p, theta);
    take_theta(self, theta);
}

/* ---- rows ---- */

static bool within_row_limit(int64_t x)
{
    return (x >= -PVID_ROW_LIMIT_Q31) && (x <= PVID_ROW_LIMIT_Q31);
}

pvid_reason pvid_estimator_add_q31(pvid_estimator_q31 *self, const int32_t n[], int32_t y)
{
    bool fits = within_row_limit(y);
    int64_t e = y;
    for (size_t i = 0; i < self->model->n_theta; i++) {
        fits = fits && within_row_limit(n[i]);
        const int64_t held = pvid_clamp_q31(n[i], PVID_ROW_LIMIT_Q31);
        e -= pvid_clamp_q31(pvid_scale_q31(held * self->mantissa[i], self->shift[i]), TERM_MAX);
    }
    if (!fits || !within_row_limit(e)) {
        pvid_count_up(&self->counters.rejected_saturated);
        return PVID_REJECTED_SATURATED;
    }
    pvid_information_add_q31(&self->information, n, (int32_t)e, (self->gain < PVID_ONE_Q30) ? self->fresh : NULL);
    pvid_count_up(&self->counters.rows);
    return PVID_ACCUMULATED;
}

/* ---- the system S dp = F ---- */

/* m and h: M with its diagonal in [2^28, 2^30). */
static void equilibrate(const pvid_information_q31 *information, int32_t m[], int16_t h[])
{
    const uint32_t n = information->n_theta;
    for (uint32_t i = 0; i < n; i++) {
        h[i] = (int16_t)pvid_half_exponent_q31(information->sums[pvid_moment_q31(n, i, i)]);
    }
    size_t at = 0;
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t j = i; j < n; j++) {
            m[at] = (int32_t)pvid_clamp_q31(pvid_scale_q31(information->sums[at], h[i] + h[j]), PVID_ONE_Q30);
            at++;
        }
    }
}

/* c and f: C at p, its rows scaled as M's, the largest entry of a column of 29 bits. */
static void scale_jacobian(const pvid_estimator_q31 *self, const int16_t h[], int32_t c[], int16_t f[])
{
    const pvid_model_q31 *model = self->model;
    int64_t value[PVID_MAX_C_Q31];
    int32_t exponent[PVID_MAX_C_Q31];
    int32_t largest[PVID_MAX_P];
    model->jacobian(self->p, value);
    for (size_t a = 0; a < model->n_p; a++) {
        largest[a] = NOTHING;
    }
    for (size_t k = 0; k < model->n_c; k++) {
        exponent[k] = (int32_t)self->c_exponent[k] + h[model->c_row[k]];
        const int32_t length = length_of(value[k]) + exponent[k];
        const size_t a = model->c_column[k];
        largest[a] = (length > largest[a]) ? length : largest[a];
    }
    for (size_t a = 0; a < model->n_p; a++) {
        f[a] = (int16_t)(largest[a] - 29);
    }
    for (size_t k = 0; k < model->n_c; k++) {
        c[k] = (int32_t)pvid_scale_q31(value[k], f[model->c_column[k]] - exponent[k]);
    }
}

/* One past the last non-zero of the column that starts at `start`. */
static size_t column_end(const pvid_model_q31 *model, size_t start)
{
    size_t k = start;
    while ((k < model->n_c) && (model->c_column[k] == model->c_column[start])) {
        k++;
    }
    return k;
}

/* t += m e_j a for the symmetric m whose upper triangle is packed by rows. */
static void add_column(uint32_t n, const int32_t m[], uint32_t j, int32_t a, int64_t t[])
{
    size_t at = (size_t)j;
    for (uint32_t i = 0; i < j; i++) {
        t[i] += (int64_t)m[at] * a;
        at += (size_t)((n - 1u) - i);
    }
    for (uint32_t i = j; i < n; i++) {
        t[i] += (int64_t)m[at] * a;
        at++;
    }
}

/* Row a of s from t = m c_a on. */
static void project_row(const pvid_model_q31 *model, const int32_t c[], size_t start, const int64_t t[], int64_t s[])
{
    for (size_t b = model->c_column[start]; b < model->n_p; b++) {
        s[b] = 0;
    }
    for (size_t k = start; k < model->n_c; k++) {
        s[model->c_column[k]] += c[k] * pvid_round_shift_q31(t[model->c_row[k]], S_BITS);
    }
}

/* All of s at once. */
static void project(const pvid_model_q31 *model, const int32_t m[], const int32_t c[], int64_t s[][PVID_MAX_P])
{
    size_t start = 0;
    for (size_t a = 0; a < model->n_p; a++) {
        const size_t end = column_end(model, start);
        int64_t t[PVID_MAX_THETA_Q31] = {0};
        for (size_t k = start; k < end; k++) {
            add_column(model->n_theta, m, model->c_row[k], c[k], t);
        }
        project_row(model, c, start, t, s[a]);
        start = end;
    }
}

/* H0 in the unit of s. */
static int64_t in_units_of_s(int32_t prior, int32_t prior_exponent, int32_t f)
{
    const int64_t scaled = pvid_scale_q31(prior, prior_exponent + (2 * f) + S_BITS);
    return (scaled > (PVID_WIDE / 2)) ? (PVID_WIDE / 2) : scaled;
}

/* Equilibrates s and factors it. */
static bool factor_system(uint8_t n_p, int64_t s[][PVID_MAX_P], int16_t g[], int32_t q[][PVID_MAX_P],
                          pvid_cholesky_q31 *factor)
{
    for (size_t a = 0; a < n_p; a++) {
        g[a] = (int16_t)pvid_half_exponent_q31(s[a][a]);
    }
    for (size_t a = 0; a < n_p; a++) {
        for (size_t b = a; b < n_p; b++) {
            q[a][b] = (int32_t)pvid_clamp_q31(pvid_scale_q31(s[a][b], g[a] + g[b]), PVID_ONE_Q30);
        }
    }
    return pvid_cholesky_factor_q31(factor, n_p, (const int32_t(*)[PVID_MAX_P])q);
}

/* ---- the solve in stages ---- */

enum {
    STAGE_READ,    /* the sums and C, scaled */
    STAGE_PROJECT, /* n_p times: m c_a, a few non-zeros of c_a at a time, then row a of s */
    STAGE_FACTOR,
    STAGE_STEP,   /* dp, and where p and theta go with it */
    STAGE_FOLLOW, /* a few rows of M dtheta at a time */
    STAGE_COMMIT,
    STAGE_FOLD,
    STAGE_DONE
};

#define ROWS_A_STAGE 4u
#define COLUMNS_A_STAGE 3u

static void hold(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, pvid_reason reason)
{
    pvid_count_up((reason == PVID_HELD_PIVOT) ? &self->counters.held_pivot : &self->counters.held_not_excited);
    solve->reason = reason;
}

static const int64_t *b_of(const pvid_information_q31 *information)
{
    return &information->sums[(size_t)information->n_sums - 2u - information->n_theta];
}

/* What drives the step, g b + (1 - g) sum N e since the last solve, scaled as the rows of C. */
static void scale_force(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const size_t n = self->model->n_theta;
    const int64_t *b = b_of(&self->information);
    int64_t force[PVID_MAX_THETA_Q31];
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
    solve->force_exponent = pvid_to_block_q31((uint32_t)n, force, 30, solve->force);
}

static void read_stage(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    equilibrate(&self->information, solve->m, solve->h);
    scale_jacobian(self, solve->h, solve->c, solve->f);
    scale_force(self, solve);
}

/* A part of m c_a, or, once it is complete, row a of s; returns whether anything is left. */
static bool project_stage(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const pvid_model_q31 *model = self->model;
    const size_t next = solve->next;
    const size_t end = column_end(model, solve->start);
    if (next == solve->start) {
        memset(solve->column, 0, sizeof solve->column);
    }
    if (next < end) {
        const size_t last = ((end - next) > COLUMNS_A_STAGE) ? (next + COLUMNS_A_STAGE) : end;
        for (size_t k = next; k < last; k++) {
            add_column(model->n_theta, solve->m, model->c_row[k], solve->c[k], solve->column);
        }
        solve->next = (uint8_t)last;
        return true;
    }
    project_row(model, solve->c, solve->start, solve->column, solve->s[solve->index]);
    solve->start = (uint8_t)end;
    solve->index++;
    return solve->index < model->n_p;
}

/* Whether the data speak of p[0]: what of its information no other parameter can imitate is a part kappa of its
 * diagonal entry, and more than the start brought along. */
static bool is_excited(const pvid_estimator_q31 *self, int32_t kappa, int32_t diagonal, int64_t prior)
{
    const bool own = pvid_round_shift_q31((int64_t)kappa * diagonal, 31) >= prior;
    return (kappa >= self->kappa_min) && (own || (self->kappa_min == 0));
}

static void factor_stage(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const uint8_t n_p = self->model->n_p;
    int32_t q[PVID_MAX_P][PVID_MAX_P];
    int64_t prior[PVID_MAX_P] = {0};
    for (size_t a = 0; a < n_p; a++) {
        const int32_t exponent = (int32_t)self->prior_exponent[a] + (2 * (int32_t)self->information.exponent);
        prior[a] = in_units_of_s(self->prior[a], exponent, solve->f[a]);
        solve->s[a][a] += prior[a];
    }
    solve->reason = PVID_UPDATED;
    if (!factor_system(n_p, solve->s, solve->g, q, &solve->factor)) {
        hold(self, solve, PVID_HELD_PIVOT);
    } else if (!is_excited(self, solve->factor.first_pivot, q[0][0], pvid_scale_q31(prior[0], 2 * solve->g[0]))) {
        hold(self, solve, PVID_HELD_NOT_EXCITED);
    }
}

/* p[n_p] = where the step dp leads: shortened to the step limit, within the bounds. */
static void take_step(pvid_estimator_q31 *self, const int64_t dp[], int32_t p[])
{
    const size_t n_p = self->model->n_p;
    int64_t size = 0; /* Q16 */
    for (size_t a = 0; a < n_p; a++) {
        const int32_t reference = is_positive(self->model, a) ? self->p[a] : self->start_sd[a];
        const int64_t own = (int64_t)(pvid_magnitude_q31(dp[a]) << 16) / reference;
        size = (own > size) ? own : size;
    }
    const bool limited = size > (int64_t)self->step_limit;
    const int32_t factor = limited ? (int32_t)(((int64_t)self->step_limit << 31) / size) : 0;
    bool bounded = false;
    for (size_t a = 0; a < n_p; a++) {
        int64_t x = self->p[a] + (limited ? pvid_times_q31(dp[a], factor) : dp[a]);
        if (x > self->upper[a]) {
            x = self->upper[a];
            bounded = true;
        }
        if (x < self->lower[a]) {
            x = self->lower[a];
            bounded = true;
        }
        p[a] = (int32_t)x;
    }
    if (limited) {
        pvid_count_up(&self->counters.limited);
    }
    if (bounded) {
        pvid_count_up(&self->counters.bounded);
    }
}

/* theta_step and its exponent: dtheta scaled as the columns of m. */
static void scale_theta_step(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const size_t n = self->model->n_theta;
    int64_t step[PVID_MAX_THETA_Q31];
    int32_t largest = INT32_MIN;
    for (size_t j = 0; j < n; j++) {
        step[j] = solve->theta[j] - self->theta[j];
        const int32_t length = (length_of(step[j]) - self->align[j]) + solve->h[j];
        largest = (length > largest) ? length : largest;
    }
    solve->step_exponent = largest - 29;
    for (size_t j = 0; j < n; j++) {
        solve->theta_step[j] =
            (int32_t)pvid_scale_q31(step[j], (solve->step_exponent + self->align[j]) - solve->h[j]);
    }
}

static void step_stage(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    const pvid_model_q31 *model = self->model;
    memcpy(solve->p, self->p, sizeof solve->p);
    if (solve->reason == PVID_UPDATED) {
        int64_t rhs[PVID_MAX_P] = {0};
        int64_t dp[PVID_MAX_P];
        int32_t x[PVID_MAX_P];
        for (size_t k = 0; k < model->n_c; k++) {
            rhs[model->c_column[k]] += (int64_t)solve->c[k] * solve->force[model->c_row[k]];
        }
        for (size_t a = 0; a < model->n_p; a++) {
            rhs[a] = pvid_scale_q31(rhs[a], solve->g[a]);
        }
        const int32_t exponent = pvid_cholesky_solve_q31(&solve->factor, rhs, x) + solve->force_exponent;
        for (size_t a = 0; a < model->n_p; a++) {
            const int32_t shift = ((solve->f[a] + solve->g[a]) - exponent) + S_BITS + 30;
            dp[a] = pvid_clamp_q31(pvid_scale_q31(x[a], shift), STEP_MAX);
        }
        take_step(self, dp, solve->p);
    }
    model->theta(solve->p, solve->theta);
    scale_theta_step(self, solve);
}

/* Rows first.. of M dtheta; returns the next row. */
static size_t follow_stage(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, size_t first)
{
    const size_t n = self->model->n_theta;
    const size_t last = ((n - first) > ROWS_A_STAGE) ? (first + ROWS_A_STAGE) : n;
    for (size_t i = first; i < last; i++) {
        size_t at = i;
        int64_t sum = 0;
        for (size_t j = 0; j < i; j++) {
            sum += (int64_t)solve->m[at] * solve->theta_step[j];
            at += (n - 1u) - j;
        }
        for (size_t j = i; j < n; j++) {
            sum += (int64_t)solve->m[at] * solve->theta_step[j];
            at++;
        }
        solve->moved[i] = pvid_clamp_q31(pvid_scale_q31(sum, -(solve->h[i] + solve->step_exponent)), HELD_LIMIT);
    }
    return last;
}

/* dtheta^T (b_old + b_new), by which rr falls. */
static int64_t fall_of(const pvid_estimator_q31 *self, const pvid_estimator_solve_q31 *solve, const int64_t b[])
{
    const size_t n = self->model->n_theta;
    int64_t both[PVID_MAX_THETA_Q31] = {0};
    int32_t mantissa[PVID_MAX_THETA_Q31];
    for (size_t j = 0; j < n; j++) {
        both[j] = pvid_scale_q31((2 * b[j]) - solve->moved[j], solve->h[j]);
    }
    const int32_t exponent = pvid_to_block_q31((uint32_t)n, both, 30, mantissa);
    int64_t fall = 0;
    for (size_t j = 0; j < n; j++) {
        fall += (int64_t)solve->theta_step[j] * mantissa[j];
    }
    return pvid_clamp_q31(pvid_scale_q31(fall, -(solve->step_exponent + exponent)), HELD_LIMIT);
}

/* Moves p, theta, b and rr together: b -= M dtheta. */
static void commit_stage(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    if (solve->reason != PVID_UPDATED) {
        return;
    }
    const size_t n = self->model->n_theta;
    pvid_information_q31 *information = &self->information;
    int64_t *sums = &information->sums[(size_t)information->n_sums - 2u - n]; /* b, rr */
    int64_t b[PVID_MAX_THETA_Q31];
    bool fits = true;
    for (size_t i = 0; i < n; i++) {
        b[i] = pvid_clamp_q31(sums[i], HELD_LIMIT);
        fits = fits && (pvid_magnitude_q31(b[i] - solve->moved[i]) <= (uint64_t)HELD_LIMIT);
    }
    const int64_t residual = sums[n] - fall_of(self, solve, b);
    if (!fits || (residual > HELD_LIMIT)) {
        hold(self, solve, PVID_HELD_PIVOT);
        return;
    }
    for (size_t i = 0; i < n; i++) {
        sums[i] = b[i] - solve->moved[i];
    }
    sums[n] = (residual > 0) ? residual : 0;
    take_theta(self, solve->theta);
    memcpy(self->p, solve->p, sizeof self->p);
    pvid_count_up(&self->counters.updates);
}

/* Counts a group; whether a solve is due. */
static bool is_due(pvid_estimator_q31 *self)
{
    self->phase++;
    if (self->phase < self->divider) {
        return false;
    }
    self->phase = 0;
    return true;
}

void pvid_estimator_begin_q31(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, bool ends_group)
{
    solve->ends_group = ends_group;
    solve->reason = PVID_ACCUMULATED;
    solve->index = 0;
    solve->start = 0;
    solve->next = 0;
    solve->stage = STAGE_READ;
    solve->gain = PVID_ONE_Q30;
    if (ends_group) {
        solve->gain = self->gain;
        solve->stage = (uint8_t)(is_due(self) ? STAGE_READ : STAGE_FOLD);
    } else if (self->gain < PVID_ONE_Q30) {
        solve->stage = STAGE_DONE; /* the law of g < 1 is a rate, not an iteration */
    }
}

bool pvid_estimator_advance_q31(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    bool repeat = false;
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
        repeat = solve->index < self->model->n_theta;
        break;
    case STAGE_COMMIT:
        commit_stage(self, solve);
        break;
    case STAGE_FOLD:
        pvid_information_end_group_q31(&self->information, self->fresh);
        break;
    default:
        return true;
    }
    if (!repeat) {
        const bool over = (solve->stage == STAGE_COMMIT) && !solve->ends_group;
        solve->index = 0;
        solve->stage = (uint8_t)(over ? STAGE_DONE : (solve->stage + 1));
    }
    return solve->stage == STAGE_DONE;
}

uint16_t pvid_estimator_stages_q31(const pvid_estimator_q31 *self, bool ends_group)
{
    const pvid_model_q31 *model = self->model;
    size_t stages = 4u + ((model->n_theta + (ROWS_A_STAGE - 1u)) / ROWS_A_STAGE) + (ends_group ? 1u : 0u);
    for (size_t start = 0; start < model->n_c;) {
        const size_t end = column_end(model, start);
        stages += 1u + (((end - start) + (COLUMNS_A_STAGE - 1u)) / COLUMNS_A_STAGE);
        start = end;
    }
    return (uint16_t)stages;
}

static pvid_reason solve_at_once(pvid_estimator_q31 *self, bool ends_group)
{
    pvid_estimator_solve_q31 solve;
    pvid_estimator_begin_q31(self, &solve, ends_group);
    while (!pvid_estimator_advance_q31(self, &solve)) {
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

/* ---- what is published ---- */

/* A positive number m 2^exponent, m of 30 bits, or 0. */
typedef struct {
    int32_t m;
    int32_t exponent;
} scaled;

static scaled to_scaled(int64_t x, int32_t exponent)
{
    scaled result;
    result.exponent = exponent + pvid_to_block_q31(1, &x, 30, &result.m);
    return result;
}

/* s^2 of a row, divided by 4^exponent as the sums are. */
static scaled row_variance(const pvid_estimator_q31 *self)
{
    const pvid_information_q31 *information = &self->information;
    const int64_t residual = information->sums[information->n_sums - 2u];
    const int64_t freedom = information->sums[information->n_sums - 1u] - ((int64_t)self->model->n_p << 16); /* Q16 */
    if (freedom < ((int64_t)1 << 16)) {
        return to_scaled((int64_t)self->row_sd * self->row_sd, -2 * (ROW_SD_BITS + (int32_t)information->exponent));
    }
    const int32_t up = 62 - (int32_t)pvid_bit_length_q31((uint64_t)residual);
    const scaled divisor = to_scaled(freedom, -16);
    return to_scaled(pvid_scale_q31(residual, -up) / divisor.m, -up - divisor.exponent);
}

static void assess_as_start(const pvid_estimator_q31 *self, pvid_estimate_q31 *estimate)
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        estimate->se[a] = self->start_sd[a];
        estimate->correlation[a][a] = PVID_ONE_Q30;
    }
}

/* x / (a b), |x| <= a b: Q30, rounded towards 0. */
static int32_t part_of(int64_t x, int32_t a, int32_t b)
{
    const uint64_t part = ((pvid_magnitude_q31(x) / (uint64_t)a) << 30) / (uint64_t)b;
    const int64_t held = (part > (uint64_t)PVID_ONE_Q30) ? PVID_ONE_Q30 : (int64_t)part;
    return (int32_t)((x < 0) ? -held : held);
}

/* The errors' covariance wide^2 (S + H)^-1, from the columns of U^-1. */
static void assess_errors(pvid_estimate_q31 *estimate, const pvid_cholesky_q31 *factor, pvid_root_q31 wide,
                          const int16_t f[], const int16_t g[])
{
    const size_t n_p = factor->n;
    int32_t column[PVID_MAX_P][PVID_MAX_P];
    pvid_root_q31 root[PVID_MAX_P];
    for (size_t a = 0; a < n_p; a++) {
        int32_t unit[PVID_MAX_P] = {0};
        int64_t square = 0;
        unit[a] = (int32_t)1 << UNIT_BITS;
        pvid_cholesky_lower_q31(factor, unit, column[a]);
        for (size_t i = 0; i < n_p; i++) {
            square += (int64_t)column[a][i] * column[a][i];
        }
        root[a] = pvid_root_of_q31(square, 0);
        const int32_t shift = ((f[a] + g[a]) - (wide.e + root[a].e)) + 31 + UNIT_BITS;
        estimate->se[a] = (int32_t)pvid_clamp_q31(pvid_scale_q31((int64_t)wide.r * root[a].r, shift), INT32_MAX);
    }
    for (size_t a = 0; a < n_p; a++) {
        estimate->correlation[a][a] = PVID_ONE_Q30;
        for (size_t b = 0; b < a; b++) {
            int64_t sum = 0;
            for (size_t i = 0; i < n_p; i++) {
                sum += (int64_t)column[a][i] * column[b][i];
            }
            const int64_t in_roots = pvid_scale_q31(sum, root[a].e + root[b].e);
            estimate->correlation[a][b] = part_of(in_roots, root[a].r, root[b].r);
            estimate->correlation[b][a] = estimate->correlation[a][b];
        }
    }
}

void pvid_estimator_assess_q31(const pvid_estimator_q31 *self, pvid_estimate_q31 *estimate)
{
    const pvid_information_q31 *information = &self->information;
    const uint8_t n_p = self->model->n_p;
    int32_t m[PVID_MAX_MOMENTS_Q31];
    int16_t h[PVID_MAX_THETA_Q31];
    int32_t c[PVID_MAX_C_Q31];
    int16_t f[PVID_MAX_P];
    int16_t g[PVID_MAX_P];
    int64_t s[PVID_MAX_P][PVID_MAX_P];
    int32_t q[PVID_MAX_P][PVID_MAX_P];
    pvid_cholesky_q31 factor;
    memset(estimate, 0, sizeof *estimate);
    memcpy(estimate->p, self->p, sizeof estimate->p);
    const int64_t weight = pvid_floor_shift_q31(information->sums[information->n_sums - 1u], 16);
    estimate->weight = (weight > (int64_t)UINT32_MAX) ? UINT32_MAX : (uint32_t)weight;

    const scaled variance = row_variance(self);
    const pvid_root_q31 residual = pvid_root_of_q31(variance.m, variance.exponent);
    const int32_t residual_shift = -((residual.e + (int32_t)information->exponent) + ROW_SD_BITS);
    estimate->residual_sd = (int32_t)pvid_clamp_q31(pvid_scale_q31(residual.r, residual_shift), INT32_MAX);
    const scaled wide = to_scaled((int64_t)variance.m * self->correlation, variance.exponent - 16);
    const pvid_root_q31 wide_root = pvid_root_of_q31(wide.m, wide.exponent);

    equilibrate(information, m, h);
    scale_jacobian(self, h, c, f);
    project(self->model, m, c, s);
    if (factor_system(n_p, s, g, q, &factor)) {
        estimate->kappa = factor.first_pivot;
    }
    for (size_t a = 0; a < n_p; a++) {
        int32_t prior;
        const int32_t exponent = square_ratio(wide_root.r, wide_root.e, self->start_sd[a], &prior);
        s[a][a] += in_units_of_s(prior, exponent, f[a]);
    }
    if (factor_system(n_p, s, g, q, &factor)) {
        assess_errors(estimate, &factor, wide_root, f, g);
    } else {
        assess_as_start(self, estimate);
    }
}
