#include "pvid/strong_q31.h"

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "number/init.h"
#include "number/count.h"
#include "solve/assess_q31.h"
#include "number/integer_q31.h"
#include "judge/misfit_q31.h"
#include "number/scaled_q31.h"
#include "number/unroll.h"

#define SHIFT_MAX 62u
#define DERIVATIVE_LIMIT_BITS 30u /* of PVID_DERIVATIVE_LIMIT_Q31 */
#define RATE_LIMIT_BITS 29u       /* of PVID_KAPITZA_RATE_LIMIT_Q31 */
#define DRIVE_TICKS_MAX ((uint32_t)1 << 30)
#define DRIVE_MAX ((int64_t)PVID_DERIVATIVE_LIMIT_Q31 * PVID_DERIVATIVE_LIMIT_Q31) /* a mean of such squares */

/* The gate's scale averages over about a period of the faster mode, because row_sd is only a guess. */
#define GATE_MEMORY_PARTS 4u
#define GATE_FLOOR_BITS 20 /* 1e-6 of its square */

/* The gate's least scale: a part of row_sd^2, at least the rounding of a row's dozen terms. */
static pvid_scaled_q31 gate_floor(const pvid_kapitza_estimator_q31 *estimator)
{
    const pvid_scaled_q31 rounding = pvid_scaled_of_q31(1, 0);
    return pvid_scaled_plus_q31(
        pvid_scaled_shifted_q31(pvid_assess_row_variance_q31(&estimator->settings, 0), -GATE_FLOOR_BITS), rounding);
}

static bool shifts_are_valid(const uint8_t shift[PVID_Y_ORDERS_Q31])
{
    bool valid = true;
    for (size_t k = 0; k < PVID_Y_ORDERS_Q31; k++) {
        valid = valid && (shift[k] <= SHIFT_MAX);
    }
    return valid;
}

static bool multipliers_are_valid(const int32_t multiplier[PVID_Y_ORDERS_Q31])
{
    bool valid = true;
    for (size_t k = 0; k < PVID_Y_ORDERS_Q31; k++) {
        valid = valid && (multiplier[k] > 0);
    }
    return valid;
}

/* Whether init has accepted a configuration. */
static inline bool is_ready(const pvid_strong_q31 *self)
{
    const bool ready = (self != NULL) && self->estimator.ready;
    PVID_ASSERT(ready);
    return ready;
}

static pvid_status prepare(pvid_strong_q31 *self, const pvid_strong_config_q31 *config)
{
    if (!shifts_are_valid(config->u_shift)) {
        return PVID_BAD_SHIFT;
    }
    if (!multipliers_are_valid(config->u_multiplier)) {
        return PVID_BAD_U_MULTIPLIER;
    }
    if ((config->drive_min < 0) || (config->drive_min > PVID_DERIVATIVE_LIMIT_Q31)) {
        return PVID_BAD_DRIVE_MIN;
    }
    if ((config->drive_ticks < 1u) || (config->drive_ticks > DRIVE_TICKS_MAX)) {
        return PVID_BAD_DRIVE_TICKS;
    }
    memset(self, 0, sizeof *self);
    pvid_status status = pvid_differentiator_init_q31(&self->differentiator, &config->bank);
    if (status != PVID_OK) {
        return status;
    }
    self->row = config->row;
    memcpy(self->u_multiplier, config->u_multiplier, sizeof self->u_multiplier);
    memcpy(self->u_shift, config->u_shift, sizeof self->u_shift);
    self->phi_offset = config->phi_offset;
    self->y_offset = config->y_offset;
    self->drive_min = (int64_t)config->drive_min * config->drive_min;
    self->drive_forgetting = (int32_t)(INT32_MAX / config->drive_ticks);
    status = pvid_kapitza_estimator_init_q31(&self->estimator, &config->estimator, &config->row);
    if (status != PVID_OK) {
        return status;
    }
    pvid_misfit_init_q31(&self->misfit, config->drive_ticks, config->estimator.forgetting_groups);
    return pvid_gate_init_q31(&self->gate, &config->gate, config->drive_ticks / GATE_MEMORY_PARTS,
                              gate_floor(&self->estimator));
}

PVID_COLD pvid_status pvid_strong_init_q31(pvid_strong_q31 *self, const pvid_strong_config_q31 *config)
{
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

static void restart(pvid_strong_q31 *self)
{
    pvid_differentiator_reset_q31(&self->differentiator);
}

void pvid_strong_gap_q31(pvid_strong_q31 *self)
{
    if (is_ready(self)) {
        restart(self);
    }
}

void pvid_strong_freeze_q31(pvid_strong_q31 *self, bool frozen)
{
    if (is_ready(self)) {
        self->frozen = frozen;
    }
}

static bool is_within(int64_t x, int32_t limit)
{
    return (x >= -(int64_t)limit) && (x <= limit);
}

static pvid_reason refuse(pvid_strong_q31 *self)
{
    pvid_count_up(&self->estimator.counters.rejected_saturated);
    return PVID_REJECTED_SATURATED;
}

/* *out = x 2^-shift; whether that is within `bits`. */
static inline bool acceleration(int64_t x, uint32_t shift, uint32_t bits, int32_t *out)
{
    return pvid_narrows_q31(x, shift, bits, out);
}

/* u[k] = y_A^(k+2)/l1; false where one is beyond the expected range. */
static bool accelerations(const pvid_strong_q31 *self, const int32_t d_y[], int32_t u[])
{
    bool within = true;
    for (size_t k = 0; within && (k < PVID_Y_ORDERS_Q31); k++) {
        within = acceleration(pvid_product_q31(d_y[k], self->u_multiplier[k]), self->u_shift[k],
                              (k == 0u) ? RATE_LIMIT_BITS : DERIVATIVE_LIMIT_BITS, &u[k]);
    }
    return within;
}

/* Returns whether the gate accepts a row with an innovation of this square. */
static bool passes(pvid_strong_q31 *self, int64_t square)
{
    return (self->gate.limit.m == 0) || pvid_gate_passes_q31(&self->gate, pvid_scaled_of_q31(square, 0));
}

/* Judges a row, adds it if the gate accepts it, and solves. */
static pvid_reason take_row(pvid_strong_q31 *self, const int32_t row[PVID_KAPITZA_ROW_Q31])
{
    pvid_kapitza_estimator_q31 *estimator = &self->estimator;
    int32_t gradient[PVID_KAPITZA_P] = {0, 0, 0};
    int32_t e = 0;
    if (!pvid_kapitza_estimator_innovate_q31(estimator, row, &e, gradient)) {
        return refuse(self);
    }
    const int64_t square = pvid_square_q31(e);
    const int64_t sensitivity = pvid_product_q31(gradient[PVID_KAPITZA_W], estimator->p[PVID_KAPITZA_W]);
    if (pvid_misfit_add_q31(&self->misfit, square,
                            pvid_misfit_signal_q31(pvid_round_shift_q31(sensitivity, PVID_KAPITZA_W_BITS)))) {
        self->alarm = pvid_misfit_judge_q31(&self->misfit);
    }
    if (!passes(self, square)) {
        pvid_count_up(&estimator->counters.rejected_outlier);
        return PVID_REJECTED_OUTLIER;
    }
    const pvid_reason reason = pvid_kapitza_estimator_take_q31(estimator, row, e, gradient);
    if ((reason != PVID_UPDATED) || !self->alarm) {
        return reason;
    }
    pvid_count_up(&estimator->counters.misfits);
    return PVID_MISFIT;
}

pvid_reason pvid_strong_step_q31(pvid_strong_q31 *self, int32_t phi, int32_t y)
{
    if (!is_ready(self)) {
        return PVID_NOT_READY;
    }
    const int64_t angle = (int64_t)phi - self->phi_offset;
    const int64_t height = (int64_t)y - self->y_offset;
    if (!is_within(angle, self->differentiator.bank.phi_max) || !is_within(height, self->differentiator.bank.y_max)) {
        restart(self);
        return refuse(self);
    }
    int32_t d_phi[PVID_ORDERS];
    int32_t d_y[PVID_Y_ORDERS_Q31];
    if (!pvid_differentiator_step_q31(&self->differentiator, (int32_t)angle, (int32_t)height, d_phi, d_y)) {
        return (self->differentiator.missing > 0u) ? PVID_WARMING_UP : PVID_ACCUMULATED; /* or in a block */
    }
    int32_t u[PVID_Y_ORDERS_Q31] = {0, 0, 0};
    if (!accelerations(self, d_y, u)) {
        return refuse(self);
    }
    const int64_t fresh = pvid_times_q31(pvid_square_q31(u[0]) - self->drive, self->drive_forgetting);
    self->drive = pvid_clamp_q31(self->drive + fresh, DRIVE_MAX);
    if (self->frozen) {
        return PVID_HELD_FROZEN;
    }
    if (self->drive < self->drive_min) {
        pvid_count_up(&self->estimator.counters.held_not_excited);
        return PVID_HELD_NOT_EXCITED;
    }
    int32_t row[PVID_KAPITZA_ROW_Q31];
    if (!pvid_kapitza_strong_row_q31(&self->row, d_phi, u, row)) {
        return refuse(self);
    }
    return take_row(self, row);
}
