/* The identifier of the strong form in integers: window, rows, gate, alarm, schedule. Private to the core.
 *
 * Included once by NAME_strong_q31.c, behind what `pvid model build` prints of a model:
 *
 *   STRONG_KINDS, _SIGNALS, _INPUTS, _COLUMNS, _P, _C   counts; columns: of N and Y of all kinds, C: its non-zeros
 *   STRONG_CHANNELS, _INTEGRANDS                        signals and integrals since the start of the run; these alone
 *   STRONG_HELD, STRONG_HELD_CHANNELS                   whether any input is held, and which
 *   STRONG(verb), strong_q31, strong_config_q31         names of its functions and types
 *   strong_model, strong_p_bits                         theta and C (pvid/model_q31.h), and the formats of p
 *   input, entry                                        rescalings of the filters' sums, and of N and Y of all kinds
 *   blocks                                              the kinds in theta and M
 *   add_tap, add_middle, row, integrands, raw_inputs    its functions
 *
 * Counts are exact up to the filters' sums; one rescaling brings a sum to an input of the row, one an entry of the row
 * to the format of the estimator, which is that of estimator_q31.h. All saturate. Source: theory.md 2 and 4, (5).
 */
#ifndef PVID_STRONG_STRONG_Q31_H
#define PVID_STRONG_STRONG_Q31_H

#include <stddef.h>
#include <string.h>

#include "judge/gate_q31.h"
#include "judge/misfit_q31.h"
#include "judge/trust_q31.h"
#include "number/count.h"
#include "number/init.h"
#include "number/rescale_q31.h"
#include "number/scaled_q31.h"
#include "number/unroll.h"
#include "solve/assess_q31.h"
#include "solve/row_q31.h"
#include "strong/fir_window.h"

/* The gate's scale averages over a quarter of a second, or so many rows, because row_sd is only a guess. */
#define GATE_MEMORY_PARTS 4u
#define GATE_MEMORY_ROWS 32u
#define GATE_FLOOR_BITS 20 /* 1e-6 of row_sd^2 */

#define HELD_UNITS 24               /* of a held input in a count: its mean is exact in them */
#define POINT_MOST (HELD_UNITS + 4) /* largest value of its mean over full scale, in them */
#define ROW_RATE_MAX ((uint32_t)1 << 30)

/* Whether init has accepted a configuration. */
static inline bool is_ready(const strong_q31 *self)
{
    const bool ready = (self != NULL) && (self->config != NULL);
    PVID_ASSERT(ready);
    return ready;
}

/* ---- configuration ---- */

static PVID_COLD void window_reset(strong_q31 *self)
{
    self->head = 0;
    self->missing = self->length;
    self->before = 0;
}

/* The largest sum of each order, each point with the sign of its weight, is below 2^62. */
static PVID_COLD bool sums_fit(const pvid_bank_q31 *bank, int32_t full_scale)
{
    const uint64_t range = 4u * (uint64_t)((STRONG_HELD != 0) ? POINT_MOST : 1) * (uint64_t)full_scale;
    bool fit = true;
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        uint64_t sum = (k == 0u) ? (uint64_t)bank->centre : 0u;
        for (size_t i = 0; i < bank->half; i++) {
            sum += pvid_magnitude_q31(bank->weights[(k * bank->half) + i]);
        }
        fit = fit && (sum <= ((uint64_t)PVID_WIDE / range));
    }
    return fit;
}

static PVID_COLD pvid_status window_init(strong_q31 *self, const strong_config_q31 *config)
{
    const pvid_bank_q31 *bank = &config->bank;
    const pvid_status status = pvid_fir_window(bank->half, bank->stride);
    if (status != PVID_OK) {
        return status;
    }
    if (bank->weights == NULL) {
        return PVID_BAD_BANK;
    }
    if ((bank->centre < 1) || (bank->centre > PVID_ONE_Q30)) {
        return PVID_BAD_CENTRE;
    }
    for (size_t i = 0; i < STRONG_SIGNALS; i++) {
        const int32_t full_scale = config->full_scale[i];
        if ((full_scale < 1) || (full_scale > PVID_FULL_SCALE_LIMIT_Q31) || !sums_fit(bank, full_scale)) {
            return PVID_BAD_FULL_SCALE;
        }
    }
#if STRONG_INTEGRANDS
    if (!sums_fit(bank, PVID_FULL_SCALE_LIMIT_Q31)) {
        return PVID_BAD_FULL_SCALE;
    }
#endif
    self->length = (uint16_t)((2u * (uint32_t)bank->half * bank->stride) + 1u);
    window_reset(self);
    return PVID_OK;
}

static PVID_COLD pvid_status prepare(strong_q31 *self, const strong_config_q31 *config)
{
    memset(self, 0, sizeof *self);
    pvid_status status = window_init(self, config);
    if (status != PVID_OK) {
        return status;
    }
    if ((config->rows_per_second < 1u) || (config->rows_per_second > ROW_RATE_MAX)) {
        return PVID_BAD_DRIVE_TICKS;
    }
    for (size_t a = 0; a < STRONG_P; a++) {
        if (config->estimator.p_bits[a] != strong_p_bits[a]) {
            return PVID_BAD_FORMAT;
        }
    }
    if (!pvid_trust_shared_are_valid_q31(config->shared, STRONG_P)) {
        return PVID_BAD_SHARED;
    }
    pvid_estimator_config_q31 estimator = config->estimator;
    estimator.model = &strong_model;
    status = pvid_estimator_init_q31(&self->estimator, &estimator);
    if (status != PVID_OK) {
        return status;
    }
    self->config = config;
    pvid_misfit_init_q31(&self->misfit, config->rows_per_second, estimator.forgetting_groups);
    const uint32_t memory = config->rows_per_second / GATE_MEMORY_PARTS;
    const pvid_scaled_q31 floor = pvid_scaled_plus_q31(
        pvid_scaled_shifted_q31(pvid_assess_row_variance_q31(&self->estimator.settings, 0), -GATE_FLOOR_BITS),
        pvid_scaled_of_q31(1, 0)); /* and the rounding of a row's terms */
    return pvid_gate_init_q31(&self->gate, &config->gate, (memory > GATE_MEMORY_ROWS) ? memory : GATE_MEMORY_ROWS,
                              floor);
}

PVID_COLD pvid_status STRONG(init_layout)(strong_q31 *self, const strong_config_q31 *config, uint32_t layout)
{
    if ((layout != PVID_LAYOUT) || (pvid_layout() != PVID_LAYOUT)) {
        return PVID_BAD_LAYOUT;
    }
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

void STRONG(freeze)(strong_q31 *self, bool frozen)
{
    if (is_ready(self)) {
        self->frozen = frozen;
    }
}

void STRONG(gap)(strong_q31 *self)
{
    if (is_ready(self)) {
        window_reset(self);
    }
}

void STRONG(assess)(const strong_q31 *self, pvid_estimate_q31 *estimate)
{
    if ((self != NULL) && (estimate != NULL)) {
        pvid_estimator_assess_q31(&self->estimator, estimate);
        pvid_trust_add_shared_q31((self->config != NULL) ? self->config->shared : NULL, &strong_model, estimate);
    }
}

/* ---- counts to inputs of a row ---- */

/* Counts about their offsets; whether all are within full scale. */
static inline bool counts_of(const strong_config_q31 *config, const int32_t reading[STRONG_SIGNALS],
                             int32_t counts[STRONG_SIGNALS])
{
    bool within = true;
    for (size_t i = 0; i < STRONG_SIGNALS; i++) {
        const int64_t count = (int64_t)reading[i] - config->offset[i];
        within = within && (count >= -(int64_t)config->full_scale[i]) && (count <= config->full_scale[i]);
        counts[i] = (int32_t)pvid_clamp_q31(count, PVID_FULL_SCALE_LIMIT_Q31);
    }
    return within;
}

#if STRONG_INTEGRANDS
/* The counts, and the integrals since the start of the run by the trapezoid rule; a reading beyond full scale or reach
 * repeats the one before. An integral saturates at twice its reach, where the rows refuse it. */
static void integrate(strong_q31 *self, const int32_t counts[STRONG_SIGNALS], bool within, int32_t now[STRONG_CHANNELS])
{
    int32_t rate[STRONG_INTEGRANDS];
    memcpy(rate, self->integrand, sizeof rate);
    bool fresh = false;
    if (within) {
        int32_t in[STRONG_INPUTS] = {0};
        raw_inputs(counts, in);
        fresh = integrands(in, rate);
    }
    for (size_t i = 0; i < STRONG_INTEGRANDS; i++) {
        if (self->is_running) {
            const int64_t twice = (int64_t)self->integrand[i] + rate[i];
            self->integral[i] = pvid_clamp_q31(self->integral[i] + twice, PVID_WIDE / 2);
        }
        self->integrand[i] = rate[i];
        now[STRONG_SIGNALS + i] = (int32_t)pvid_clamp_q31(pvid_round_shift_q31(self->integral[i], integral_down[i]),
                                                          PVID_FULL_SCALE_LIMIT_Q31);
    }
    self->is_running = self->is_running || fresh;
    memcpy(now, counts, STRONG_SIGNALS * sizeof counts[0]);
}
#endif

#if STRONG_HELD
/* The values at the instant of the sample before the last: of a held input 24 times its mean around the instant, exact
 * to the fourth order. False until there are four samples. */
static bool centre(strong_q31 *self, int32_t counts[STRONG_CHANNELS])
{
    static const bool held[STRONG_CHANNELS] = STRONG_HELD_CHANNELS;
    for (size_t i = 0; i < STRONG_CHANNELS; i++) {
        int32_t *past = self->past[i];
        const int32_t now = counts[i];
        counts[i] = held[i] ? ((13 * (past[1] + past[2])) - (past[0] + now)) : past[2];
        past[0] = past[1];
        past[1] = past[2];
        past[2] = now;
    }
    const bool full = self->before >= 3u;
    self->before = full ? self->before : (uint8_t)(self->before + 1u);
    return full;
}
#endif

/* Takes a count of each signal. Returns whether the window is full. */
static inline bool window_takes(strong_q31 *self, int32_t counts[STRONG_CHANNELS])
{
#if STRONG_HELD
    if (!centre(self, counts)) {
        return false;
    }
#endif
    memcpy(self->points[self->head], counts, sizeof self->points[0]);
    const uint32_t next = (uint32_t)self->head + 1u;
    self->head = (uint16_t)((next == self->length) ? 0u : next);
    self->missing = (uint16_t)((self->missing > 0u) ? (self->missing - 1u) : 0u);
    return self->missing == 0u;
}

/* The inputs by the bank's filters. */
static PVID_NOINLINE void filter(const strong_q31 *self, int32_t in[STRONG_INPUTS])
{
    const pvid_bank_q31 *bank = &self->config->bank;
    const size_t length = self->length;
    const size_t stride = bank->stride;
    const size_t middle = (size_t)self->head + ((size_t)bank->half * stride); /* head: the oldest point */
    size_t newer = (middle >= length) ? (middle - length) : middle;
    size_t older = newer;
    const int32_t *x = self->points[newer];
    int64_t sum[STRONG_INPUTS];
    add_middle(bank->centre, x, sum);
    for (size_t i = 0; i < bank->half; i++) {
        newer += stride;
        newer = (newer >= length) ? (newer - length) : newer;
        older = (older < stride) ? ((older + length) - stride) : (older - stride);
        add_tap(&bank->weights[i], bank->half, x, self->points[newer], self->points[older], sum);
    }
    PVID_UNROLL
    for (size_t i = 0; i < STRONG_INPUTS; i++) {
        in[i] = pvid_rescaled_q31(sum[i], &input[i]);
    }
}

/* ---- rows ---- */

/* What p[0] does to theta: its part of C times p[0], or start_sd[0] where p[0] may be zero, in one format. */
static PVID_NOINLINE void sense(strong_q31 *self)
{
    const pvid_estimator_q31 *estimator = &self->estimator;
    const int32_t reference =
        pvid_is_positive_q31(&strong_model, 0) ? estimator->p[0] : estimator->settings.start_sd[0];
    const pvid_scaled_q31 by = pvid_scaled_of_q31(reference, 0);
    int64_t c[STRONG_C];
    pvid_scaled_q31 own[STRONG_C]; /* those of p[0] are the first */
    strong_model.jacobian(estimator->p, c);
    const size_t end = (strong_model.c_column[0] == 0u) ? pvid_column_end_q31(&strong_model, 0) : 0u;
    int32_t largest = PVID_ZERO_EXPONENT_Q31;
    for (size_t k = 0; k < end; k++) {
        own[k] = pvid_scaled_times_q31(pvid_scaled_of_q31(c[k], estimator->c_exponent[k]), by);
        largest = ((own[k].m != 0) && (own[k].e > largest)) ? own[k].e : largest;
    }
    memset(self->sense, 0, sizeof self->sense);
    self->sense_shift = (int16_t)-(largest + 1);
    for (size_t k = 0; k < end; k++) {
        self->sense[strong_model.c_row[k]] = (int32_t)pvid_scaled_fixed_q31(own[k], self->sense_shift); /* <= 2^29 */
    }
}

/* p[0] dY/dp[0] of a row. */
static inline int64_t sensitivity(const strong_q31 *self, const pvid_block *block, const int32_t n[])
{
    int64_t sum = 0;
    for (size_t i = 0; i < block->n; i++) {
        sum += pvid_short_product_q31(n[i], self->sense[block->first + i]); /* |n| <= 2^28, at most 31 terms */
    }
    return pvid_scale_q31(sum, self->sense_shift);
}

static PVID_COLD pvid_reason refuse(strong_q31 *self)
{
    pvid_count_up(&self->estimator.counters.rejected_saturated);
    return PVID_REJECTED_SATURATED;
}

/* Adds the rows of an instant and solves when it is time; counts an update during the alarm. */
static PVID_NOINLINE pvid_reason add(strong_q31 *self, const int32_t n[STRONG_COLUMNS], const int32_t e[STRONG_KINDS])
{
    for (size_t k = 0; k < STRONG_KINDS; k++) {
        pvid_estimator_add_row_q31(&self->estimator, &blocks[k], &n[blocks[k].first + k], e[k], pvid_square_q31(e[k]));
    }
    const pvid_reason reason = pvid_estimator_update_q31(&self->estimator);
    if ((reason != PVID_UPDATED) || !self->alarm) {
        return reason;
    }
    pvid_count_up(&self->estimator.counters.misfits);
    return PVID_MISFIT;
}

/* Judges the rows of an instant, adds them if the gate accepts them, and solves. One verdict for all kinds. */
static pvid_reason take(strong_q31 *self, const int32_t in[STRONG_INPUTS])
{
    int32_t n[STRONG_COLUMNS];
    int32_t e[STRONG_KINDS];
    int64_t square = 0;
    int64_t signal = 0;
    if (!row(in, n)) {
        return refuse(self);
    }
    PVID_UNROLL
    for (size_t i = 0; i < STRONG_COLUMNS; i++) {
        n[i] = pvid_rescaled_q31(n[i], &entry[i]);
    }
    if (((self->misfit.left % PVID_MISFIT_FEW) == 0u) || (self->misfit.left == self->misfit.block)) {
        sense(self);
    }
    for (size_t k = 0; k < STRONG_KINDS; k++) {
        const int32_t *own = &n[blocks[k].first + k];
        int64_t rest;
        if (!pvid_estimator_innovation_q31(&self->estimator, &blocks[k], own, own[blocks[k].n], &rest)) {
            return refuse(self);
        }
        e[k] = (int32_t)rest;
        square += pvid_square_q31(e[k]);
        signal += pvid_misfit_signal_q31(sensitivity(self, &blocks[k], own));
    }
    if (pvid_misfit_add_q31(&self->misfit, square, signal)) {
        self->alarm = pvid_misfit_judge_q31(&self->misfit);
    }
    if ((self->gate.limit.m != 0) && !pvid_gate_passes_q31(&self->gate, pvid_scaled_of_q31(square, 0))) {
        pvid_count_up(&self->estimator.counters.rejected_outlier);
        return PVID_REJECTED_OUTLIER;
    }
    return add(self, n, e);
}

pvid_reason STRONG(step)(strong_q31 *self, const int32_t reading[STRONG_SIGNALS])
{
    if (!is_ready(self)) {
        return PVID_NOT_READY;
    }
    int32_t now[STRONG_CHANNELS];
#if STRONG_INTEGRANDS
    int32_t counts[STRONG_SIGNALS];
    const bool within = counts_of(self->config, reading, counts);
    integrate(self, counts, within, now);
#else
    const bool within = counts_of(self->config, reading, now);
#endif
    if (!within) {
        window_reset(self);
        return refuse(self);
    }
    if (!window_takes(self, now)) {
        return PVID_WARMING_UP;
    }
    if (self->frozen) {
        return PVID_HELD_FROZEN;
    }
    int32_t in[STRONG_INPUTS];
    filter(self, in);
    return take(self, in);
}

#endif
