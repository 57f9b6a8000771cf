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
    const bool ready = (self != NULL) && (self->window.length != 0u);
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
    self->drive_forgetting = (config->sample_rate_hz > 1.0f) ? (1.0f / config->sample_rate_hz) : 1.0f;
    self->drive_min = config->drive_min * config->drive_min;
    status = pvid_kapitza_estimator_init_f32(&self->estimator, config);
    if (status != PVID_OK) {
        return status;
    }
    pvid_misfit_init_f32(&self->misfit, config->sample_rate_hz, config->estimator.forgetting_s);
    return pvid_gate_init_f32(&self->gate, &config->gate, config->sample_rate_hz,
                              GATE_MEMORY_S * config->sample_rate_hz, GATE_FLOOR * self->estimator.row_variance);
}

pvid_status pvid_strong_init_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config)
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

/* Solves (S + H0) dp = rhs and moves p. */
PVID_ALWAYS_INLINE pvid_reason solve(pvid_strong_estimator_f32 *self, const float s[6], const float rhs[3])
{
    pvid_kapitza_factor_f32 factor;
    pvid_reason reason = pvid_kapitza_factorise_f32(self, s, &factor);
    if (reason == PVID_UPDATED) {
        float dp[PVID_KAPITZA_P];
        pvid_kapitza_back_f32(&factor, rhs, dp);
        reason = pvid_kapitza_move_f32(self, dp);
    }
    return (reason == PVID_UPDATED) ? reason : pvid_count_held(&self->counters, reason);
}

/* The same as a function of its own, where it does not run at every row. */
static PVID_SELDOM pvid_reason solve_apart(pvid_strong_estimator_f32 *self, const float s[6], const float rhs[3])
{
    return solve(self, s, rhs);
}

/* g F + (1 - g) sum C^T N e */
static inline void mix(float gain, const float innovation[3], float force[3])
{
    const float rest = 1.0f - gain;
    force[0] = (gain * force[0]) + (rest * innovation[0]);
    force[1] = (gain * force[1]) + (rest * innovation[1]);
    force[2] = (gain * force[2]) + (rest * innovation[2]);
}

/* A solve with a dead zone is always exact and needs the residuals. */
static PVID_SELDOM pvid_reason solve_in_zone(pvid_strong_estimator_f32 *self, const float g[3], float e,
                                             const float innovation[3])
{
    float s[6];
    float force[PVID_KAPITZA_P];
    float x[PVID_KAPITZA_P];
    pvid_kapitza_residual_f32 residual;
    pvid_kapitza_factor_f32 factor;
    pvid_kapitza_gather_f32(self, s, force, &residual);
    pvid_kapitza_add_squares_f32(g, s);
    pvid_kapitza_add_products_f32(g, e, force);
    residual.rss += e * e;
    residual.weight += 1.0f;
    if (pvid_kapitza_factorise_f32(self, s, &factor) == PVID_UPDATED) {
        pvid_kapitza_back_f32(&factor, force, x);
        const float square = ((force[0] * x[0]) + (force[1] * x[1])) + (force[2] * x[2]);
        if (pvid_kapitza_is_at_rest_f32(self, square, &residual)) {
            pvid_count_up(&self->counters.at_rest);
            return PVID_UPDATED;
        }
    }
    mix(self->gain, innovation, force);
    return solve_apart(self, s, force);
}

/* A row with divider 1: a solve, from all sums at every exact_every-th row. */
PVID_ALWAYS_INLINE pvid_reason step_at_every_row(pvid_strong_estimator_f32 *self, const float g[3], float e)
{
    float rhs[PVID_KAPITZA_P] = {g[0] * e, g[1] * e, g[2] * e};
    uint32_t phase = self->phase;
    if (phase == 0u) {
        phase = self->exact_every;
        if (phase == 0u) {
            const float innovation[PVID_KAPITZA_P] = {rhs[0], rhs[1], rhs[2]};
            const float gradient[PVID_KAPITZA_P] = {g[0], g[1], g[2]};
            return solve_in_zone(self, gradient, e, innovation);
        }
        float force[PVID_KAPITZA_P];
        pvid_kapitza_gather_f32(self, self->s, force, NULL);
        const float gain = self->gain;
        const float rest = 1.0f - gain;
        rhs[0] = (gain * (force[0] + rhs[0])) + (rest * rhs[0]);
        rhs[1] = (gain * (force[1] + rhs[1])) + (rest * rhs[1]);
        rhs[2] = (gain * (force[2] + rhs[2])) + (rest * rhs[2]);
    }
    self->phase = (uint16_t)(phase - 1u);
    pvid_kapitza_add_squares_f32(g, self->s);
    return solve(self, self->s, rhs);
}

/* Rows of a staged round, by their number from 1; the last has number 0. */
#define PROJECTION 1u
#define SOLUTION 2u
#define FIRST_FOLD 5u
#define FOLDS 3u

/* Thirds of the sums, which staged rows fold one by one. */
static inline size_t third(size_t i)
{
    return (PVID_STRONG_SUMS * i) / FOLDS;
}

/* A part of the fold at rows 4, 5, 6 of a staged round: between two blocks, after projection and solve. */
static PVID_SELDOM void fold_in_stages(pvid_strong_estimator_f32 *self)
{
    const size_t place = self->in_block;
    if ((self->staged != 0u) && (place < (PVID_STRONG_ROWS - 1u)) && (self->age >= self->fold_every)) {
        pvid_kapitza_fold_f32(&self->sums, third(place), third(place + 1u));
        self->age = (place == (PVID_STRONG_ROWS - 2u)) ? (uint8_t)(self->age - self->fold_every) : self->age;
    }
}

/* S and F from all rows at this row; the sum of C^T N e begins anew. With a dead zone the solve as well. */
static PVID_SELDOM pvid_reason project(pvid_strong_estimator_f32 *self, const float g[3], float e)
{
    const float innovation[PVID_KAPITZA_P] = {self->innovation[0], self->innovation[1], self->innovation[2]};
    self->innovation[0] = 0.0f;
    self->innovation[1] = 0.0f;
    self->innovation[2] = 0.0f;
    if (self->dead_zone > 0.0f) {
        return solve_in_zone(self, g, e, innovation);
    }
    pvid_kapitza_gather_f32(self, self->s, self->force, NULL);
    pvid_kapitza_add_squares_f32(g, self->s);
    pvid_kapitza_add_products_f32(g, e, self->force);
    mix(self->gain, innovation, self->force);
    return (self->staged != 0u) ? PVID_ACCUMULATED : solve_apart(self, self->s, self->force);
}

/* A row with a divider above 1. */
PVID_ALWAYS_INLINE pvid_reason step_at_divider(pvid_strong_estimator_f32 *self, const float g[3], float e)
{
    const uint32_t next = (uint32_t)self->phase + 1u;
    const uint32_t phase = (next == self->divider) ? 0u : next;
    self->phase = (uint16_t)phase;
    if (self->mixes) {
        pvid_kapitza_add_products_f32(g, e, self->innovation);
    }
    if (phase == self->projects_at) {
        const float gradient[PVID_KAPITZA_P] = {g[0], g[1], g[2]};
        return project(self, gradient, e);
    }
    if (phase == SOLUTION) {
        return (self->staged != 0u) ? solve_apart(self, self->s, self->force) : PVID_ACCUMULATED;
    }
    if ((phase - FIRST_FOLD) < FOLDS) {
        fold_in_stages(self);
    }
    return PVID_ACCUMULATED;
}

/* ---- rows ---- */

/* Adds a complete block to the sums; folds them where no other row does. */
static inline void end_block(pvid_strong_estimator_f32 *self)
{
    self->in_block = 0;
    self->age = (uint8_t)(self->age + PVID_STRONG_ROWS);
    pvid_kapitza_add_rows_f32(self->block, self->sums.low);
    if ((self->staged == 0u) && (self->age >= self->fold_every)) {
        self->age = 0;
        pvid_kapitza_fold_f32(&self->sums, 0, PVID_STRONG_SUMS);
    }
}

/* Why a row is refused whose squares exceed the limit; counts it. */
static PVID_SELDOM pvid_reason refuse(pvid_counters *counters, const pvid_strong_row_f32 *row)
{
    const bool finite = pvid_finite_f32(row->y) && pvid_finite_f32(row->a) && pvid_finite_f32(row->e) &&
                        pvid_finite_f32(row->f2) && pvid_finite_f32(row->f0) && pvid_finite_f32(row->u);
    pvid_count_up(finite ? &counters->rejected_saturated : &counters->rejected_not_finite);
    return finite ? PVID_REJECTED_SATURATED : PVID_REJECTED_NOT_FINITE;
}

/* Counts an update during the alarm. */
static PVID_SELDOM pvid_reason misfit(pvid_counters *counters)
{
    pvid_count_up(&counters->misfits);
    return PVID_MISFIT;
}

/* The verdict on the residuals, at the end of a block of misfit.h. */
static inline void judge_misfit(pvid_strong_f32 *self)
{
    if (self->misfit.left == 0u) {
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
    estimator->block[place] = row;
    const float squares = pvid_kapitza_row_squares_f32(&row);
    const float e = pvid_kapitza_innovate_f32(estimator->p, &row, g);
    pvid_misfit_add_f32(&self->misfit, e, g[PVID_KAPITZA_W] * estimator->p[PVID_KAPITZA_W]);
    if (!pvid_gate_judges_f32(&self->gate, e * e)) {
        pvid_count_up(&estimator->counters.rejected_outlier);
        judge_misfit(self);
        return PVID_REJECTED_OUTLIER;
    }
    if (!(squares <= (PVID_ROW_LIMIT * PVID_ROW_LIMIT))) {
        judge_misfit(self);
        return refuse(&estimator->counters, &estimator->block[place]);
    }
    pvid_count_up(&estimator->counters.rows);
    const pvid_reason reason =
        (estimator->divider == 1u) ? step_at_every_row(estimator, g, e) : step_at_divider(estimator, g, e);
    if (place < (PVID_STRONG_ROWS - 1u)) {
        estimator->in_block = (uint8_t)(place + 1u);
        judge_misfit(self);
    } else {
        end_block(estimator);
        pvid_misfit_defer_f32(&self->misfit); /* to a row that does less */
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
    if (!pvid_strong_window_step_f32(&self->window, phi, y, d_phi, u)) {
        return PVID_WARMING_UP;
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
