#include "weak/weak_finish_q31.h"

#include <stddef.h>
#include <string.h>

#include "judge/gate_q31.h"
#include "judge/trust_q31.h"
#include "number/count.h"
#include "number/integer_q31.h"
#include "number/scaled_q31.h"
#include "number/unroll.h"
#include "solve/row_q31.h"
#include "solve/state_q31.h"
#include "solve/system_q31.h"
#include "weak/columns_q31.h"
#include "weak/error.h"
#include "weak/error_q31.h"
#include "weak/reflection_q31.h"
#include "weak/noise_q31.h"
#include "weak/scores_q31.h"
#include "weak/steps.h"
#include "weak/sums_q31.h"
#include "weak/white_q31.h"

enum {
    /* for each kind of rows; the first four only where the noise is computed anew */
    STAGE_WEIGH,    /* c_j from a few entries of the noise table */
    STAGE_SPECTRUM, /* D_h, a few harmonics at a time */
    STAGE_INVERT,   /* 1 / sqrt(D_h), a harmonic at a time */
    STAGE_MIRROR,   /* n reflections that leave the white rows */
    STAGE_UNIT,     /* of the columns: a few harmonics */
    STAGE_COLUMN,   /* columns: each harmonic of all; the white rows of each */
    STAGE_PROJECT,  /* for each nuisance: what remains of it, then a column without it */
    STAGE_FORMAT,   /* for theta's columns and Y: their format */
    STAGE_RESIDUAL, /* a few rows of e, in place of Y; at the end the gate accepts or rejects the kind */
    STAGE_FADE,     /* before the first rows of the window: the factor of a renewal on the sums, in parts */
    STAGE_ADD,      /* K times, less the nuisances: a row to the estimator */
    STAGE_LEVERAGE, /* n parts; this and the next two likewise, where anything needs the noise itself */
    STAGE_SHARE,    /* Q_j, a few harmonics */
    STAGE_NOISE,    /* C, then bias and information by each entry of the noise table */
    STAGE_PULL,     /* what the noise takes from b */
    /* for the window */
    STAGE_SOLVE,   /* `iterations` solves, several stages each */
    STAGE_MEAN,    /* the score to the means; this and CLUSTER do nothing if no solve was due */
    STAGE_ASSESS,  /* several stages */
    STAGE_CLUSTER, /* standard errors of a few parameters from the scatter of the scores */
    STAGE_JUDGE,   /* trust_q31.h publishes the estimate or holds it */
    STAGE_RESTART, /* p starts again, if it has to */
    STAGE_IDLE = PVID_WEAK_IDLE_Q31
};

#define ENTRIES_PER_STAGE 4u
#define HARMONICS_PER_STAGE 2u
#define ROOTS_PER_STAGE 4u
#define UNITS_PER_STAGE 4u
#define SHARES_PER_STAGE 1u
#define RESIDUALS_PER_STAGE 4u
#define FORMATS_PER_STAGE 2u
#define CLUSTERS_PER_STAGE 2u

/* Windows after which the noise and what whitens it are computed anew, and relative step of p behind which they are at
 * once: 2^-7, Q22. */
#define NOISE_WINDOWS 16u
#define SMALL_STEP ((int64_t)1 << 15)

/* Windows in the average of the gate's scale, which is relative to the sensors' noise and at least 1. */
#define GATE_MEMORY 4u

static const pvid_weak_kind *kind_of(const pvid_weak_q31 *self)
{
    return &self->design->model->kind[self->finish.kind];
}

static size_t columns_of(const pvid_weak_kind *kind)
{
    return (size_t)kind->thetas + 1u + kind->nuisances;
}

static size_t lesser(size_t a, size_t b)
{
    return (a < b) ? a : b;
}

pvid_status pvid_weak_finish_init_q31(pvid_weak_finish_q31 *self, const pvid_weak_config_q31 *config)
{
    const pvid_weak_design_q31 *design = config->design;
    const int64_t sd = config->estimator.row_sd;
    for (size_t i = 0; i < design->model->kinds; i++) {
        const pvid_status status =
            pvid_gate_init_q31(&self->gate[i], &config->gate, GATE_MEMORY, pvid_scaled_of_q31(1, 0));
        if (status != PVID_OK) {
            return status;
        }
    }
    memcpy(self->n_bits, config->estimator.n_bits, sizeof self->n_bits);
    self->y_bits = config->estimator.y_bits;
    self->expected = pvid_scaled_of_q31(sd * sd, -2 * PVID_ROW_SD_BITS);
    self->known.compensates = config->compensation && (design->n_noise > 0u);
    self->known.used = self->known.compensates || ((config->estimator.noise_margin > 0u) && (design->n_noise > 0u));
    for (size_t i = 0; i < design->model->kinds; i++) {
        self->known.used = self->known.used || (design->error_variance[i].m > 0);
    }
    self->known.age = NOISE_WINDOWS;
    pvid_weak_error_init_q31(self->error, design);
    self->left = INT32_MAX;
    for (size_t i = 0; i < design->model->kinds; i++) {
        pvid_weak_white_init_q31(&self->white[i], design);
    }
    self->stage = STAGE_IDLE;
    return PVID_OK;
}

static void begin_kind(pvid_weak_finish_q31 *self)
{
    self->index = 0;
    self->part = 0;
    self->live = 0;
    self->rss = 0;
    self->saturated = false;
    self->rejected = false;
    self->stage = self->known.renewed ? STAGE_WEIGH : STAGE_UNIT;
}

void pvid_weak_finish_skip_q31(pvid_weak_finish_q31 *self)
{
    self->no_predecessor = true;
}

void pvid_weak_finish_begin_q31(pvid_weak_finish_q31 *self)
{
    if (self->no_predecessor) {
        pvid_weak_scores_skip_q31(&self->scores);
    }
    self->no_predecessor = false;
    pvid_weak_known_q31 *known = &self->known;
    known->renewed = (known->age >= NOISE_WINDOWS) || (self->size > SMALL_STEP);
    known->age = (uint8_t)(known->renewed ? 1u : (known->age + 1u));
    self->kind = 0;
    self->theta = 0;
    self->used = 0;
    self->iteration = 0;
    self->free = 0;
    begin_kind(self);
}

/* ---- rows of a kind; each returns whether there is more of the stage ---- */

/* theta of the kind at the present p. */
static void take_theta(pvid_weak_q31 *self)
{
    const int16_t *bits = &self->estimator.theta_bits[self->finish.theta];
    const int64_t *theta = &self->estimator.theta[self->finish.theta];
    const size_t thetas = kind_of(self)->thetas;
    for (size_t j = 0; j < thetas; j++) {
        self->finish.work.rows.parts.noise.of_theta[j] = pvid_scaled_of_q31(theta[j], -bits[j]);
    }
}

static bool weigh_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const size_t end = lesser((size_t)finish->index + ENTRIES_PER_STAGE, self->design->n_noise);
    if (finish->index == 0u) {
        take_theta(self);
    }
    pvid_weak_noise_work_q31 *work = &finish->work.rows.parts.noise;
    pvid_weak_white_weigh_q31(&finish->white[finish->kind], self->design, finish->kind, work->of_theta, finish->index,
                              end, work->weight);
    finish->index = (uint16_t)end;
    return end < self->design->n_noise;
}

static bool spectrum_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const size_t harmonics = finish->white[finish->kind].cosines;
    const size_t end = lesser((size_t)finish->index + HARMONICS_PER_STAGE, harmonics);
    pvid_weak_white_spectrum_q31(&finish->white[finish->kind], self->design, finish->kind,
                                 finish->error[finish->kind].variance, finish->work.rows.parts.noise.weight,
                                 finish->index, end);
    finish->index = (uint16_t)end;
    if (end == harmonics) {
        finish->work.rows.least = pvid_weak_white_floor_q31(&finish->white[finish->kind], self->design);
    }
    return end < harmonics;
}

static bool invert_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const size_t harmonics = finish->white[finish->kind].cosines;
    const size_t end = lesser((size_t)finish->index + ROOTS_PER_STAGE, harmonics);
    pvid_weak_white_invert_q31(&finish->white[finish->kind], finish->work.rows.least, finish->index, end);
    finish->index = (uint16_t)end;
    return end < harmonics;
}

static bool reflector_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    pvid_weak_white_reflector_q31(&finish->white[finish->kind], self->design, finish->index);
    finish->index++;
    return finish->index < pvid_weak_reflectors_q31(self->design);
}

static bool leverage_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    pvid_weak_rows_q31 *rows = &finish->work.rows;
    pvid_weak_noise_leverage_q31(&finish->white[finish->kind], self->design, finish->index, rows->parts.noise.u,
                                 rows->parts.noise.leverage);
    finish->index++;
    return finish->index < pvid_weak_reflectors_q31(self->design);
}

static bool share_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    pvid_weak_rows_q31 *rows = &finish->work.rows;
    const size_t harmonics = finish->white[finish->kind].cosines;
    const size_t end = lesser((size_t)finish->index + SHARES_PER_STAGE, harmonics);
    for (size_t h = finish->index; h < end; h++) {
        pvid_weak_noise_share_q31(&finish->white[finish->kind], self->design, rows->parts.noise.leverage, h,
                                  rows->parts.noise.share);
    }
    finish->index = (uint16_t)end;
    return end < harmonics;
}

/* Before the first entry of the first kind the sums over all kinds begin. */
static void begin_noise(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const pvid_weak_model_q31 *model = self->design->model;
    memset(self->estimator.noise_table, 0, sizeof self->estimator.noise_table);
    memset(finish->known.pull, 0, sizeof finish->known.pull);
    finish->known.sensors = pvid_scaled_of_q31(0, 0);
    finish->known.explained = finish->known.sensors;
    self->estimator.noise_rows = 0;
    for (size_t i = 0; (self->design->n_noise > 0u) && (i < model->kinds); i++) {
        const uint32_t rows = (uint32_t)self->design->functions - model->kind[i].nuisances;
        self->estimator.noise_rows = (uint16_t)(self->estimator.noise_rows + rows);
    }
}

/* What the sensors explain of the kind's rows; a variance of its own error that does not fit them is changed. */
static void explain(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const pvid_weak_design_q31 *design = self->design;
    pvid_weak_error_q31 *error = &finish->error[finish->kind];
    const pvid_scaled_q31 share =
        pvid_weak_noise_error_share_q31(design, finish->kind, finish->work.rows.parts.noise.share);
    const pvid_scaled_q31 least = design->error_variance[finish->kind];
    const pvid_scaled_q31 more = pvid_scaled_minus_q31(error->variance, least);
    finish->known.sensors =
        pvid_scaled_plus_q31(finish->known.sensors, pvid_weak_noise_sensors_q31(design, error->variance, share));
    finish->known.explained =
        pvid_scaled_plus_q31(finish->known.explained, pvid_weak_noise_sensors_q31(design, more, share));
    if (!pvid_weak_error_follows(design->model->kinds)) {
        return;
    }
    const pvid_scaled_q31 before = error->variance;
    const int32_t left = pvid_weak_error_change_q31(error, least, share);
    if (left < INT32_MAX) {
        pvid_gate_begin_anew_q31(&finish->gate[finish->kind]);
    }
    finish->left = (left < finish->left) ? left : finish->left;
    if ((error->variance.m != before.m) || (error->variance.e != before.e)) {
        finish->known.age = NOISE_WINDOWS; /* the next window computes the noise anew */
    }
}

/* C at p; what the sensors explain; then an entry of the table each. */
static bool noise_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    pvid_weak_rows_q31 *rows = &finish->work.rows;
    pvid_weak_noise_work_q31 *work = &rows->parts.noise;
    const pvid_weak_design_q31 *design = self->design;
    if (finish->index == 0u) {
        const int16_t h[PVID_MAX_THETA_Q31] = {0};
        if (finish->kind == 0u) {
            begin_noise(self);
        }
        pvid_system_jacobian_q31(&self->estimator, h, work->c, work->f);
        take_theta(self);
    } else if (finish->index == 1u) {
        explain(self);
    } else if (design->noise[finish->index - 2u].kind == finish->kind) {
        pvid_weak_noise_take_q31(&self->estimator, design, &design->noise[finish->index - 2u], work, work->of_theta,
                                 finish->theta, finish->n_bits, finish->y_bits, &finish->known.pull[finish->theta]);
    } else {
        /* an entry of another kind */
    }
    finish->index++;
    return finish->index < (design->n_noise + 2u);
}

static bool unit_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    pvid_weak_rows_q31 *rows = &finish->work.rows;
    const size_t harmonics = finish->white[finish->kind].cosines;
    const size_t end = lesser((size_t)finish->index + UNITS_PER_STAGE, harmonics);
    if (finish->index == 0u) {
        pvid_weak_columns_begin_q31(&rows->parts.columns, self->design, finish->kind);
    }
    for (size_t h = finish->index; h < end; h++) {
        pvid_weak_columns_scan_q31(&rows->parts.columns, self->design, finish->kind, &finish->white[finish->kind],
                                   self->accumulator.window.length[h], h);
    }
    finish->index = (uint16_t)end;
    return end < harmonics;
}

static bool column_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const pvid_weak_design_q31 *design = self->design;
    const pvid_weak_kind *kind = kind_of(self);
    const size_t harmonics = finish->white[finish->kind].cosines;
    if (finish->index < harmonics) {
        const int32_t (*sums)[PVID_MAX_CHANNELS][2] =
            (const int32_t (*)[PVID_MAX_CHANNELS][2])pvid_weak_window_sums_q31(&self->accumulator.sums,
                                                                               &self->accumulator.window);
        pvid_weak_columns_take_q31(&finish->work.rows.parts.columns, design, finish->kind, &finish->white[finish->kind],
                                   self->accumulator.window.length[finish->index], sums[finish->index], finish->index);
    } else {
        const size_t place = finish->index - harmonics;
        pvid_weak_columns_end_q31(&finish->work.rows.parts.columns, design, &finish->white[finish->kind], place);
        if (place > kind->thetas) {
            finish->work.rows.whole[place - kind->thetas - 1u] =
                pvid_weak_columns_square_q31(design->functions, finish->work.rows.parts.columns.x[place]);
        }
    }
    finish->index++;
    return finish->index < (harmonics + columns_of(kind));
}

/* Of each nuisance in order: part 0 its reflection, then the columns without it, those of theta, Y and the nuisances
 * behind it: what is left of it would be the first of their rows that are left. */
static bool project_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const pvid_weak_kind *kind = kind_of(self);
    const size_t first = (size_t)kind->thetas + 1u;
    const size_t nuisance = first + finish->index;
    if (finish->index >= kind->nuisances) {
        return false;
    }
    const size_t begin = finish->live;
    const size_t rows = self->design->functions - begin;
    int32_t *reflector = &finish->work.rows.parts.columns.x[nuisance][begin];
    if (finish->part == 0u) {
        finish->kept = pvid_weak_columns_keep_q31(finish->work.rows.whole[finish->index], rows, reflector);
        finish->part = 1;
        return true;
    }
    const size_t place = finish->part - 1u;
    const size_t column = (place < first) ? place : (place + finish->index + 1u);
    if (finish->kept) {
        pvid_weak_reflect_q31(reflector, rows, &finish->work.rows.parts.columns.x[column][begin]);
    }
    finish->part++;
    if (finish->part > (first + kind->nuisances) - (finish->index + 1u)) {
        finish->live = (uint8_t)(finish->live + (finish->kept ? 1u : 0u));
        finish->part = 0;
        finish->index++;
    }
    return finish->index < kind->nuisances;
}

static bool format_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const size_t columns = (size_t)kind_of(self)->thetas + 1u;
    const size_t end = lesser((size_t)finish->index + FORMATS_PER_STAGE, columns);
    for (size_t place = finish->index; place < end; place++) {
        const bool is_y = (place + 1u) == columns;
        const int32_t bits = is_y ? finish->y_bits : finish->n_bits[finish->theta + place];
        pvid_weak_columns_format_q31(&finish->work.rows.parts.columns, place, finish->live, self->design->functions,
                                     bits);
    }
    finish->index = (uint16_t)end;
    return end < columns;
}

/* The columns of theta in row k of the kind. */
static void row_of(const pvid_weak_q31 *self, size_t k, int32_t n[PVID_MAX_THETA_Q31])
{
    const size_t thetas = kind_of(self)->thetas;
    for (size_t j = 0; j < thetas; j++) {
        n[j] = self->finish.work.rows.parts.columns.x[j][k];
    }
}

static bool residual_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const size_t first = (size_t)finish->live + finish->index;
    const size_t rows = self->design->functions;
    const size_t last = lesser(first + RESIDUALS_PER_STAGE, rows);
    int32_t *y = finish->work.rows.parts.columns.x[kind_of(self)->thetas];
    pvid_block block;
    pvid_information_block_q31(self->estimator.model, finish->theta, &block);
    for (size_t k = first; k < last; k++) {
        int32_t n[PVID_MAX_THETA_Q31];
        int64_t e;
        row_of(self, k, n);
        const bool fits = pvid_estimator_innovation_q31(&self->estimator, &block, n, y[k], &e);
        y[k] = (int32_t)pvid_clamp_q31(e, PVID_ROW_LIMIT_Q31);
        finish->saturated = finish->saturated || !fits;
        finish->rss = pvid_clamp_q31(finish->rss + pvid_short_square_q31(y[k]), PVID_WIDE);
    }
    finish->index = (uint16_t)(last - finish->live);
    return last < rows;
}

/* rss over its expectation. */
static pvid_scaled_q31 variance_ratio_of(pvid_scaled_q31 of_row, int64_t rss, int64_t freedom)
{
    const pvid_scaled_q31 expected = pvid_scaled_times_q31(pvid_scaled_of_q31(freedom, 0), of_row);
    return pvid_scaled_over_q31(pvid_scaled_of_q31(rss, 0), expected);
}

/* Rows of the kind: test functions less nuisances; at least 1. */
static int64_t freedom_of(const pvid_weak_q31 *self)
{
    const int64_t freedom = (int64_t)self->design->functions - (int64_t)self->finish.live;
    return (freedom > 0) ? freedom : 1;
}

/* The rows so far count no more. */
PVID_COLD static void begin_anew(pvid_weak_q31 *self)
{
    pvid_trust_begin_anew_q31(&self->trust, &self->estimator);
    memset(&self->finish.scores, 0, sizeof self->finish.scores);
}

/* Whether the gate accepts the kind, whose residuals may then change the variance of its own error; if it opens to a
 * changed mechanism, the sums begin anew. Saturated rows pass; the estimator rejects them. */
static bool passes(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    pvid_gate_q31 *gate = &finish->gate[finish->kind];
    if (finish->saturated) {
        return true;
    }
    const pvid_scaled_q31 ratio = variance_ratio_of(finish->expected, finish->rss, freedom_of(self));
    const pvid_gate_verdict verdict = (gate->limit.m == 0) ? PVID_GATE_ACCEPTS : pvid_gate_judge_q31(gate, ratio);
    if (verdict == PVID_GATE_REJECTS) {
        return false;
    }
    if (verdict == PVID_GATE_OPENS) {
        pvid_trust_open_q31(&self->trust);
    }
    const pvid_scaled_q31 least = self->design->error_variance[finish->kind];
    if (pvid_weak_error_follows(self->design->model->kinds) && finish->known.used && self->trust.arrived &&
        pvid_weak_error_take_q31(&finish->error[finish->kind], least, ratio)) {
        finish->known.age = NOISE_WINDOWS; /* the next window computes the noise anew */
    }
    return true;
}

static bool fade_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    if (finish->used > 0u) {
        return false;
    }
    if (finish->index == 0u) {
        finish->fade_factor = pvid_trust_fade_factor_q31(&self->trust);
        if (finish->left < INT32_MAX) {
            const int64_t factor = pvid_times_q31(finish->fade_factor, finish->left);
            finish->fade_factor = (factor > 0) ? (int32_t)factor : 1;
            finish->left = INT32_MAX;
        }
    }
    if (finish->fade_factor > 0) {
        pvid_information_fade_q31(&self->estimator.information, finish->index, finish->fade_factor);
    }
    finish->index++;
    return finish->index < PVID_INFORMATION_END_PARTS;
}

/* A row, whose e is in the place of Y; none of a kind in which one does not fit. */
static bool add_stage(pvid_weak_q31 *self, pvid_reason *reason)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const size_t k = (size_t)finish->live + finish->index;
    if (finish->saturated) {
        pvid_count_up(&self->estimator.counters.rejected_saturated);
        *reason = PVID_REJECTED_SATURATED;
    } else {
        const int32_t e = finish->work.rows.parts.columns.x[kind_of(self)->thetas][k];
        int32_t n[PVID_MAX_THETA_Q31];
        pvid_block block;
        row_of(self, k, n);
        pvid_information_block_q31(self->estimator.model, finish->theta, &block);
        pvid_estimator_add_row_q31(&self->estimator, &block, n, e, pvid_short_square_q31(e));
    }
    finish->index++;
    return (k + 1u) < self->design->functions;
}

static void pull_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    if (finish->known.compensates && !finish->saturated) {
        pvid_scaled_q31 pull[PVID_MAX_THETA_Q31];
        memset(pull, 0, sizeof pull);
        memcpy(&pull[finish->theta], &finish->known.pull[finish->theta], kind_of(self)->thetas * sizeof pull[0]);
        (void)pvid_estimator_add_to_b_q31(&self->estimator, pull);
    }
}

/* ---- steps of p and verdict ---- */

/* Variance of a row by the sensors' noise alone, mean over the kinds; all of it where that is not known. */
static pvid_scaled_q31 expected_of(const pvid_weak_q31 *self)
{
    const pvid_weak_finish_q31 *finish = &self->finish;
    if (finish->known.sensors.m <= 0) {
        return finish->expected;
    }
    const pvid_scaled_q31 kinds = pvid_scaled_of_q31((int64_t)self->design->model->kinds, 0);
    return pvid_scaled_times_q31(finish->expected, pvid_scaled_over_q31(finish->known.sensors, kinds));
}

static void begin_solves(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const int32_t *fallback = pvid_trust_fallback_q31(&self->trust);
    pvid_estimator_set_expected_q31(&self->estimator, expected_of(self));
    pvid_estimator_begin_q31(&self->estimator, &finish->work.solve, true);
    finish->rss = finish->work.solve.group_rss;
    finish->exponent = self->estimator.information.exponent;
    if (fallback != NULL) {
        finish->work.solve.has_fallback = true;
        memcpy(finish->work.solve.fallback, fallback, sizeof finish->work.solve.fallback);
    }
}

/* Whether a solve that has been done leaves M as it was. */
static bool keeps_matrix(const pvid_weak_q31 *self)
{
    const pvid_information_q31 *information = &self->estimator.information;
    return (self->finish.reason != PVID_ACCUMULATED) && (information->retention == INT32_MAX) &&
           (information->exponent == self->finish.exponent);
}

static bool solve_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    if (!pvid_estimator_advance_q31(&self->estimator, &finish->work.solve)) {
        return true;
    }
    finish->iteration++;
    finish->reason = finish->work.solve.reason;
    finish->size = finish->work.solve.size;
    /* ACCUMULATED: the divider allows no solve after this window */
    if ((finish->iteration >= pvid_weak_steps(self->iterations, self->trust.groups)) ||
        (finish->reason == PVID_ACCUMULATED)) {
        return false;
    }
    pvid_estimator_begin_q31(&self->estimator, &finish->work.solve, false);
    finish->work.solve.keeps_matrix = keeps_matrix(self);
    return true;
}

/* A window without rows has no score. */
PVID_COLD static void mean_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const pvid_scaled_q31 ratio = variance_ratio_of(expected_of(self), finish->rss, finish->free);
    finish->rss = pvid_scaled_fixed_q31(ratio, PVID_VARIANCE_RATIO_BITS);
    if (finish->rss == 0) {
        pvid_weak_scores_skip_q31(&finish->scores);
    } else if (finish->reason != PVID_ACCUMULATED) {
        pvid_weak_scores_add_q31(&finish->scores, &self->estimator, &finish->work.solve, finish->rss);
    } else {
        /* no solve was due */
    }
}

/* Rows of the windows between two solves. */
static uint32_t rows_of(const pvid_weak_q31 *self)
{
    const pvid_weak_model_q31 *model = self->design->model;
    uint32_t rows = 0;
    for (size_t i = 0; i < model->kinds; i++) {
        rows += (uint32_t)self->design->functions - model->kind[i].nuisances;
    }
    return rows * self->estimator.divider;
}

/* Returns whether there are more parameters. */
PVID_COLD static bool cluster_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    const size_t n_p = self->estimator.model->n_p;
    const size_t end = lesser((size_t)finish->index + CLUSTERS_PER_STAGE, n_p);
    if ((finish->reason != PVID_ACCUMULATED) && finish->work.solve.now.system.factor.positive) {
        pvid_weak_scores_widen_q31(&finish->scores, &self->estimator, &finish->work.solve, rows_of(self), finish->index,
                                   end, &finish->work.solve.matrix.estimate);
    }
    finish->index = (uint16_t)end;
    return end < n_p;
}

/* Part of the explained variance of a window that is the sensors'. */
static pvid_scaled_q31 sensors_part(const pvid_weak_finish_q31 *self)
{
    const bool known = (self->known.sensors.m > 0) && (self->known.explained.m > 0);
    return known ? pvid_scaled_over_q31(self->known.sensors, self->known.explained) : pvid_scaled_of_q31(1, 0);
}

static void judge_stage(pvid_weak_q31 *self, pvid_reason *reason)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    pvid_estimate_q31 *candidate = &finish->work.solve.matrix.estimate;
    bool errs = false;
    for (size_t i = 0; i < self->design->model->kinds; i++) {
        errs = errs || pvid_scaled_exceeds_q31(finish->error[i].variance, self->design->error_variance[i]);
    }
    const pvid_reason judged = pvid_trust_decide_q31(&self->trust, &self->estimator, finish->reason, finish->size,
                                                     finish->work.solve.above_noise, finish->rss, candidate);
    *reason = pvid_trust_publish_q31(&self->trust, &self->estimator, judged, finish->reason, candidate);
    const pvid_scaled_q31 sensors = sensors_part(finish);
    const pvid_scaled_q31 ratio = pvid_scaled_of_q31(finish->rss, -(int32_t)PVID_VARIANCE_RATIO_BITS);
    const int64_t part = pvid_clamp_q31(pvid_scaled_fixed_q31(sensors, 16), 65536);
    pvid_trust_stand_q31(&self->trust, judged, finish->reason,
                         pvid_scaled_fixed_q31(pvid_scaled_times_q31(ratio, sensors), PVID_VARIANCE_RATIO_BITS),
                         finish->free, errs, (uint32_t)(65536 - part), candidate);
    if (finish->left < INT32_MAX) {
        begin_anew(self);
    }
}

/* p starts again, if it has to: sums of zero, gates and errors of the equations as behind init. */
PVID_COLD static void restart_stage(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    int32_t p[PVID_MAX_P];
    if (!pvid_trust_start_q31(&self->trust, &self->estimator, finish->reason, p)) {
        return;
    }
    pvid_estimator_clear_q31(&self->estimator);
    for (uint8_t a = 0; a < self->estimator.model->n_p; a++) {
        pvid_estimator_place_q31(&self->estimator, a, p[a]);
    }
    for (size_t i = 0; i < self->design->model->kinds; i++) {
        pvid_gate_restart_q31(&finish->gate[i]);
    }
    pvid_weak_error_init_q31(finish->error, self->design);
    finish->left = INT32_MAX;
    finish->known.age = NOISE_WINDOWS; /* the noise at this p */
    begin_anew(self);
}

/* ---- the order of the stages ---- */

/* Behind a kind: the next kind, or the solves; nothing if no kind has been added. */
static void end_kind(pvid_weak_q31 *self)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    finish->theta = (uint8_t)(finish->theta + kind_of(self)->thetas);
    finish->kind++;
    if (finish->kind < self->design->model->kinds) {
        begin_kind(finish);
    } else if (finish->used > 0u) {
        finish->stage = STAGE_SOLVE;
        begin_solves(self);
    } else {
        pvid_weak_scores_skip_q31(&finish->scores);
        pvid_trust_skip_q31(&self->trust, true);
        finish->stage = STAGE_IDLE;
    }
}

/* Whether there is more of the present stage, of those of a kind. */
static bool advance_kind(pvid_weak_q31 *self, pvid_reason *reason)
{
    bool more;
    switch (self->finish.stage) {
    case STAGE_WEIGH:
        more = weigh_stage(self);
        break;
    case STAGE_SPECTRUM:
        more = spectrum_stage(self);
        break;
    case STAGE_INVERT:
        more = invert_stage(self);
        break;
    case STAGE_MIRROR:
        more = reflector_stage(self);
        break;
    case STAGE_LEVERAGE:
        more = leverage_stage(self);
        break;
    case STAGE_SHARE:
        more = share_stage(self);
        break;
    case STAGE_NOISE:
        more = noise_stage(self);
        break;
    case STAGE_UNIT:
        more = unit_stage(self);
        break;
    case STAGE_COLUMN:
        more = column_stage(self);
        break;
    case STAGE_PROJECT:
        more = project_stage(self);
        break;
    case STAGE_FORMAT:
        more = format_stage(self);
        break;
    case STAGE_RESIDUAL:
        more = residual_stage(self);
        break;
    case STAGE_FADE:
        more = fade_stage(self);
        break;
    case STAGE_ADD:
        more = add_stage(self, reason);
        break;
    default: /* STAGE_PULL */
        pull_stage(self);
        more = false;
        break;
    }
    return more;
}

static void step_kind(pvid_weak_q31 *self, pvid_reason *reason)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    if (advance_kind(self, reason)) {
        return;
    }
    const bool noise = finish->known.renewed && finish->known.used;
    if ((finish->stage == (uint8_t)STAGE_RESIDUAL) && !passes(self)) {
        pvid_count_up(&self->estimator.counters.rejected_outlier);
        *reason = PVID_REJECTED_OUTLIER;
        finish->rejected = true;
        self->trust.standing.rejects = true;
    }
    if (finish->stage == (uint8_t)STAGE_PULL) {
        finish->used++;
        finish->free = (uint16_t)(finish->free + (uint16_t)freedom_of(self));
        end_kind(self);
    } else if (finish->rejected && (!noise || (finish->stage == (uint8_t)STAGE_NOISE))) {
        end_kind(self);
    } else {
        const bool to_noise = finish->rejected && (finish->stage == (uint8_t)STAGE_RESIDUAL);
        const bool to_pull = !noise && (finish->stage == (uint8_t)STAGE_ADD);
        const uint8_t next = (uint8_t)(to_pull ? (uint8_t)STAGE_PULL : (finish->stage + 1u));
        finish->stage = (uint8_t)(to_noise ? (uint8_t)STAGE_LEVERAGE : next);
        finish->index = 0;
        finish->part = 0;
    }
}

void pvid_weak_finish_step_q31(pvid_weak_q31 *self, pvid_reason *reason)
{
    pvid_weak_finish_q31 *finish = &self->finish;
    switch (finish->stage) {
    case STAGE_SOLVE:
        if (!solve_stage(self)) {
            finish->stage = STAGE_MEAN;
        }
        break;
    case STAGE_MEAN:
        mean_stage(self);
        finish->stage = STAGE_ASSESS;
        pvid_estimator_begin_assessment_q31(&self->estimator, &finish->work.solve);
        finish->work.solve.keeps_matrix = keeps_matrix(self);
        break;
    case STAGE_ASSESS:
        if (pvid_estimator_assess_advance_q31(&self->estimator, &finish->work.solve,
                                              &finish->work.solve.matrix.estimate)) {
            finish->stage = STAGE_CLUSTER;
            finish->index = 0;
        }
        break;
    case STAGE_CLUSTER:
        if (!cluster_stage(self)) {
            finish->stage = STAGE_JUDGE;
        }
        break;
    case STAGE_JUDGE:
        judge_stage(self, reason);
        finish->stage = STAGE_RESTART;
        break;
    case STAGE_RESTART:
        restart_stage(self);
        finish->stage = STAGE_IDLE;
        break;
    case STAGE_IDLE:
        break;
    default:
        step_kind(self, reason);
        break;
    }
}

static uint32_t stages_of(size_t all, size_t few)
{
    return (uint32_t)((all > 0u) ? ((all + (few - 1u)) / few) : 1u);
}

/* Up to the last that reads the window's sums. */
static uint32_t stages_of_columns(const pvid_weak_design_q31 *design)
{
    const size_t harmonics = pvid_weak_harmonics_q31(design);
    return stages_of(design->n_noise, ENTRIES_PER_STAGE) + stages_of(harmonics, HARMONICS_PER_STAGE) +
           stages_of(harmonics, ROOTS_PER_STAGE) + (uint32_t)pvid_weak_reflectors_q31(design) +
           stages_of(harmonics, UNITS_PER_STAGE) + (uint32_t)harmonics;
}

static uint32_t stages_of_kind(const pvid_weak_q31 *self, const pvid_weak_kind *kind)
{
    const pvid_weak_design_q31 *design = self->design;
    const size_t harmonics = pvid_weak_harmonics_q31(design);
    const size_t rows = design->functions;
    size_t project = (kind->nuisances == 0u) ? 1u : 0u;
    for (size_t i = 0; i < kind->nuisances; i++) {
        project += ((size_t)kind->thetas + 1u + kind->nuisances) - i;
    }
    const uint32_t noise = self->finish.known.used ? ((uint32_t)pvid_weak_reflectors_q31(design) +
                                                      stages_of(harmonics, SHARES_PER_STAGE) + 2u + design->n_noise)
                                                   : 0u;
    return noise + stages_of_columns(design) + (uint32_t)columns_of(kind) + (uint32_t)project +
           stages_of((size_t)kind->thetas + 1u, FORMATS_PER_STAGE) + stages_of(rows, RESIDUALS_PER_STAGE) +
           PVID_INFORMATION_END_PARTS + (uint32_t)rows + 1u;
}

uint32_t pvid_weak_finish_columns_q31(const pvid_weak_q31 *self)
{
    const pvid_weak_model_q31 *model = self->design->model;
    uint32_t stages = stages_of_columns(self->design);
    for (size_t i = 0; (i + 1u) < model->kinds; i++) {
        stages += stages_of_kind(self, &model->kind[i]);
    }
    return stages;
}

uint32_t pvid_weak_finish_stages_q31(const pvid_weak_q31 *self)
{
    const pvid_weak_model_q31 *model = self->design->model;
    uint32_t stages = 3u + stages_of(self->estimator.model->n_p, CLUSTERS_PER_STAGE); /* MEAN, JUDGE, RESTART */
    for (size_t i = 0; i < model->kinds; i++) {
        stages += stages_of_kind(self, &model->kind[i]);
    }
    const uint32_t first = pvid_estimator_stages_q31(&self->estimator, true);
    const uint32_t more = pvid_estimator_stages_q31(&self->estimator, false);
    return stages + first + ((self->iterations - 1u) * more) + pvid_estimator_assessment_stages_q31(&self->estimator);
}
