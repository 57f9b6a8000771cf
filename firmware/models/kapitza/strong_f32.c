#include "number/uncontracted.h"

#include "pvid/strong.h"

#include <stddef.h>
#include <string.h>

#include "judge/gate_f32.h"
#include "judge/misfit_f32.h"
#include "kapitza_estimator_f32.h"
#include "kapitza_row_f32.h"
#include "kapitza_solve_f32.h"
#include "kapitza_sums_f32.h"
#include "number/count.h"
#include "number/finite_f32.h"
#include "number/init.h"
#include "number/unroll.h"
#include "strong_derivatives_f32.h"

/* The gate's scale averages over about a period of the faster mode, because row_sd is only a guess. */
#define GATE_MEMORY_S 0.25f
#define GATE_FLOOR 1.0e-6f

/* Whether init has accepted a configuration. */
static inline bool is_ready(const pvid_strong_f32 *self)
{
    const bool ready = (self != NULL) && (self->estimator.config != NULL);
    PVID_ASSERT(ready);
    return ready;
}

static pvid_status prepare(pvid_strong_f32 *self, const pvid_strong_config_f32 *config)
{
    if (!pvid_within_f32(config->l1, 1.0e-6f, 1.0e6f)) {
        return PVID_BAD_LENGTH;
    }
    if (!pvid_within_f32(config->drive_min, 0.0f, 1.0e9f)) {
        return PVID_BAD_DRIVE_MIN;
    }
    memset(self, 0, sizeof *self);
    pvid_status status = pvid_strong_window_init_f32(&self->window, config);
    if (status != PVID_OK) {
        return status;
    }
    const float rate = config->sample_rate_hz / (float)pvid_fir_block_f32(&config->bank); /* of rows */
    self->drive_forgetting = (rate > 1.0f) ? (1.0f / rate) : 1.0f;
    self->drive_min = config->drive_min * config->drive_min;
    status = pvid_kapitza_estimator_init_f32(&self->estimator, config, rate);
    if (status != PVID_OK) {
        return status;
    }
    pvid_misfit_init_f32(&self->misfit, rate, config->estimator.forgetting_s);
    const float row_variance = config->estimator.row_sd * config->estimator.row_sd;
    return pvid_gate_init_f32(&self->gate, &config->gate, rate, GATE_MEMORY_S * rate, GATE_FLOOR * row_variance);
}

PVID_COLD pvid_status pvid_strong_init_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config)
{
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

void pvid_strong_freeze_f32(pvid_strong_f32 *self, bool frozen)
{
    if (is_ready(self)) {
        self->frozen = frozen;
    }
}

void pvid_strong_gap_f32(pvid_strong_f32 *self)
{
    if (is_ready(self)) {
        pvid_strong_window_reset_f32(&self->window);
    }
}

void pvid_strong_assess_f32(const pvid_strong_f32 *self, pvid_estimate_f32 *estimate)
{
    if (estimate == NULL) {
        return;
    }
    if (!is_ready(self)) {
        memset(estimate, 0, sizeof *estimate);
        return;
    }
    pvid_kapitza_assess_f32(&self->estimator, estimate);
}

void pvid_strong_read_sums_f32(const pvid_strong_f32 *self, float sums[])
{
    if (is_ready(self)) {
        pvid_kapitza_read_f32(&self->estimator.sums, sums);
    }
}

/* ---- the step of p ---- */

/* What is done at a row, beside adding it to the sums. */
typedef enum {
    ROW_ALONE,         /* nothing */
    LAZY_STEP,         /* its square to S, a step */
    PROJECTED_STEP,    /* S and the right-hand side from all rows, a step */
    STAGED_PROJECTION, /* the same without the step, */
    STAGED_STEP        /* which follows at the next row */
} work;

/* Solves (S + H0) dp = rhs and moves p. In one place, for all schedules. */
PVID_ALWAYS_INLINE pvid_reason solve(pvid_strong_estimator_f32 *self, const float rhs[3])
{
    pvid_kapitza_factor_f32 factor;
    pvid_reason reason = pvid_kapitza_factorise_f32(self, self->s, &factor);
    if (reason == PVID_UPDATED) {
        float dp[PVID_KAPITZA_P];
        pvid_kapitza_back_f32(&factor, rhs, dp);
        reason = pvid_kapitza_move_f32(self, dp);
    }
    return (reason == PVID_UPDATED) ? reason : pvid_count_held(&self->counters, reason);
}

/* to = g from + (1 - g) to: the forces of all rows, and those of the rows since the last projection */
static inline void mix(float gain, const float from[3], float to[3])
{
    const float rest = 1.0f - gain;
    to[0] = (gain * from[0]) + (rest * to[0]);
    to[1] = (gain * from[1]) + (rest * to[1]);
    to[2] = (gain * from[2]) + (rest * to[2]);
}

/* S and the right-hand side at p from all rows and this one, whose C^T N e is `own`; rhs: the same sum of the rows
 * since the last projection. The square of this row is not in S yet. */
static inline void project(pvid_strong_estimator_f32 *self, const float own[3], float rhs[3])
{
    float force[PVID_KAPITZA_P];
    pvid_kapitza_gather_f32(self, self->in_block, self->s, force);
    force[0] += own[0];
    force[1] += own[1];
    force[2] += own[2];
    mix(self->gain, force, rhs);
}

/* The same with a dead zone, which needs the residuals: returns whether p is at rest. The square is in S. */
static PVID_COLD bool project_in_zone(pvid_strong_estimator_f32 *self, const float g[3], float e, float rhs[3])
{
    float force[PVID_KAPITZA_P];
    pvid_kapitza_residual_f32 residual;
    pvid_kapitza_factor_f32 factor;
    pvid_kapitza_gather_residuals_f32(self, self->s, force, &residual);
    pvid_kapitza_add_squares_f32(g, self->s);
    pvid_kapitza_add_products_f32(g, e, force);
    residual.rss += e * e;
    residual.weight += 1.0f;
    if (pvid_kapitza_factorise_f32(self, self->s, &factor) == PVID_UPDATED) {
        float x[PVID_KAPITZA_P];
        pvid_kapitza_back_f32(&factor, force, x);
        const float square = ((force[0] * x[0]) + (force[1] * x[1])) + (force[2] * x[2]);
        if (pvid_kapitza_is_at_rest_f32(self, square, &residual)) {
            pvid_count_up(&self->counters.in_dead_zone);
            return true;
        }
    }
    mix(self->gain, force, rhs);
    return false;
}

/* A row with divider 1: a step, from all sums at every exact_every-th row. */
PVID_ALWAYS_INLINE work at_every_row(pvid_strong_estimator_f32 *self, const float own[3], float rhs[3])
{
    const uint32_t left = self->phase;
    rhs[0] = own[0];
    rhs[1] = own[1];
    rhs[2] = own[2];
    self->phase = (uint16_t)(((left == 0u) ? self->exact_every : left) - 1u);
    return (left == 0u) ? PROJECTED_STEP : LAZY_STEP;
}

/* Rows of a staged round, by their number from 1; the last has number 0. The projection is at row 1. */
#define SOLUTION 2u
#define FIRST_FOLD 5u
#define FOLDS 3u

/* Thirds of the sums, which staged rows fold one by one. */
static inline size_t third(size_t i)
{
    return (PVID_STRONG_SUMS * i) / FOLDS;
}

/* A part of the fold at rows 4, 5, 6 of a staged round: between two blocks, after projection and solve. */
static PVID_NOINLINE void fold_in_stages(pvid_strong_estimator_f32 *self)
{
    const size_t place = self->in_block;
    if ((self->staged != 0u) && (place < (PVID_STRONG_ROWS - 1u)) && (self->age >= self->fold_every)) {
        pvid_kapitza_fold_f32(&self->sums, third(place), third(place + 1u));
        self->age = (place == (PVID_STRONG_ROWS - 2u)) ? (uint8_t)(self->age - self->fold_every) : self->age;
    }
}

/* rhs = the sum of C^T N e, or the right-hand side of a staged step; the sum begins anew. */
static inline void take_force(pvid_strong_estimator_f32 *self, float rhs[3])
{
    rhs[0] = self->force[0];
    rhs[1] = self->force[1];
    rhs[2] = self->force[2];
    self->force[0] = 0.0f;
    self->force[1] = 0.0f;
    self->force[2] = 0.0f;
}

/* A row with a divider above 1. */
PVID_ALWAYS_INLINE work at_divider(pvid_strong_estimator_f32 *self, const float own[3], float rhs[3])
{
    const uint32_t after = (uint32_t)self->phase + 1u;
    const uint32_t phase = (after == self->config->estimator.divider) ? 0u : after;
    const uint32_t staged = self->staged;
    const bool steps = (staged != 0u) && (phase == SOLUTION);
    self->phase = (uint16_t)phase;
    if (steps) {
        take_force(self, rhs);
    }
    if (self->mixes) {
        self->force[0] += own[0];
        self->force[1] += own[1];
        self->force[2] += own[2];
    }
    if (steps) {
        return STAGED_STEP;
    }
    if (phase == staged) {
        take_force(self, rhs);
        return (staged != 0u) ? STAGED_PROJECTION : PROJECTED_STEP;
    }
    if ((phase - FIRST_FOLD) < FOLDS) {
        fold_in_stages(self);
    }
    return ROW_ALONE;
}

/* A row in either schedule. */
PVID_ALWAYS_INLINE pvid_reason step(pvid_strong_estimator_f32 *self, const float g[3], float e)
{
    const float own[PVID_KAPITZA_P] = {g[0] * e, g[1] * e, g[2] * e};
    float rhs[PVID_KAPITZA_P];
    const bool every = self->config->estimator.divider == 1u;
    const work now = every ? at_every_row(self, own, rhs) : at_divider(self, own, rhs);
    if (now == ROW_ALONE) {
        return PVID_ACCUMULATED;
    }
    if ((now == PROJECTED_STEP) || (now == STAGED_PROJECTION)) {
        if ((PVID_DEAD_ZONE != 0) && (self->config->estimator.dead_zone > 0.0f)) {
            /* copies: g and rhs themselves stay in registers */
            const float gradient[PVID_KAPITZA_P] = {g[0], g[1], g[2]};
            float sum[PVID_KAPITZA_P] = {rhs[0], rhs[1], rhs[2]};
            return project_in_zone(self, gradient, e, sum) ? PVID_UPDATED : solve(self, sum);
        }
        project(self, own, rhs);
    }
    if (now != STAGED_STEP) {
        pvid_kapitza_add_squares_f32(g, self->s);
    }
    if (now == STAGED_PROJECTION) {
        self->force[0] = rhs[0];
        self->force[1] = rhs[1];
        self->force[2] = rhs[2];
        return PVID_ACCUMULATED;
    }
    return solve(self, rhs);
}

/* ---- rows ---- */

/* Adds a complete block and its last row to the sums; folds them where no other row does. */
static inline void end_block(pvid_strong_estimator_f32 *self, const pvid_strong_row_f32 *last)
{
    self->in_block = 0;
    self->age = (uint8_t)(self->age + PVID_STRONG_ROWS);
    pvid_kapitza_add_rows_f32(self->block, last, self->sums.low);
    if ((self->staged == 0u) && (self->age >= self->fold_every)) {
        self->age = 0;
        pvid_kapitza_fold_f32(&self->sums, 0, PVID_STRONG_SUMS);
    }
}

/* Why a row is refused whose squares exceed the limit; counts it. */
static PVID_COLD pvid_reason refuse(pvid_counters *counters, const pvid_strong_row_f32 *row)
{
    const bool finite = pvid_finite_f32(row->x[PVID_ROW_A]) && pvid_finite_f32(row->x[PVID_ROW_E]) &&
                        pvid_finite_f32(row->x[PVID_ROW_Y]) && pvid_finite_f32(row->f2) && pvid_finite_f32(row->f0) &&
                        pvid_finite_f32(row->u);
    pvid_count_up(finite ? &counters->rejected_saturated : &counters->rejected_not_finite);
    return finite ? PVID_REJECTED_SATURATED : PVID_REJECTED_NOT_FINITE;
}

/* Counts an update during the alarm. */
static PVID_COLD pvid_reason misfit(pvid_counters *counters)
{
    pvid_count_up(&counters->misfits);
    return PVID_MISFIT;
}

/* The verdict on the residuals, at the end of a block of misfit.h: no row is left. */
static inline void judge_misfit(pvid_strong_f32 *self, uint32_t left)
{
    if (left == 0u) {
        self->alarm = pvid_misfit_judge_f32(&self->misfit);
    }
}

/* Judges a row, adds it if the gate accepts it, and solves. */
PVID_ALWAYS_INLINE pvid_reason take(pvid_strong_f32 *self, const float phi[PVID_ORDERS], const float u[3])
{
    pvid_strong_estimator_f32 *estimator = &self->estimator;
    const uint32_t place = estimator->in_block;
    pvid_strong_row_f32 row;
    float g[PVID_KAPITZA_P];
    pvid_kapitza_row_f32(phi, u, &row);
    const float squares = pvid_kapitza_row_squares_f32(&row);
    const float e = pvid_kapitza_innovate_f32(estimator->p, &row, g);
    const uint32_t left = pvid_misfit_add_f32(&self->misfit, e, g[PVID_KAPITZA_W] * estimator->p[PVID_KAPITZA_W]);
    if (!pvid_gate_judges_f32(&self->gate, e * e)) {
        pvid_count_up(&estimator->counters.rejected_outlier);
        judge_misfit(self, left);
        return PVID_REJECTED_OUTLIER;
    }
    if (!(squares <= (PVID_ROW_LIMIT * PVID_ROW_LIMIT))) {
        judge_misfit(self, left);
        return refuse(&estimator->counters, &row);
    }
    pvid_count_up(&estimator->counters.rows);
    const pvid_reason reason = step(estimator, g, e);
    if (place < (PVID_STRONG_ROWS - 1u)) {
        estimator->block[place] = row;
        estimator->in_block = (uint8_t)(place + 1u);
        judge_misfit(self, left);
    } else {
        end_block(estimator, &row);
        if (left == 0u) {
            pvid_misfit_defer_f32(&self->misfit); /* to a row that does less */
        }
    }
    return ((reason == PVID_UPDATED) && self->alarm) ? misfit(&estimator->counters) : reason;
}

pvid_reason pvid_strong_row_step_f32(pvid_strong_f32 *self, const float phi[PVID_ORDERS], const float u[3])
{
    if (!is_ready(self)) {
        return PVID_NOT_READY;
    }
    if (self->frozen) {
        return PVID_HELD_FROZEN;
    }
    return take(self, phi, u);
}

pvid_reason pvid_strong_step_f32(pvid_strong_f32 *self, float phi, float y)
{
    if (!is_ready(self)) {
        return PVID_NOT_READY;
    }
    if (!pvid_finite_f32(phi) || !pvid_finite_f32(y)) {
        pvid_strong_window_reset_f32(&self->window);
        pvid_count_up(&self->estimator.counters.rejected_not_finite);
        return PVID_REJECTED_NOT_FINITE;
    }
    float d_phi[PVID_ORDERS];
    float u[3];
    if (!pvid_strong_window_step_f32(&self->window, &self->estimator.config->bank, phi, y, d_phi, u)) {
        return (self->window.missing > 0u) ? PVID_WARMING_UP : PVID_ACCUMULATED; /* or in a block */
    }
    const float drive = self->drive + (self->drive_forgetting * ((u[0] * u[0]) - self->drive));
    self->drive = pvid_finite_f32(drive) ? drive : self->drive;
    if (self->frozen) {
        return PVID_HELD_FROZEN;
    }
    if (self->drive < self->drive_min) {
        pvid_count_up(&self->estimator.counters.held_not_excited);
        return PVID_HELD_NOT_EXCITED;
    }
    return take(self, d_phi, u);
}
