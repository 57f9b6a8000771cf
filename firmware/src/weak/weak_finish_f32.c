#include "number/uncontracted.h"

#include "number/short_loops.h"

#include "weak/weak_finish_f32.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "judge/gate_f32.h"
#include "judge/outcome.h"
#include "judge/trust_f32.h"
#include "number/count.h"
#include "number/exact.h"
#include "solve/information_f32.h"
#include "solve/pattern_f32.h"
#include "solve/products_f32.h"
#include "solve/staged_f32.h"
#include "solve/state_f32.h"
#include "weak/columns_f32.h"
#include "weak/error.h"
#include "weak/error_f32.h"
#include "weak/scores_f32.h"
#include "weak/steps.h"
#include "weak/sums_f32.h"
#include "weak/white_f32.h"

enum {
    /* for each kind of rows */
    STAGE_WEIGH,    /* c_j from a few entries of the noise table */
    STAGE_SPECTRUM, /* D_h */
    STAGE_SCALE,    /* 1 / sqrt(D_h) */
    STAGE_BASIS,    /* directions that the test functions leave out: white_f32.c */
    STAGE_SHARE,    /* a few harmonics' share of R^-1 */
    STAGE_NOISE,    /* for each column of C: information of the noise alone; nothing if that is not checked */
    STAGE_COLUMN,   /* for each column: its terms one by one, then its real and its imaginary parts to rows */
    STAGE_PROJECT,  /* for each nuisance: what remains of it, then a column without it */
    STAGE_RESIDUAL, /* a few rows of e */
    STAGE_SQUARES,  /* of a few columns */
    STAGE_GATE,     /* the estimator and the gate accept or reject the kind */
    STAGE_PULL,     /* g from a few entries of the noise table */
    STAGE_CORRECT,  /* g to the estimator */
    STAGE_ADD,      /* a few products of columns to the estimator; then WEIGH of the next kind */
    /* for the window */
    STAGE_SCORE,   /* C^T (sum N e + g) */
    STAGE_BEGIN,   /* of a solve */
    STAGE_SOLVE,   /* several stages; BEGIN again as often as steps.h says */
    STAGE_MEAN,    /* the scores to their means */
    STAGE_PREPARE, /* of the assessment; this and the next three only behind a solve that was due */
    STAGE_ASSESS,  /* several stages */
    STAGE_CLUSTER, /* n_p times: standard error of a parameter from the scatter of the scores */
    STAGE_GROW,    /* the covariance grows with the standard errors; it is compared with the published estimate */
    STAGE_JUDGE,   /* trust.h decides */
    STAGE_PUBLISH, /* publishes the estimate or holds it */
    STAGE_STAND,   /* the standing of the published one: standing.h */
    STAGE_RESTART, /* p starts again, if it has to */
    STAGE_IDLE = PVID_WEAK_IDLE
};

/* Entries of the noise table, and products of the residuals and of columns, in a stage. */
#define ENTRIES_PER_STAGE 7u
#define PRODUCTS_PER_STAGE 30u

/* Most functions with which a stage reflects the real and the imaginary parts of a column. */
#define BOTH_FAMILIES 16u

/* Harmonics whose share a stage forms. */
#define SHARES_PER_STAGE 4u

/* Windows in the average of the gate's scale, which is relative to the weights of the rows and at least 1. */
#define GATE_MEMORY 4.0f

/* Largest variance of a parameter from the scatter: a covariance of two such is finite. */
#define VARIANCE_MAX 1.0e36f

static const pvid_weak_kind *kind_of(const pvid_weak_f32 *self)
{
    return &self->design->model->kind[self->finish.kind];
}

static size_t columns_of(const pvid_weak_kind *kind)
{
    return (size_t)kind->thetas + 1u + kind->nuisances;
}

/* Test functions, the rows of a kind. */
static size_t rows_of(const pvid_weak_f32 *self)
{
    return PVID_COUNT(PVID_MAX_FUNCTIONS, self->design->functions);
}

PVID_COLD pvid_status pvid_weak_finish_init_f32(pvid_weak_finish_f32 *self, const pvid_weak_config_f32 *config,
                                                float dt)
{
    const pvid_weak_design_f32 *design = config->design;
    const float windows_hz = 1.0f / (dt * (float)design->hop);
    for (size_t i = 0; i < design->model->kinds; i++) {
        const pvid_status status = pvid_gate_init_f32(&self->gate[i], &config->gate, windows_hz, GATE_MEMORY, 1.0f);
        if (status != PVID_OK) {
            return status;
        }
    }
    self->compensation = config->compensation;
    pvid_weak_white_init_f32(&self->white, design, dt);
    pvid_weak_scores_init_f32(&self->scores, config->estimator.forgetting_s * windows_hz);
    pvid_weak_error_init_f32(self->error, design);
    self->left = 1.0f;
    self->report = (uint8_t)PVID_ACCUMULATED;
    self->stage = STAGE_IDLE;
    return PVID_OK;
}

static void begin_kind(pvid_weak_finish_f32 *self)
{
    self->index = 0;
    self->phase = 0;
    self->other = 0;
    self->moment = 0;
    self->live = 0;
    self->rss = 0.0f;
    self->stage = STAGE_WEIGH;
}

void pvid_weak_finish_skip_f32(pvid_weak_finish_f32 *self)
{
    self->no_predecessor = true;
}

void pvid_weak_finish_begin_f32(pvid_weak_finish_f32 *self)
{
    if (self->no_predecessor) {
        pvid_weak_scores_skip_f32(&self->scores);
    }
    self->no_predecessor = false;
    self->kind = 0;
    self->theta = 0;
    self->term = 0;
    self->used = 0;
    self->iteration = 0;
    self->expected = 0.0f;
    self->explained = 0.0f;
    self->free = 0.0f;
    self->square = 0.0f;
    begin_kind(self);
}

/* ---- rows of a kind ---- */

/* Moves the index by so many items of a stage; returns whether it is to be repeated for more of them. */
static bool goes_on(pvid_weak_finish_f32 *self, size_t last, size_t all)
{
    self->index = (uint16_t)last;
    return last < all;
}

/* One past the next few of a stage's items. */
static size_t last_of(const pvid_weak_finish_f32 *self, size_t each, size_t all)
{
    const size_t end = (size_t)self->index + each;
    return (end < all) ? end : all;
}

PVID_NOINLINE static bool weigh_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t all = self->design->n_noise;
    const size_t last = last_of(finish, ENTRIES_PER_STAGE, all);
    const size_t thetas = kind_of(self)->thetas;
    float *theta = finish->work.rows.theta;
    if (finish->index == 0u) {
        memcpy(theta, &self->estimator.theta[finish->theta], thetas * sizeof theta[0]);
        theta[thetas] = -1.0f;
    }
    pvid_weak_white_weigh_f32(&finish->white, self->design, finish->kind, theta, finish->index, last);
    return goes_on(finish, last, all);
}

PVID_NOINLINE static bool spectrum_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    pvid_weak_white_spectrum_f32(&finish->white, self->design, finish->kind, finish->error[finish->kind].variance);
    return false;
}

PVID_COLD static bool scale_stage(pvid_weak_f32 *self)
{
    pvid_weak_rows_f32 *rows = &self->finish.work.rows;
    pvid_weak_white_scale_f32(&self->finish.white, self->design);
    if (self->finish.kind == 0u) {
        memset(rows->score, 0, sizeof rows->score);
        memset(self->finish.candidate.covariance, 0, sizeof self->finish.candidate.covariance);
    }
    return false;
}

PVID_NOINLINE static bool basis_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t place = finish->index;
    pvid_weak_white_basis_f32(&finish->white, self->design, place, &finish->work.rows.of_kind.basis);
    return goes_on(finish, place + 1u, pvid_weak_basis_stages(self->design));
}

PVID_NOINLINE static bool share_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t all = pvid_weak_harmonics(self->design);
    const size_t last = last_of(finish, SHARES_PER_STAGE, all);
    pvid_weak_white_share_f32(&finish->white, self->design, &finish->work.rows.of_kind.basis, finish->index, last);
    return goes_on(finish, last, all);
}

/* S is compared with the information of the sensors' noise. */
static bool checks_noise(const pvid_weak_f32 *self)
{
    return (self->estimator.settings.noise_margin > 0.0f) && (self->design->n_noise > 0u);
}

/* Weight of a window's rows. */
static float weight_of(const pvid_weak_f32 *self)
{
    return ((float)self->design->functions * (float)self->design->model->kinds) *
           self->estimator.information.row_weight;
}

/* The column of C whose non-zeros begin at `other`; of Y, behind the kind's entries, there is none. */
static void begin_column(const pvid_weak_f32 *self, pvid_weak_slopes_f32 *slopes)
{
    const pvid_model_f32 *model = self->estimator.model;
    const size_t end = pvid_pattern_end_f32(model, self->finish.other);
    for (size_t i = 0; i <= model->n_theta; i++) {
        slopes->column[i] = 0.0f;
        slopes->product[i] = 0.0f;
    }
    for (size_t k = self->finish.other; k < end; k++) {
        slopes->column[model->c_row[k]] = slopes->c[k];
    }
    slopes->column[(size_t)self->finish.theta + kind_of(self)->thetas] = 0.0f;
}

/* Adds row `index` of C^T V C over the weight of the rows. */
static void add_noise(pvid_weak_f32 *self, const pvid_weak_slopes_f32 *slopes)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const pvid_model_f32 *model = self->estimator.model;
    const float weight = weight_of(self);
    float *s = finish->candidate.covariance[finish->index];
    float row[PVID_MAX_P];
    pvid_pattern_project_row_f32(model, slopes->c, finish->other, slopes->product, row);
    for (size_t b = finish->index; b < model->n_p; b++) {
        s[b] += row[b] / weight;
    }
}

/* C at p; then for each column of it, whose non-zeros begin at `other`, V times it by a few entries of the noise table,
 * V as in white_f32.h. The sum is in the place of the covariance of the assessment, which comes later. */
PVID_NOINLINE static bool noise_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const pvid_model_f32 *model = self->estimator.model;
    pvid_weak_slopes_f32 *slopes = &finish->work.rows.of_kind.slopes;
    if (!checks_noise(self)) {
        return false;
    }
    const size_t phase = finish->phase;
    finish->phase++;
    if (phase == 0u) {
        model->jacobian(self->estimator.p, slopes->c);
        return true;
    }
    const size_t all = self->design->n_noise;
    const size_t end = phase * ENTRIES_PER_STAGE;
    const size_t first = end - ENTRIES_PER_STAGE;
    if (phase == 1u) {
        begin_column(self, slopes);
    }
    if (first < all) {
        pvid_weak_white_pull_f32(&finish->white, self->design, finish->kind, &slopes->column[finish->theta], first,
                                 (end < all) ? end : all, &slopes->product[finish->theta]);
        return true;
    }
    slopes->product[(size_t)finish->theta + kind_of(self)->thetas] = 0.0f; /* of Y */
    add_noise(self, slopes);
    finish->phase = 1;
    finish->other = (uint8_t)pvid_pattern_end_f32(model, finish->other);
    if (finish->other == model->n_c) {
        finish->other = 0;
        return false;
    }
    finish->index++;
    return true;
}

/* Adds a term of the present column, if it has one. Returns whether another one follows. */
static bool gather_term(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const pvid_weak_term_f32 *term = self->design->model->term;
    const uint16_t end = kind_of(self)->end;
    if ((finish->term < end) && (term[finish->term].column == finish->index)) {
        pvid_weak_columns_add_f32(self->design, &term[finish->term], &finish->white,
                                  (const float (*)[PVID_MAX_CHANNELS][2])pvid_weak_window_f32(self),
                                  finish->work.rows.part);
        finish->term++;
    }
    return (finish->term < end) && (term[finish->term].column == finish->index);
}

/* Rows of a family of the present column from its parts. */
static void reflect_parts(pvid_weak_f32 *self, size_t family)
{
    pvid_weak_rows_f32 *rows = &self->finish.work.rows;
    const pvid_weak_design_f32 *design = self->design;
    const size_t vectors = pvid_weak_vectors(design);
    const size_t cosines = pvid_weak_harmonics(design) - vectors;
    const size_t count = (family == 0u) ? cosines : (pvid_weak_sines(design) - vectors);
    float *row = &rows->of_kind.column[self->finish.index][(family == 0u) ? 0u : cosines];
    float *part = rows->part[family];
    pvid_weak_white_reflect_f32(&self->finish.white, design, family, vectors, part);
    for (size_t i = 0; i < count; i++) {
        row[i] = part[family + vectors + i];
    }
}

/* No terms yet. */
static void clear_parts(pvid_weak_f32 *self)
{
    float (*part)[PVID_MAX_HARMONICS] = self->finish.work.rows.part;
    PVID_UNROLL_EXACT
    for (size_t h = 0; h < pvid_weak_harmonics(self->design); h++) {
        part[0][h] = 0.0f;
        part[1][h] = 0.0f;
    }
}

/* The present column: its terms, the first of them in phase 0, then the rows of one family after the other. */
PVID_NOINLINE static bool column_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const bool both = self->design->functions <= BOTH_FAMILIES;
    if (finish->phase == 0u) {
        clear_parts(self);
    }
    if (finish->phase < 2u) {
        finish->phase = (uint16_t)(gather_term(self) ? 1u : 2u);
        return true;
    }
    if (finish->phase == 2u) {
        reflect_parts(self, 0);
    }
    if ((finish->phase == 2u) && !both) {
        finish->phase = 3;
        return true;
    }
    reflect_parts(self, 1);
    finish->phase = 0;
    return goes_on(finish, (size_t)finish->index + 1u, columns_of(kind_of(self)));
}

/* Columns that a stage projects. */
static size_t projections_per_stage(const pvid_weak_design_f32 *design)
{
    return ((2u * (size_t)design->functions) < PRODUCTS_PER_STAGE) ? (PRODUCTS_PER_STAGE / (2u * design->functions))
                                                                   : 1u;
}

/* Of each nuisance in order: part 0 its inverse square, then the columns without it, those of theta, Y and the
 * nuisances behind it. */
PVID_NOINLINE static bool project_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    float (*column)[PVID_MAX_FUNCTIONS] = finish->work.rows.of_kind.column;
    float *own = finish->work.rows.own;
    const pvid_weak_kind *kind = kind_of(self);
    const size_t rows = rows_of(self);
    const size_t first = (size_t)kind->thetas + 1u;
    const size_t nuisance = first + finish->index;
    if (finish->index >= kind->nuisances) {
        return false;
    }
    if (finish->phase == 0u) {
        for (size_t i = nuisance; (finish->index == 0u) && (i < columns_of(kind)); i++) {
            own[i] = pvid_product_f32(column[i], column[i], rows);
        }
        const bool kept = pvid_weak_columns_keep_f32(rows, column[nuisance], own[nuisance], &own[nuisance]);
        finish->live = (uint8_t)(finish->live + (kept ? 1u : 0u));
        finish->phase = 1;
        return true;
    }
    const size_t others = columns_of(kind) - (finish->index + 1u);
    for (size_t left = projections_per_stage(self->design); (left > 0u) && (finish->phase <= others); left--) {
        const size_t place = finish->phase - 1u;
        pvid_weak_columns_project_f32(rows, column[nuisance], own[nuisance],
                                      column[(place < first) ? place : (place + finish->index + 1u)]);
        finish->phase++;
    }
    if (finish->phase <= others) {
        return true;
    }
    finish->phase = 0;
    return goes_on(finish, (size_t)finish->index + 1u, kind->nuisances);
}

/* Rows whose residuals a stage forms. */
static size_t rows_per_stage(const pvid_weak_kind *kind)
{
    return (kind->thetas < PRODUCTS_PER_STAGE) ? (PRODUCTS_PER_STAGE / (kind->thetas + 1u)) : 1u;
}

/* Products of columns that a stage forms. */
static size_t products_per_stage(const pvid_weak_design_f32 *design)
{
    return (design->functions < PRODUCTS_PER_STAGE) ? (PRODUCTS_PER_STAGE / design->functions) : 1u;
}

/* e, in the place of Y */
PVID_NOINLINE static bool residual_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const float (*column)[PVID_MAX_FUNCTIONS] = (const float (*)[PVID_MAX_FUNCTIONS])finish->work.rows.of_kind.column;
    const pvid_weak_kind *kind = kind_of(self);
    const float *theta = &self->estimator.theta[finish->theta];
    const size_t last = last_of(finish, rows_per_stage(kind), rows_of(self));
    float *e = finish->work.rows.of_kind.column[kind->thetas];
    for (size_t k = finish->index; k < last; k++) {
        float left = e[k];
        for (size_t j = 0; j < kind->thetas; j++) {
            left -= theta[j] * column[j][k];
        }
        e[k] = left;
        finish->rss += left * left;
    }
    return goes_on(finish, last, rows_of(self));
}

PVID_COLD static bool squares_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t thetas = kind_of(self)->thetas;
    const size_t last = last_of(finish, products_per_stage(self->design), thetas);
    for (size_t j = finish->index; j < last; j++) {
        const float *column = finish->work.rows.of_kind.column[j];
        finish->work.rows.own[j] = pvid_product_f32(column, column, rows_of(self));
    }
    return goes_on(finish, last, thetas);
}

/* A stage has something to report. */
static void report(pvid_weak_finish_f32 *self, pvid_reason reason)
{
    self->report = (uint8_t)pvid_outcome((pvid_reason)self->report, reason);
}

/* Behind a kind: the next kind, or the solves; nothing if no kind has been added. */
PVID_COLD static void end_kind(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const pvid_weak_kind *kind = kind_of(self);
    finish->theta = (uint8_t)(finish->theta + kind->thetas);
    finish->term = kind->end;
    finish->kind++;
    if (finish->kind < self->design->model->kinds) {
        begin_kind(finish);
    } else if (finish->used == 0u) {
        pvid_weak_scores_skip_f32(&finish->scores);
        pvid_trust_skip_f32(&self->trust, true);
        finish->stage = STAGE_IDLE;
    } else {
        finish->stage = STAGE_SCORE;
    }
}

/* The rows so far count no more. */
PVID_COLD static void begin_anew(pvid_weak_f32 *self)
{
    pvid_trust_begin_anew_f32(&self->trust, &self->estimator);
    pvid_weak_scores_init_f32(&self->finish.scores, self->finish.scores.memory);
}

/* The estimator and the gate accept the kind, or the reason why not. */
PVID_COLD static pvid_reason accept_kind(pvid_weak_f32 *self, float freedom)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const pvid_reason accepted =
        pvid_products_accept_f32(&self->estimator, kind_of(self)->thetas, finish->work.rows.own, finish->rss);
    if (accepted != PVID_ACCUMULATED) {
        return accepted;
    }
    const pvid_gate_verdict verdict = pvid_gate_judge_f32(&finish->gate[finish->kind], finish->rss / freedom);
    if (verdict == PVID_GATE_REJECTS) {
        pvid_count_up(&self->estimator.counters.rejected_outlier);
        self->trust.standing.rejects = true;
        return PVID_REJECTED_OUTLIER;
    }
    if (verdict == PVID_GATE_OPENS) {
        pvid_trust_open_f32(&self->trust);
    }
    return PVID_ACCUMULATED;
}

PVID_COLD static bool gate_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    /* test functions less nuisances: the dimensions that the rows of the kind span */
    const float freedom = (float)self->design->functions - (float)finish->live;
    const pvid_reason accepted = accept_kind(self, freedom);
    if (accepted != PVID_ACCUMULATED) {
        report(finish, accepted);
        end_kind(self);
        return false;
    }
    if (finish->used == 0u) {
        const float factor = finish->left * pvid_trust_fade_factor_f32(&self->trust);
        finish->left = 1.0f;
        if (factor < 1.0f) {
            pvid_information_fade_f32(&self->estimator.information, factor);
        }
    }
    finish->used++;
    finish->free += freedom;
    finish->square += finish->rss;
    memset(finish->work.rows.pull, 0, sizeof finish->work.rows.pull);
    return false;
}

PVID_COLD static bool pull_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t all = finish->compensation ? self->design->n_noise : 0u;
    const size_t last = last_of(finish, ENTRIES_PER_STAGE, all);
    pvid_weak_white_pull_f32(&finish->white, self->design, finish->kind, finish->work.rows.theta, finish->index, last,
                             &finish->work.rows.pull[finish->theta]);
    return goes_on(finish, last, all);
}

PVID_COLD static bool correct_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t thetas = kind_of(self)->thetas;
    for (size_t j = finish->theta; j < finish->theta + thetas; j++) {
        finish->work.rows.score[j] += finish->work.rows.pull[j];
    }
    finish->work.rows.pull[finish->theta + thetas] = 0.0f; /* of Y */
    if (finish->compensation) {
        (void)pvid_estimator_add_to_b_f32(&self->estimator, finish->work.rows.pull);
    }
    const float sensors = pvid_weak_white_sensors_f32(&finish->white, self->design);
    finish->expected += sensors;
    finish->explained += sensors + (self->design->error_variance[finish->kind] *
                                    pvid_weak_white_error_share_f32(&finish->white, self->design, finish->kind));
    return false;
}

/* The residuals of the kind to the variance of its own error. */
PVID_COLD static void take_error(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const pvid_weak_design_f32 *design = self->design;
    const uint8_t kind = finish->kind;
    const float residual = finish->rss / ((float)design->functions - (float)finish->live);
    const float share = pvid_weak_white_error_share_f32(&finish->white, design, kind);
    const float left = pvid_weak_error_take_f32(&finish->error[kind], design->error_variance[kind], residual, share);
    if (left < 1.0f) {
        pvid_gate_begin_anew_f32(&finish->gate[kind]);
    }
    finish->left = (left < finish->left) ? left : finish->left;
}

/* Products of column `index` with those behind it, the last of them e: a row of M without its diagonal, and an entry of
 * b. */
PVID_NOINLINE static bool add_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    pvid_weak_rows_f32 *work = &finish->work.rows;
    const pvid_model_f32 *model = self->estimator.model;
    const size_t thetas = kind_of(self)->thetas;
    pvid_block block;
    pvid_information_block_f32(model, finish->theta, &block);
    if (finish->index == thetas) {
        pvid_products_end_f32(&self->estimator, &block, work->theta, finish->rss, (uint32_t)rows_of(self));
        if (pvid_weak_error_follows(self->design->model->kinds) && self->trust.arrived) {
            take_error(self);
        }
        end_kind(self);
        return false;
    }
    float *low = self->estimator.information.low;
    for (size_t left = products_per_stage(self->design); (left > 0u) && (finish->index < thetas); left--) {
        const size_t i = finish->index;
        if (finish->other == 0u) {
            low[block.moment + finish->moment] += work->own[i];
            finish->moment++;
            finish->other = (uint8_t)(i + 1u);
        }
        const float product =
            pvid_product_f32(work->of_kind.column[i], work->of_kind.column[finish->other], rows_of(self));
        if (finish->other < thetas) {
            low[block.moment + finish->moment] += product;
            finish->moment++;
            finish->other++;
            continue;
        }
        low[(size_t)model->n_moments + finish->theta + i] += product;
        work->theta[i] = product;
        work->score[finish->theta + i] += product;
        finish->other = 0;
        finish->index++;
    }
    return true;
}

/* ---- steps of p and verdict ---- */

PVID_COLD static bool score_stage(pvid_weak_f32 *self)
{
    pvid_weak_scores_take_f32(&self->finish.scores, &self->estimator, self->finish.work.rows.score);
    return false;
}

PVID_COLD static bool begin_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const bool first = finish->iteration == 0u;
    if (first) {
        pvid_estimator_set_expected_f32(&self->estimator, finish->expected / (float)finish->used);
    }
    pvid_estimator_begin_f32(&self->estimator, &finish->work.solve, first);
    finish->work.solve.fallback = first ? pvid_trust_fallback_f32(&self->trust) : NULL;
    if (checks_noise(self)) {
        finish->work.solve.noise = (const float (*)[PVID_MAX_P])finish->candidate.covariance;
    }
    return false;
}

/* ACCUMULATED: the divider allows no solve after this window. */
PVID_NOINLINE static bool solve_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    if (!pvid_estimator_advance_f32(&self->estimator, &finish->work.solve)) {
        return true;
    }
    finish->iteration++;
    finish->reason = finish->work.solve.reason;
    finish->size = finish->work.solve.size;
    if ((finish->reason != PVID_ACCUMULATED) &&
        (finish->iteration < pvid_weak_steps(self->iterations, self->trust.groups))) {
        finish->stage = STAGE_BEGIN;
    }
    return false;
}

/* No assessment if no solve was due. */
PVID_COLD static bool mean_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    pvid_weak_scores_add_f32(&finish->scores, self->estimator.model->n_p, finish->square / finish->free);
    if (finish->reason == PVID_ACCUMULATED) {
        finish->stage = STAGE_JUDGE;
    }
    return false;
}

PVID_COLD static bool prepare_stage(pvid_weak_f32 *self)
{
    pvid_estimator_assess_solved_f32(&self->estimator, &self->finish.work.solve, &self->finish.candidate);
    return false;
}

PVID_COLD static bool assess_stage(pvid_weak_f32 *self)
{
    return !pvid_estimator_assess_advance_f32(&self->estimator, &self->finish.work.solve);
}

/* The larger of the two standard errors of a parameter; the covariance grows with it. */
PVID_COLD static bool cluster_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    pvid_estimate_f32 *estimate = &finish->candidate;
    const size_t n_p = self->estimator.model->n_p;
    const size_t a = finish->index;
    const float wide = finish->work.solve.variance * self->estimator.settings.correlation;
    const float variance =
        pvid_weak_scores_variance_f32(&finish->scores, n_p, a, (const float (*)[PVID_MAX_P])estimate->covariance, wide,
                                      estimate->weight / weight_of(self));
    /* NaN fails the comparison */
    if ((variance > (estimate->se[a] * estimate->se[a])) && (variance <= VARIANCE_MAX)) {
        estimate->se[a] = sqrtf(variance);
    }
    return goes_on(finish, a + 1u, n_p);
}

PVID_COLD static bool grow_stage(pvid_weak_f32 *self)
{
    pvid_estimate_f32 *estimate = &self->finish.candidate;
    const size_t n_p = self->estimator.model->n_p;
    float growth[PVID_MAX_P];
    for (size_t a = 0; a < n_p; a++) {
        const float before = estimate->covariance[a][a];
        growth[a] = (before > 0.0f) ? (estimate->se[a] / sqrtf(before)) : 1.0f;
    }
    for (size_t a = 0; a < n_p; a++) {
        for (size_t b = 0; b < n_p; b++) {
            estimate->covariance[a][b] *= growth[a] * growth[b];
        }
    }
    pvid_trust_compare_f32(&self->trust, n_p, estimate);
    return false;
}

/* Residual variance of the window over that of its rows, a sum over the kinds. */
static float ratio_to(const pvid_weak_finish_f32 *self, float variance)
{
    return self->work.solve.group_rss / (self->free * (variance / (float)self->used));
}

PVID_COLD static bool judge_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    finish->verdict = (uint8_t)pvid_trust_decide_f32(&self->trust, &self->estimator, finish->reason, finish->size,
                                                     finish->work.solve.above_noise, ratio_to(finish, finish->expected),
                                                     &finish->candidate);
    return false;
}

PVID_COLD static bool publish_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    report(finish, pvid_trust_publish_f32(&self->trust, &self->estimator, (pvid_reason)finish->verdict, finish->reason,
                                          &finish->candidate));
    if (pvid_weak_error_follows(self->design->model->kinds) && (finish->left < 1.0f)) {
        begin_anew(self);
    }
    return false;
}

PVID_COLD static bool stand_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    bool errs = false;
    for (size_t i = 0; i < self->design->model->kinds; i++) {
        errs = errs || (finish->error[i].variance > self->design->error_variance[i]);
    }
    const float sensors = finish->expected / finish->explained;
    const uint32_t own = (sensors < 1.0f) ? (uint32_t)((1.0f - sensors) * 65536.0f) : 0u; /* NaN too */
    pvid_trust_stand_f32(&self->trust, (pvid_reason)finish->verdict, finish->reason,
                         ratio_to(finish, finish->explained), (uint16_t)finish->free, errs, own, &finish->candidate);
    return false;
}

/* p starts again: sums of zero, gates and errors of the equations as behind init. */
PVID_COLD static bool restart_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    float p[PVID_MAX_P];
    finish->stage = STAGE_IDLE;
    if (!pvid_trust_start_f32(&self->trust, &self->estimator, finish->reason, p)) {
        return false;
    }
    pvid_estimator_clear_f32(&self->estimator);
    pvid_estimator_place_f32(&self->estimator, p);
    for (size_t i = 0; i < self->design->model->kinds; i++) {
        pvid_gate_restart_f32(&finish->gate[i]);
    }
    pvid_weak_error_init_f32(finish->error, self->design);
    finish->left = 1.0f;
    begin_anew(self);
    return false;
}

/* ---- the order of the stages ---- */

/* Runs a stage; returns whether it is to be repeated. */
static bool run_stage(pvid_weak_f32 *self, uint8_t stage)
{
    switch (stage) {
    case STAGE_WEIGH:
        return weigh_stage(self);
    case STAGE_SPECTRUM:
        return spectrum_stage(self);
    case STAGE_SCALE:
        return scale_stage(self);
    case STAGE_BASIS:
        return basis_stage(self);
    case STAGE_SHARE:
        return share_stage(self);
    case STAGE_NOISE:
        return noise_stage(self);
    case STAGE_COLUMN:
        return column_stage(self);
    case STAGE_PROJECT:
        return project_stage(self);
    case STAGE_RESIDUAL:
        return residual_stage(self);
    case STAGE_SQUARES:
        return squares_stage(self);
    case STAGE_GATE:
        return gate_stage(self);
    case STAGE_PULL:
        return pull_stage(self);
    case STAGE_CORRECT:
        return correct_stage(self);
    case STAGE_ADD:
        return add_stage(self);
    case STAGE_SCORE:
        return score_stage(self);
    case STAGE_BEGIN:
        return begin_stage(self);
    case STAGE_SOLVE:
        return solve_stage(self);
    case STAGE_MEAN:
        return mean_stage(self);
    case STAGE_PREPARE:
        return prepare_stage(self);
    case STAGE_ASSESS:
        return assess_stage(self);
    case STAGE_CLUSTER:
        return cluster_stage(self);
    case STAGE_GROW:
        return grow_stage(self);
    case STAGE_JUDGE:
        return judge_stage(self);
    case STAGE_PUBLISH:
        return publish_stage(self);
    case STAGE_STAND:
        return stand_stage(self);
    default:
        return restart_stage(self);
    }
}

/* A stage that is complete is followed by the next one, if it names no other. */
void pvid_weak_finish_run_f32(pvid_weak_f32 *self, uint32_t stages)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    uint32_t left = stages;
    do {
        const uint8_t stage = finish->stage;
        finish->stage = (uint8_t)(stage + 1u);
        if (run_stage(self, stage)) {
            finish->stage = stage;
        } else {
            finish->index = 0;
            finish->phase = 0;
        }
        left--;
    } while ((left > 0u) && pvid_weak_finish_is_busy_f32(finish));
}

/* ---- their number ---- */

static uint32_t parts_of(uint32_t all, uint32_t each)
{
    return (all > each) ? ((all + (each - 1u)) / each) : 1u;
}

/* Of a kind until its columns are formed, at most: a stage for each of its terms, and one for a column without any. */
PVID_COLD static uint32_t stages_of_columns(const pvid_weak_f32 *self, const pvid_weak_kind *kind)
{
    const pvid_weak_design_f32 *design = self->design;
    const uint32_t columns = (uint32_t)columns_of(kind);
    const uint32_t terms = (uint32_t)kind->end - kind->first;
    const uint32_t entries = parts_of(design->n_noise, ENTRIES_PER_STAGE);
    const uint32_t noise = checks_noise(self) ? (1u + ((entries + 1u) * design->model->model->n_p)) : 1u;
    const uint32_t reflected = columns * ((design->functions <= BOTH_FAMILIES) ? 1u : 2u);
    const uint32_t shares = parts_of((uint32_t)pvid_weak_harmonics(design), SHARES_PER_STAGE);
    return entries + 2u + (uint32_t)pvid_weak_basis_stages(design) + shares + noise + columns + terms +
           reflected; /* 2: SPECTRUM, SCALE */
}

/* Of each nuisance its square, then the other columns. */
PVID_COLD static uint32_t stages_of_kind(const pvid_weak_f32 *self, const pvid_weak_kind *kind)
{
    const pvid_weak_design_f32 *design = self->design;
    const uint32_t thetas = kind->thetas;
    const uint32_t products = (uint32_t)products_per_stage(design);
    const uint32_t projected = parts_of((uint32_t)columns_of(kind) - 1u, (uint32_t)projections_per_stage(design));
    return stages_of_columns(self, kind) + ((kind->nuisances * (1u + projected)) + 1u) +
           parts_of(design->functions, (uint32_t)rows_per_stage(kind)) + parts_of(thetas, products) +
           parts_of((thetas * (thetas + 1u)) / 2u, products) + parts_of(design->n_noise, ENTRIES_PER_STAGE) +
           3u; /* GATE, CORRECT, the end of ADD */
}

PVID_COLD uint32_t pvid_weak_finish_columns_f32(const pvid_weak_f32 *self)
{
    const pvid_weak_model_f32 *model = self->design->model;
    uint32_t stages = 0;
    for (size_t i = 0; (i + 1u) < model->kinds; i++) {
        stages += stages_of_kind(self, &model->kind[i]);
    }
    return stages + stages_of_columns(self, &model->kind[model->kinds - 1u]);
}

PVID_COLD uint32_t pvid_weak_finish_stages_f32(const pvid_weak_f32 *self)
{
    const pvid_weak_model_f32 *model = self->design->model;
    uint32_t stages =
        9u + model->model->n_p; /* SCORE, BEGIN, MEAN, PREPARE, GROW, JUDGE, PUBLISH, STAND, RESTART; CLUSTER */
    for (size_t i = 0; i < model->kinds; i++) {
        stages += stages_of_kind(self, &model->kind[i]);
    }
    const uint32_t first = pvid_estimator_stages_f32(&self->estimator, true);
    const uint32_t more = pvid_estimator_stages_f32(&self->estimator, false);
    return stages + first + ((self->iterations - 1u) * (more + 1u)) + /* BEGIN */
           pvid_estimator_assess_solved_stages_f32(&self->estimator);
}
