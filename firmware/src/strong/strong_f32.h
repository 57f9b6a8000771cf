/* The identifier of the strong form: window, rows, schedule of the solves, gate, alarm, accuracy. Private to the core.
 *
 * Included once by NAME_strong_f32.c, behind what `pvid model build` prints of a model:
 *
 *   STRONG_P, _KINDS, _SIGNALS, _CHANNELS, _INPUTS, _ATOMS, _SUMS, _S     counts; S: entries of a triangle of S
 *   STRONG_WEIGHT                                                         place of the weight among the sums
 *   STRONG_POSITIVE, STRONG_HELD                                          bits of p > 0; whether an input is held
 *   STRONG_CONSTRAINTS, tied                                              how many; a model with them alone
 *   STRONG(verb), strong_f32, strong_config_f32, ..                       names of its functions and types
 *   inputs_of_five, inputs_of_bank, atoms_of, innovate, ..                its functions
 *
 * Every function of a tick is inlined into one: rows and sums have constant places, and what a model does not need
 * costs nothing. Source: theory.md 2 and 4, equation (5).
 */
#ifndef PVID_STRONG_F32_H
#define PVID_STRONG_F32_H

#include <stddef.h>
#include <string.h>

#include "judge/gate_f32.h"
#include "judge/misfit_f32.h"
#include "judge/trust_f32.h"
#include "number/count.h"
#include "number/finite_f32.h"
#include "number/init.h"
#include "number/unroll.h"
#include "pvid/fnv_word.h"
#include "solve/assess_f32.h"
#include "solve/commit.h"
#include "solve/constraints_f32.h"
#include "solve/settings_f32.h"
#include "solve/step_f32.h"
#include "strong/differentiator_f32.h"

/* The gate's scale averages over so long, or so many rows, because row_sd is only a guess. */
#define GATE_MEMORY_S 0.25f
#define GATE_MEMORY_ROWS 32.0f
#define GATE_FLOOR 1.0e-6f

/* Rounding of the residual sum, relative to its largest parts: a few ulp of each term. */
#define RESIDUAL_FLOOR 4.8e-7f

/* Most rows between folds: long enough to be cheap, short enough that `low` keeps 17 bits of a row's terms. */
#define FOLD_MAX 64u

/* A sixteenth of the time constant of forgetting, in rows. */
#define FOLDS_PER_CONSTANT 16.0f

/* Rows between exact projections, where no other number is configured. */
#define EXACT_EVERY 8u

/* Whether init has accepted a configuration. */
static inline bool is_ready(const strong_f32 *self)
{
    const bool ready = (self != NULL) && (self->estimator.config != NULL);
    PVID_ASSERT(ready);
    return ready;
}

/* ---- samples to inputs of a row ---- */

/* Whether the bank has the weights of pvid_five_points_f32, wherever they are stored: then its sums are written out. */
static bool is_five_points(const pvid_fir_bank_f32 *bank)
{
    bool equal = (bank->half == 2u) && (bank->block <= 1u);
    for (size_t i = 0; equal && (i < (size_t)PVID_ORDERS * 2u); i++) {
        equal = pvid_bits_f32(bank->weights[i]) == pvid_bits_f32(pvid_five_points_f32[i]);
    }
    return equal;
}

static PVID_COLD void window_reset(strong_window_f32 *self)
{
    self->head = 0;
    self->at = 0;
    self->five_points = (self->five_points != 0u) ? 1u : 0u;
    self->missing = (uint16_t)(self->length - self->five_points); /* five points need one sample less: see below */
    self->before = 0;
}

static PVID_COLD pvid_status window_init(strong_window_f32 *self, const strong_config_f32 *config)
{
    static const float of_five[PVID_ORDERS] = {1.0f, 1.0f / 12.0f, 1.0f / 12.0f, 0.5f, 1.0f};
    const pvid_fir_bank_f32 *bank = &config->bank;
    const pvid_status status = pvid_fir_bank_is_valid_f32(bank, config->sample_rate_hz);
    if (status != PVID_OK) {
        return status;
    }
    self->stride = bank->stride;
    self->length = pvid_fir_length_f32(bank);
    self->five_points = is_five_points(bank) ? 1u : 0u;
    const uint32_t block = pvid_fir_block_f32(bank);
    const float rate = config->sample_rate_hz / (float)(block * bank->stride);
    const float share = 1.0f / (float)block;
    float power = 1.0f;
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        self->scale[k] = power * ((self->five_points != 0u) ? of_five[k] : share);
        power *= rate;
    }
    window_reset(self);
    return PVID_OK;
}

/* The place in the ring so many places after another. */
static inline size_t place_after(const strong_window_f32 *self, size_t place, size_t ahead)
{
    const size_t after = place + ahead;
    return (after >= self->length) ? (after - self->length) : after;
}

#if STRONG_HELD
/* The values at the instant of the sample before the last: of a held input its mean around the instant, exact to the
 * fourth order. False until there are four samples. */
static bool centre(strong_window_f32 *self, const float now[STRONG_CHANNELS], float out[STRONG_CHANNELS])
{
    static const bool held[STRONG_CHANNELS] = STRONG_HELD_CHANNELS;
    for (size_t i = 0; i < STRONG_CHANNELS; i++) {
        float *past = self->past[i];
        out[i] = held[i] ? (((13.0f * (past[1] + past[2])) - (past[0] + now[i])) / 24.0f) : past[2];
        past[0] = past[1];
        past[1] = past[2];
        past[2] = now[i];
    }
    const bool full = self->before >= 3u;
    self->before = full ? self->before : (uint8_t)(self->before + 1u);
    return full;
}
#endif

/* Takes a sample of each channel into a window of another bank, or one that is not full yet. Returns whether it
 * completes a point, and the window is full. Never for five points: they are ready for the sample after that. */
static PVID_NOINLINE bool window_takes(strong_window_f32 *self, const pvid_fir_bank_f32 *bank,
                                       const float sample[STRONG_CHANNELS])
{
    float now[STRONG_CHANNELS];
    memcpy(now, sample, sizeof now);
#if STRONG_HELD
    if ((self->five_points == 0u) && !centre(self, sample, now)) {
        return false;
    }
#endif
    float *point = self->points[self->head];
    const uint32_t samples = (uint32_t)self->at + 1u;
    for (size_t i = 0; i < STRONG_CHANNELS; i++) {
        point[i] = (samples == 1u) ? now[i] : (point[i] + now[i]);
    }
    if (samples < bank->block) {
        self->at = (uint16_t)samples;
        return false;
    }
    self->at = 0;
    self->head = (uint16_t)place_after(self, self->head, 1);
    if (self->missing > 0u) {
        self->missing--;
    }
    if ((self->missing == 0u) && (self->five_points != 0u)) {
        self->five_points = STRONG_FIVE_POINTS_READY;
        return false;
    }
    return self->missing == 0u;
}

/* The inputs by the bank's filters. */
static PVID_NOINLINE void filter(const strong_window_f32 *self, const pvid_fir_bank_f32 *bank, float in[STRONG_INPUTS])
{
    const size_t half = bank->half;
    const float *weight = bank->weights;
    pvid_fir_walk at = pvid_fir_centre_f32(self->stride, self->length, self->head);
    const float *middle = self->points[at.newer];
    pvid_fir_outwards(&at);
    pvid_fir_sums_f32 sums[STRONG_CHANNELS];
    PVID_UNROLL
    for (size_t c = 0; c < STRONG_CHANNELS; c++) {
        sums[c] = pvid_fir_begin_f32(weight, half, middle[c], self->points[at.newer][c], self->points[at.older][c]);
    }
    for (size_t i = 1; i < half; i++) {
        pvid_fir_outwards(&at);
        PVID_UNROLL
        for (size_t c = 0; c < STRONG_CHANNELS; c++) {
            pvid_fir_add_f32(&sums[c], &weight[i], half, self->points[at.newer][c], self->points[at.older][c]);
        }
    }
    inputs_of_bank(sums, self->scale, in);
}

/* The five points of each channel with the present sample, the oldest first, and the place of the next one: `stride`
 * apart in the ring. */
static inline void take_apart(strong_window_f32 *self, const float sample[STRONG_CHANNELS], float x[STRONG_CHANNELS][5])
{
    const size_t head = self->head;
    const size_t oldest = place_after(self, head, 1);
    const size_t stride = self->stride;
    size_t place = oldest;
    PVID_UNROLL
    for (size_t c = 0; c < STRONG_CHANNELS; c++) {
        self->points[head][c] = sample[c];
    }
    self->head = (uint16_t)oldest;
    PVID_UNROLL
    for (size_t i = 0; i < 5u; i++) {
        PVID_UNROLL
        for (size_t c = 0; c < STRONG_CHANNELS; c++) {
            x[c][i] = self->points[place][c];
        }
        place = place_after(self, place, stride);
    }
#if STRONG_HELD
    /* of a held input the mean is from the samples around the instant, whatever the stride */
    static const bool held[STRONG_CHANNELS] = STRONG_HELD_CHANNELS;
    place = place_after(self, oldest, (2u * stride) - 2u);
    PVID_UNROLL
    for (size_t i = 0; i < 4u; i++) {
        PVID_UNROLL
        for (size_t c = 0; c < STRONG_CHANNELS; c++) {
            x[c][i] = held[c] ? self->points[place][c] : x[c][i];
        }
        place = place_after(self, place, 1);
    }
#endif
}

/* The same of points that follow each other: they move by a place, in which there are fewer steps than in a ring. The
 * sample that made them complete has its place before the last. */
static inline void take_next(strong_window_f32 *self, const float sample[STRONG_CHANNELS], float x[STRONG_CHANNELS][5])
{
    PVID_UNROLL
    for (size_t c = 0; c < STRONG_CHANNELS; c++) {
        PVID_UNROLL
        for (size_t i = 0; i < 4u; i++) {
            x[c][i] = self->points[i][c];
        }
        x[c][4] = sample[c];
        PVID_UNROLL
        for (size_t i = 0; i < 4u; i++) {
            self->points[i][c] = x[c][i + 1u];
        }
    }
}

/* Takes a sample of each channel. When it completes a point and the window is full, writes the inputs of a row and
 * returns true. */
static inline bool window_step(strong_window_f32 *self, const pvid_fir_bank_f32 *bank,
                               const float sample[STRONG_CHANNELS], float in[STRONG_INPUTS])
{
    if (self->five_points == STRONG_FIVE_POINTS_READY) {
        float x[STRONG_CHANNELS][5];
        if (self->stride == 1u) {
            take_next(self, sample, x);
        } else {
            take_apart(self, sample, x);
        }
        inputs_of_five((const float (*)[5])x, self->scale, in);
        return true;
    }
    float filtered[STRONG_INPUTS]; /* in memory, where `in` itself is in registers */
    if (!window_takes(self, bank, sample)) {
        return false;
    }
    filter(self, bank, filtered);
    PVID_UNROLL
    for (size_t i = 0; i < STRONG_INPUTS; i++) {
        in[i] = filtered[i];
    }
    return true;
}

/* ---- what this form shares with the other ---- */

static PVID_COLD void settings_of(const strong_estimator_f32 *self, pvid_solve_settings_f32 *settings)
{
    memset(settings, 0, sizeof *settings);
    settings->row_variance = self->row_sd * self->row_sd;
    settings->correlation = self->config->estimator.correlation;
    settings->n_p = STRONG_P;
    for (size_t a = 0; a < STRONG_P; a++) {
        settings->prior[a] = self->prior[a];
        settings->start_sd[a] = sqrtf(settings->row_variance / self->prior[a]);
#if STRONG_CONSTRAINTS > 0
        settings->lower[a] = self->config->estimator.lower[a];
        settings->upper[a] = self->config->estimator.upper[a];
#endif
    }
#if STRONG_CONSTRAINTS > 0
    settings->gain = self->gain;
    settings->step_limit = self->config->estimator.step_limit;
    settings->kappa_min = self->config->estimator.kappa_min;
    settings->positive = (pvid_p_bits)STRONG_POSITIVE;
    settings->blocked = self->blocked;
#endif
}

/* A symmetric matrix from its upper triangle by rows. */
static PVID_COLD void unpack(const float s[STRONG_S], float whole[][PVID_MAX_P])
{
    size_t next = 0;
    for (size_t a = 0; a < STRONG_P; a++) {
        for (size_t b = a; b < STRONG_P; b++) {
            whole[a][b] = s[next];
            whole[b][a] = s[next];
            next++;
        }
    }
}

/* ---- configuration ---- */

static PVID_COLD void folds_init(strong_estimator_f32 *self, float forgetting_rows)
{
    uint32_t rows = FOLD_MAX;
    if ((forgetting_rows > 0.0f) && (forgetting_rows < (FOLDS_PER_CONSTANT * (float)FOLD_MAX))) {
        rows = (uint32_t)(forgetting_rows / FOLDS_PER_CONSTANT);
    }
    /* rows from one chance to the next */
    const uint32_t unit = (self->staged != 0u) ? self->config->estimator.divider : PVID_STRONG_ROWS;
    rows = (rows < unit) ? unit : (rows - (rows % unit));
    self->fold_every = (uint8_t)rows;
    self->retention = (forgetting_rows > 0.0f) ? pvid_settings_decay_f32((float)rows / forgetting_rows) : 1.0f;
}

/* Weights of the kinds relative to the first, and H0 in units of its rows. Fails iff a row_sd is out of its range. */
static PVID_COLD pvid_status weights_init(strong_estimator_f32 *self, const strong_config_f32 *config)
{
    static const float unit[STRONG_KINDS] = STRONG_UNITS; /* a row of the core is one of the model times this */
    self->row_sd = config->row_sd[0] * unit[0];
    for (size_t k = 0; k < STRONG_KINDS; k++) {
        if (!pvid_within_f32(config->row_sd[k], 1.0e-12f, 1.0e12f)) {
            return PVID_BAD_ROW_SD;
        }
        const float ratio = self->row_sd / (config->row_sd[k] * unit[k]);
        self->weight[k] = ratio * ratio;
    }
    for (size_t a = 0; a < STRONG_P; a++) {
        const float ratio = self->row_sd / config->estimator.start_sd[a];
        const float square = ratio * ratio;
        /* not 0: row_variance over it is the square of a start_sd */
        self->prior[a] = (square > PVID_LEAST_NORMAL_F32) ? square : PVID_LEAST_NORMAL_F32;
    }
    return PVID_OK;
}

/* p to the constraints. Fails iff there is no such p near it, or the law leaves F where it is: there is no force that
 * a constraint could take. */
static PVID_COLD pvid_status tie(strong_estimator_f32 *self)
{
#if STRONG_CONSTRAINTS > 0
    if (self->mixes) {
        return (self->config->estimator.law == PVID_LAW_STATIONARY) ? PVID_BAD_FEEDBACK : PVID_BAD_LAW;
    }
    pvid_solve_settings_f32 settings;
    settings_of(self, &settings);
    return pvid_constraints_return_f32(&tied, &settings, self->p, PVID_RETURNS_AT_INIT) ? PVID_OK : PVID_BAD_START;
#else
    (void)self;
    return PVID_OK;
#endif
}

static PVID_COLD pvid_status estimator_init(strong_estimator_f32 *self, const strong_config_f32 *config, float rate_hz)
{
    pvid_estimator_config_f32 estimator = config->estimator;
    estimator.row_sd = 1.0f;
    const pvid_status status = pvid_settings_are_valid_f32(&estimator, STRONG_P, STRONG_POSITIVE, rate_hz);
    if (status != PVID_OK) {
        return status;
    }
    if (estimator.dead_zone > 0.0f) {
        return PVID_BAD_DEAD_ZONE;
    }
    if (config->exact_every > UINT8_MAX) {
        return PVID_BAD_DIVIDER;
    }
    if (!pvid_trust_shared_are_valid_f32(config->shared, STRONG_P)) {
        return PVID_BAD_SHARED;
    }
    const uint32_t every = (estimator.law == PVID_LAW_PSEUDOVELOCITY) ? 1u : EXACT_EVERY;
    const uint32_t divider = estimator.divider;
    const float forgetting_rows = estimator.forgetting_s * rate_hz;
    self->config = config;
    self->exact_every = (uint8_t)((config->exact_every > 0u) ? config->exact_every : every);
    self->gain = pvid_settings_gain_f32(&estimator, rate_hz, (float)((divider > 1u) ? divider : self->exact_every));
    self->mixes = self->gain < 1.0f;
    const bool long_enough = (forgetting_rows <= 0.0f) || (forgetting_rows >= (float)divider);
    self->staged = ((divider % PVID_STRONG_ROWS) == 0u) && (divider >= (2u * PVID_STRONG_ROWS)) &&
                   (divider <= FOLD_MAX) && long_enough;
    memcpy(self->p, estimator.start, sizeof self->p);
    folds_init(self, forgetting_rows);
    const pvid_status weighted = weights_init(self, config);
    return (weighted == PVID_OK) ? tie(self) : weighted;
}

static PVID_COLD pvid_status prepare(strong_f32 *self, const strong_config_f32 *config)
{
    memset(self, 0, sizeof *self);
    pvid_status status = window_init(&self->window, config);
    if (status != PVID_OK) {
        return status;
    }
    const float rate = config->sample_rate_hz / (float)pvid_fir_block_f32(&config->bank); /* of rows */
    status = estimator_init(&self->estimator, config, rate);
    if (status != PVID_OK) {
        return status;
    }
    STRONG_PREPARE_INTEGRALS(self, config);
    pvid_misfit_init_f32(&self->misfit, rate, config->estimator.forgetting_s);
    const float memory = GATE_MEMORY_S * rate;
    const float row_variance = self->estimator.row_sd * self->estimator.row_sd;
    return pvid_gate_init_f32(&self->gate, &config->gate, rate, (memory > GATE_MEMORY_ROWS) ? memory : GATE_MEMORY_ROWS,
                              GATE_FLOOR * row_variance);
}

PVID_COLD pvid_status STRONG(init_layout)(strong_f32 *self, const strong_config_f32 *config, uint32_t layout)
{
    if ((layout != PVID_LAYOUT) || (pvid_layout() != PVID_LAYOUT)) {
        return PVID_BAD_LAYOUT;
    }
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

void STRONG(freeze)(strong_f32 *self, bool frozen)
{
    if (is_ready(self)) {
        self->frozen = frozen;
    }
}

void STRONG(gap)(strong_f32 *self)
{
    if (is_ready(self)) {
        window_reset(&self->window);
    }
}

/* ---- the equations from all rows ---- */

/* s += sum w g g^T, the upper triangle by rows; force += sum w g e. */
static inline void add_row(const strong_gradient_f32 *row, const float weight[STRONG_KINDS], float s[STRONG_S],
                           float force[STRONG_P])
{
    float own[STRONG_P];
    add_squares(row, weight, s);
    force_of(row, weight, own);
    PVID_UNROLL
    for (size_t a = 0; a < STRONG_P; a++) {
        force[a] += own[a];
    }
}

/* S and F at p from the sums and the first rows of the block. */
static PVID_NOINLINE void gather(const strong_estimator_f32 *self, size_t rows, float s[STRONG_S],
                                 float force[STRONG_P])
{
    float p[STRONG_P];
    float all_s[STRONG_S];
    float all_force[STRONG_P];
    memcpy(p, self->p, sizeof p);
    project(self->high, self->low, p, self->weight, all_s, all_force);
    for (size_t i = 0; i < rows; i++) {
        strong_gradient_f32 row;
        innovate(p, self->block[i], &row);
        add_row(&row, self->weight, all_s, all_force);
    }
    memcpy(s, all_s, sizeof all_s);
    memcpy(force, all_force, sizeof all_force);
}

/* Knuth's two-sum after forgetting: new high + new low = retention (high + low), but for the two products. */
static PVID_NOINLINE void fold(strong_estimator_f32 *self, size_t first, size_t end)
{
    const float retention = self->retention;
    for (size_t i = first; i < end; i++) {
        const float kept_high = self->high[i] * retention;
        const float kept_low = self->low[i] * retention;
        const float total = kept_high + kept_low;
        const float part = total - kept_high;
        self->high[i] = total;
        self->low[i] = (kept_high - (total - part)) + (kept_low - part);
    }
}

/* ---- accuracy ---- */

/* S, and the residuals at p. With P = Q + sum p_l g_l over the linear parameters l,
 *
 *   sum (Y - P)^2 = sum (Y - Q)^2 - sum_l p_l (R_l + F_l),   R_l = sum g_l (Y - Q) = F_l + sum_m p_m S_lm */
static PVID_COLD void system_of(const strong_estimator_f32 *self, pvid_system_f32 *system)
{
    static const uint8_t linear[] = STRONG_LINEAR;
    float s[STRONG_S];
    gather(self, 0, s, system->force);
    unpack(s, system->s);
    float rss = distance(self->high, self->low, self->p, self->weight);
    float largest = (rss > 0.0f) ? rss : -rss;
    for (size_t i = 0; i < STRONG_LINEAR_COUNT; i++) {
        const size_t l = linear[i];
        float sum = system->force[l] + system->force[l];
        for (size_t j = 0; j < STRONG_LINEAR_COUNT; j++) {
            sum += self->p[linear[j]] * system->s[l][linear[j]];
        }
        const float part = self->p[l] * sum;
        rss -= part;
        largest += (part > 0.0f) ? part : -part;
    }
    for (size_t i = 0; i < self->in_block; i++) {
        strong_gradient_f32 row;
        innovate(self->p, self->block[i], &row);
        add_row(&row, self->weight, s, system->force);
        rss += square_of(&row, self->weight);
    }
    unpack(s, system->s);
    system->rss = rss;
    system->rounding = 0.0f;
    system->floor = RESIDUAL_FLOOR * largest;
    system->weight = (self->high[STRONG_WEIGHT] + self->low[STRONG_WEIGHT]) + (float)self->in_block;
    system->weight *= (float)STRONG_KINDS;
}

void STRONG(assess)(const strong_f32 *self, pvid_estimate_f32 *estimate)
{
    static const float unit[STRONG_KINDS] = STRONG_UNITS;
    if (estimate == NULL) {
        return;
    }
    memset(estimate, 0, sizeof *estimate);
    if (!is_ready(self)) {
        return;
    }
    pvid_system_f32 system;
    pvid_solve_settings_f32 settings;
    settings_of(&self->estimator, &settings);
    system_of(&self->estimator, &system);
#if STRONG_CONSTRAINTS > 0
    pvid_constraints_reduce_f32(&system, &tied, &settings, self->estimator.p);
#elif PVID_MAX_CONSTRAINTS > 0
    system.ties.count = 0;
#endif
    memcpy(estimate->p, self->estimator.p, sizeof self->estimator.p);
    pvid_assess_f32(&system, &settings, estimate);
    pvid_trust_add_shared_f32(self->estimator.config->shared, STRONG_P, STRONG_POSITIVE, estimate);
    estimate->residual_sd /= unit[0];
}

void STRONG(read_sums)(const strong_f32 *self, float sums[STRONG_SUMS])
{
    if (is_ready(self)) {
        for (size_t i = 0; i < STRONG_SUMS; i++) {
            sums[i] = self->estimator.high[i] + self->estimator.low[i];
        }
    }
}

uint32_t STRONG(fnv)(uint32_t hash, const strong_estimator_f32 *estimator, pvid_reason reason)
{
    uint32_t running = hash;
    for (size_t a = 0; a < STRONG_P; a++) {
        running = pvid_fnv_word(running, pvid_bits_f32(estimator->p[a]));
    }
    for (size_t i = 0; i < STRONG_SUMS; i++) {
        running = pvid_fnv_word(running, pvid_bits_f32(estimator->high[i] + estimator->low[i]));
    }
    return pvid_fnv_word(running, (uint32_t)reason);
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

/* Parameters that a force or a step pulls out of their bounds. Equation (5) alone has no solution to stay at. */
static PVID_COLD pvid_p_bits outwards(const strong_estimator_f32 *self, const float pull[STRONG_P])
{
    const pvid_estimator_config_f32 *config = &self->config->estimator;
    const bool stays = self->gain > 0.0f;
    return stays ? pvid_step_outwards_f32(STRONG_P, self->p, config->lower, config->upper, pull) : 0u;
}

#if STRONG_CONSTRAINTS > 0
/* The step on the constraints, theory.md 4, (6c): of S and F from all rows, by the functions of the other form. */
static PVID_COLD pvid_reason solve(strong_estimator_f32 *self, const float rhs[STRONG_P], bool projected)
{
    pvid_system_f32 system;
    pvid_solve_settings_f32 settings;
    pvid_cholesky_f32 factor;
    float p[STRONG_P];
    pvid_solution_f32 solution = {.p = p};
    (void)projected; /* always: at_every_row */
    settings_of(self, &settings);
    unpack(self->s, system.s);
    memcpy(system.force, rhs, sizeof p);
    pvid_constraints_reduce_f32(&system, &tied, &settings, self->p);
    for (size_t a = 0; a < STRONG_P; a++) {
        system.s[a][a] += self->prior[a];
    }
    self->pinned = pvid_step_pin_f32(&system, &settings, self->p);
    pvid_reason reason = pvid_step_factor_f32(&system, &settings, &factor);
    if (reason == PVID_UPDATED) {
        memcpy(p, self->p, sizeof p);
        pvid_step_take_f32(&system, &settings, &factor, self->pinned, self->p, system.force, &solution);
        pvid_count_step(&self->counters, solution.limited, solution.bounded);
        self->blocked = (pvid_p_bits)((solution.blocked != 0u) ? (solution.blocked | (uint32_t)self->pinned) : 0u);
        reason = solution.reason;
    }
    if ((reason == PVID_UPDATED) && !pvid_constraints_end_f32(&tied, &settings, self->p, p)) {
        reason = PVID_HELD_SINGULAR;
    }
    if (reason != PVID_UPDATED) {
        return pvid_count_held(&self->counters, reason);
    }
    memcpy(self->p, p, sizeof p);
    pvid_count_up(&self->counters.updates);
    return reason;
}
#else
/* Stops p at its bounds. */
static PVID_COLD void clamp(strong_estimator_f32 *self)
{
    const pvid_estimator_config_f32 *config = &self->config->estimator;
    for (size_t a = 0; a < STRONG_P; a++) {
        self->p[a] = (self->p[a] > config->upper[a]) ? config->upper[a] : self->p[a];
        self->p[a] = (self->p[a] < config->lower[a]) ? config->lower[a] : self->p[a];
    }
    pvid_count_up(&self->counters.bounded);
}

/* p += dp, shortened to the step limit and kept within the bounds. Fails iff dp is not finite: PVID_HELD_SINGULAR. */
static inline pvid_reason move(strong_estimator_f32 *self, const float dp[STRONG_P])
{
    const pvid_estimator_config_f32 *config = &self->config->estimator;
    uint32_t size = 0; /* the bits of |dp| over its unit: ordered like the number, infinity and NaN last */
    PVID_UNROLL
    for (size_t a = 0; a < STRONG_P; a++) {
        const bool positive = ((STRONG_POSITIVE >> a) & 1u) != 0u;
        const uint32_t own = pvid_bits_f32(dp[a] / (positive ? self->p[a] : config->start_sd[a])) & 0x7FFFFFFFu;
        size = (own > size) ? own : size;
    }
    float part = 1.0f;
    if (size > pvid_bits_f32(config->step_limit)) {
        if (!pvid_finite_f32(pvid_from_bits_f32(size))) {
            return PVID_HELD_SINGULAR;
        }
        part = config->step_limit / pvid_from_bits_f32(size);
        pvid_count_up(&self->counters.limited);
    }
    uint32_t signs = 0; /* of the products that are negative beyond a bound */
    PVID_UNROLL
    for (size_t a = 0; a < STRONG_P; a++) {
        const float p = self->p[a] + (part * dp[a]);
        self->p[a] = p;
        signs |= pvid_bits_f32((p - config->lower[a]) * (config->upper[a] - p));
    }
    if ((signs & 0x80000000u) != 0u) {
        clamp(self);
    }
    pvid_count_up(&self->counters.updates);
    return PVID_UPDATED;
}

/* H0 with which pinned parameters are as good as known. A pinned p[0] needs no excitation. */
static PVID_COLD const float *raise_pinned(const strong_estimator_f32 *self, float prior[STRONG_P], float *kappa_min)
{
    size_t diagonal = 0; /* of the upper triangle by rows */
    for (size_t a = 0; a < STRONG_P; a++) {
        prior[a] =
            pvid_step_has_f32(self->pinned, a) ? ((self->s[diagonal] + self->prior[a]) * PVID_PIN) : self->prior[a];
        diagonal += STRONG_P - a;
    }
    *kappa_min = pvid_step_has_f32(self->pinned, 0u) ? 0.0f : *kappa_min;
    return prior;
}

/* Where a parameter has been at its bound: pinned ones stay. A step from a projection that would move one out of its
 * bound is not taken (false); the parameter is pinned in the next one. */
static PVID_COLD bool goes(strong_estimator_f32 *self, float dp[STRONG_P], bool solved_for, bool projected)
{
    if (self->pinned != 0u) {
        pvid_count_up(&self->counters.bounded);
        pvid_step_hold_f32(STRONG_P, self->pinned, dp);
    }
    if (!(solved_for && projected)) {
        return solved_for;
    }
    const pvid_p_bits blocked = outwards(self, dp);
    self->blocked = (pvid_p_bits)((blocked != 0u) ? (blocked | (uint32_t)self->pinned) : 0u);
    return blocked == 0u;
}

/* Solves (S + H0) dp = rhs and moves p; projected: rhs is of all rows. In one place, for all schedules. */
PVID_ALWAYS_INLINE pvid_reason solve(strong_estimator_f32 *self, const float rhs[STRONG_P], bool projected)
{
    float dp[STRONG_P];
    float raised[STRONG_P];
    float kappa_min = self->config->estimator.kappa_min;
    const float *prior = (self->pinned != 0u) ? raise_pinned(self, raised, &kappa_min) : self->prior;
    pvid_reason reason = solved(self->s, prior, kappa_min, rhs, dp);
    bool moves = reason == PVID_UPDATED;
    if (self->counters.bounded > 0u) {
        moves = goes(self, dp, moves, projected);
    }
    if (moves) {
        reason = move(self, dp);
    }
    return (reason == PVID_UPDATED) ? reason : pvid_count_held(&self->counters, reason);
}
#endif

/* S and the right-hand side at p from all rows and this one: rhs = gamma F + (1 - gamma) rhs, where rhs is the sum of
 * C^T N e of the rows since the last projection. The square of this row is not in S yet. */
static inline void project_all(strong_estimator_f32 *self, const strong_gradient_f32 *row, float rhs[STRONG_P])
{
    float force[STRONG_P];
    float own[STRONG_P];
    force_of(row, self->weight, own);
    gather(self, self->in_block, self->s, force);
    PVID_UNROLL
    for (size_t a = 0; a < STRONG_P; a++) {
        force[a] += own[a];
        rhs[a] = self->mixes ? ((self->gain * force[a]) + ((1.0f - self->gain) * rhs[a])) : force[a];
    }
    if ((STRONG_CONSTRAINTS == 0) && (self->counters.bounded > 0u)) {
        self->pinned = (pvid_p_bits)(outwards(self, force) | (uint32_t)self->blocked);
    }
}

/* A row with divider 1: a step, from all sums at every exact_every-th row. */
PVID_ALWAYS_INLINE work at_every_row(strong_estimator_f32 *self, const strong_gradient_f32 *row, float rhs[STRONG_P])
{
    const uint32_t left = self->phase;
    force_of(row, self->weight, rhs);
    self->phase = (uint16_t)(((left == 0u) ? self->exact_every : left) - 1u);
    if (left == 0u) {
        return PROJECTED_STEP;
    }
    return (STRONG_CONSTRAINTS > 0) ? ROW_ALONE : LAZY_STEP; /* the force of a row alone is no reaction */
}

/* Rows of a staged round, by their number from 1; the last has number 0. The projection is at row 1. */
#define SOLUTION 2u
#define FIRST_FOLD 5u
#define FOLDS 3u

/* Thirds of the sums, which staged rows fold one by one. */
static inline size_t third(size_t i)
{
    return (STRONG_SUMS * i) / FOLDS;
}

/* A part of the fold at rows 4, 5, 6 of a staged round: between two blocks, after projection and solve. */
static PVID_NOINLINE void fold_in_stages(strong_estimator_f32 *self)
{
    const size_t place = self->in_block;
    if ((self->staged != 0u) && (place < (PVID_STRONG_ROWS - 1u)) && (self->age >= self->fold_every)) {
        fold(self, third(place), third(place + 1u));
        self->age = (place == (PVID_STRONG_ROWS - 2u)) ? (uint8_t)(self->age - self->fold_every) : self->age;
    }
}

/* rhs = the sum of C^T N e, or the right-hand side of a staged step; the sum begins anew. */
static inline void take_force(strong_estimator_f32 *self, float rhs[STRONG_P])
{
    PVID_UNROLL
    for (size_t a = 0; a < STRONG_P; a++) {
        rhs[a] = self->force[a];
        self->force[a] = 0.0f;
    }
}

/* A row with a divider above 1. */
PVID_ALWAYS_INLINE work at_divider(strong_estimator_f32 *self, const strong_gradient_f32 *row, float rhs[STRONG_P])
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
        float own[STRONG_P];
        force_of(row, self->weight, own);
        PVID_UNROLL
        for (size_t a = 0; a < STRONG_P; a++) {
            self->force[a] += own[a];
        }
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
PVID_ALWAYS_INLINE pvid_reason step(strong_estimator_f32 *self, const strong_gradient_f32 *row)
{
    float rhs[STRONG_P];
    const bool every = self->config->estimator.divider == 1u;
    const work now = every ? at_every_row(self, row, rhs) : at_divider(self, row, rhs);
    if (now == ROW_ALONE) {
        return PVID_ACCUMULATED;
    }
    if ((now == PROJECTED_STEP) || (now == STAGED_PROJECTION)) {
        project_all(self, row, rhs);
    }
    if (now != STAGED_STEP) {
        add_squares(row, self->weight, self->s);
    }
    if (now == STAGED_PROJECTION) {
        memcpy(self->force, rhs, sizeof rhs);
        return PVID_ACCUMULATED;
    }
    return solve(self, rhs, now != LAZY_STEP);
}

/* ---- rows ---- */

/* Adds a complete block to the sums; folds them where no other row does. */
static inline void end_block(strong_estimator_f32 *self)
{
    self->in_block = 0;
    self->age = (uint8_t)(self->age + PVID_STRONG_ROWS);
    add_rows((const float (*)[STRONG_ATOMS])self->block, self->low);
    if ((self->staged == 0u) && (self->age >= self->fold_every)) {
        self->age = 0;
        fold(self, 0, STRONG_SUMS);
    }
}

/* Why a row is refused whose squares exceed the limit; counts it. */
static PVID_COLD pvid_reason refuse(pvid_counters *counters, const float x[STRONG_ATOMS])
{
    bool finite = true;
    for (size_t i = 0; i < STRONG_ATOMS; i++) {
        finite = finite && pvid_finite_f32(x[i]);
    }
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
static inline void judge_misfit(strong_f32 *self, uint32_t left)
{
    if (left == 0u) {
        self->alarm = pvid_misfit_judge_f32(&self->misfit);
    }
}

/* Judges the rows of an instant, adds them if the gate accepts them, and solves. One verdict for all kinds, which share
 * sums. */
PVID_ALWAYS_INLINE pvid_reason take(strong_f32 *self, const float in[STRONG_INPUTS])
{
    strong_estimator_f32 *estimator = &self->estimator;
    const uint32_t place = estimator->in_block;
    float x[STRONG_ATOMS];
    strong_gradient_f32 row;
    atoms_of(in, x);
    PVID_UNROLL
    for (size_t i = 0; i < STRONG_ATOMS; i++) {
        estimator->block[place][i] = x[i]; /* counts once in_block includes it */
    }
    if (!(bound_of(x) <= (PVID_ROW_LIMIT * PVID_ROW_LIMIT))) {
        return refuse(&estimator->counters, estimator->block[place]);
    }
    innovate(estimator->p, x, &row);
    const float square = square_of(&row, estimator->weight);
    const uint32_t left = pvid_misfit_add_f32(&self->misfit, square, signal_of(&row, estimator->weight, estimator->p));
    if (!pvid_gate_judges_f32(&self->gate, square)) {
        pvid_count_up(&estimator->counters.rejected_outlier);
        judge_misfit(self, left);
        return PVID_REJECTED_OUTLIER;
    }
    pvid_count_up(&estimator->counters.rows);
    const pvid_reason reason = step(estimator, &row);
    if (place < (PVID_STRONG_ROWS - 1u)) {
        estimator->in_block = (uint8_t)(place + 1u);
        judge_misfit(self, left);
    } else {
        end_block(estimator);
        if (left == 0u) {
            pvid_misfit_defer_f32(&self->misfit); /* to a row that does less */
        }
    }
    return ((reason == PVID_UPDATED) && self->alarm) ? misfit(&estimator->counters) : reason;
}

pvid_reason STRONG(row_step)(strong_f32 *self, const float in[STRONG_INPUTS])
{
    if (!is_ready(self)) {
        return PVID_NOT_READY;
    }
    return self->frozen ? PVID_HELD_FROZEN : take(self, in);
}

pvid_reason STRONG(step)(strong_f32 *self, const float sample[STRONG_SIGNALS])
{
    if (!is_ready(self)) {
        return PVID_NOT_READY;
    }
    float rest = sample[0] - sample[0]; /* a sum that only finite samples leave at 0 */
    PVID_UNROLL
    for (size_t i = 1; i < STRONG_SIGNALS; i++) {
        rest += sample[i] - sample[i];
    }
    const bool finite = rest >= 0.0f;
    const float *now = STRONG_WITH_INTEGRALS(self, sample, finite);
    if (!finite) {
        window_reset(&self->window);
        pvid_count_up(&self->estimator.counters.rejected_not_finite);
        return PVID_REJECTED_NOT_FINITE;
    }
    float in[STRONG_INPUTS];
    if (!window_step(&self->window, &self->estimator.config->bank, now, in)) {
        return (self->window.missing > 0u) ? PVID_WARMING_UP : PVID_ACCUMULATED; /* or in a point */
    }
    return self->frozen ? PVID_HELD_FROZEN : take(self, in);
}

#endif
