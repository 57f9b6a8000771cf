#include "number/uncontracted.h"

#include "number/short_loops.h"

#include "weak/weak_finish_f32.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "weak/columns_f32.h"
#include "weak/noise_f32.h"
#include "weak/scores_f32.h"
#include "weak/steps.h"
#include "weak/sums_f32.h"
#include "weak/white_f32.h"
#include "judge/trust_f32.h"
#include "number/count.h"
#include "number/exact.h"
#include "solve/information_f32.h"
#include "solve/products_f32.h"
#include "solve/staged_f32.h"

enum {
    /* for each kind of rows */
    STAGE_WEIGH,    /* c_j from a few entries of the noise table */
    STAGE_SPECTRUM, /* D_h */
    STAGE_SCALE,    /* 1 / sqrt(D_h) */
    STAGE_BASIS,    /* directions that the test functions leave out: white_f32.c */
    STAGE_SHARE,    /* a few parts' share of R^-1; only if that is needed */
    STAGE_NOISE,    /* the entries of two columns: information of the noise alone; nothing if that is not checked */
    STAGE_COLUMN,   /* for each column: its terms one by one, then its real and its imaginary parts to rows */
    STAGE_PROJECT,  /* for each nuisance: what remains of it, then a column without it */
    STAGE_RESIDUAL, /* a few rows of e */
    STAGE_SQUARES,  /* of a few columns */
    STAGE_GATE,     /* the estimator and the gate accept or reject the kind */
    STAGE_PULL,     /* g from a few entries of the noise table; this and the next only if the share is needed */
    STAGE_CORRECT,  /* g to the estimator */
    STAGE_ADD,      /* a few products of columns to the estimator */
    /* for the window */
    STAGE_SCORE,   /* C^T (sum N e + g) */
    STAGE_BEGIN,   /* of a solve */
    STAGE_SOLVE,   /* several stages; BEGIN again as often as steps.h says */
    STAGE_MEAN,    /* the scores to their means */
    STAGE_PREPARE, /* of the assessment; this and the next three only behind a solve that was due */
    STAGE_ASSESS,  /* several stages */
    STAGE_CLUSTER, /* n_p times: standard error of a parameter from the scatter of the scores */
    STAGE_GROW,    /* the covariance grows with the standard errors */
    STAGE_JUDGE,   /* trust.h decides */
    STAGE_PUBLISH, /* publishes the estimate or holds it */
    STAGE_IDLE = PVID_WEAK_IDLE
};

/* Entries of the noise table, and products of the residuals and of columns, in a stage. */
#define ENTRIES_PER_STAGE 8u
#define PRODUCTS_PER_STAGE 30u

/* Non-zeros of C that a stage lists by rows. */
#define NONZEROS_PER_STAGE 8u

/* Pairs of columns whose noise a stage adds. */
#define PAIRS_PER_STAGE 1u

/* Most functions with which a stage reflects the real and the imaginary parts of a column. */
#define BOTH_FAMILIES 16u

/* Parts whose share a stage forms. */
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

pvid_status pvid_weak_finish_init_f32(pvid_weak_finish_f32 *self, const pvid_weak_config_f32 *config, float dt)
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
    self->shares = self->compensation;
    for (size_t i = 0; i < design->model->kinds; i++) {
        self->shares = self->shares || (design->error_variance[i] > 0.0f);
    }
    pvid_weak_white_init_f32(&self->white, design, dt);
    pvid_weak_scores_init_f32(&self->scores, config->estimator.forgetting_s * windows_hz);
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
    self->alone = true;
}

void pvid_weak_finish_begin_f32(pvid_weak_finish_f32 *self)
{
    if (self->alone) {
        pvid_weak_scores_skip_f32(&self->scores);
    }
    self->alone = false;
    self->kind = 0;
    self->theta = 0;
    self->term = 0;
    self->used = 0;
    self->iteration = 0;
    self->expected = 0.0f;
    self->free = 0.0f;
    self->square = 0.0f;
    begin_kind(self);
}

/* ---- rows of a kind ---- */

/* The next few entries of the noise table; returns one past them. */
static size_t entries_end(const pvid_weak_f32 *self)
{
    const size_t end = (size_t)self->finish.index + ENTRIES_PER_STAGE;
    return (end < self->design->n_noise) ? end : self->design->n_noise;
}

PVID_SELDOM static bool weigh_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t end = entries_end(self);
    pvid_weak_white_weigh_f32(&finish->white, self->design, finish->kind, &self->estimator.theta[finish->theta],
                              finish->index, end);
    finish->index = (uint16_t)end;
    return end < self->design->n_noise;
}

/* S is compared with the information of the sensors' noise. */
static bool checks_noise(const pvid_weak_f32 *self)
{
    return (self->estimator.settings.noise_margin > 0.0f) && (self->design->n_noise > 0u);
}

/* Weight of a window's rows. */
static float rows_of(const pvid_weak_f32 *self)
{
    return ((float)self->design->functions * (float)self->design->model->kinds) *
           self->estimator.information.row_weight;
}

/* The noise's information is in the place of the covariance of the assessment, which comes later. */
PVID_SELDOM static bool noise_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const pvid_weak_design_f32 *design = self->design;
    if (!checks_noise(self)) {
        return false;
    }
    if ((finish->index == 0u) && (finish->kind == 0u)) {
        memset(finish->candidate.covariance, 0, sizeof finish->candidate.covariance);
    }
    pvid_weak_slopes_f32 *slopes = &finish->work.rows.of_kind.slopes;
    if (finish->phase == 0u) {
        if (!finish->shares) {
            pvid_weak_noise_shares_f32(&finish->white, design, finish->white.share);
        }
        design->model->model->jacobian(self->estimator.p, slopes->c);
        finish->phase = 1;
        return true;
    }
    if (finish->phase == 1u) {
        const size_t n_c = design->model->model->n_c;
        const size_t end = (size_t)finish->index + NONZEROS_PER_STAGE;
        const size_t last = (end < n_c) ? end : n_c;
        pvid_weak_noise_list_f32(design, finish->theta, kind_of(self)->thetas, finish->index, last, slopes);
        finish->index = (uint16_t)last;
        if (last == n_c) {
            finish->index = (uint16_t)pvid_weak_noise_next_f32(design, finish->kind, 0);
            finish->phase = 2;
        }
        return true;
    }
    size_t place = finish->index;
    for (size_t left = PAIRS_PER_STAGE; (left > 0u) && (place < design->n_noise); left--) {
        place = pvid_weak_noise_add_f32(design, place, finish->white.share, rows_of(self), slopes,
                                        finish->candidate.covariance);
        place = pvid_weak_noise_next_f32(design, finish->kind, place);
    }
    finish->index = (uint16_t)place;
    return place < design->n_noise;
}

PVID_SELDOM static bool basis_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    pvid_weak_white_basis_f32(&finish->white, finish->index, &finish->work.rows.of_kind.basis);
    finish->index++;
    return finish->index < pvid_weak_basis_stages(self->design);
}

PVID_SELDOM static bool share_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t parts = pvid_weak_parts(self->design);
    const size_t end = (size_t)finish->index + SHARES_PER_STAGE;
    const size_t last = (end < parts) ? end : parts;
    pvid_weak_white_share_f32(&finish->white, self->design, finish->work.rows.of_kind.basis.leverage, finish->index,
                              last);
    finish->index = (uint16_t)last;
    return last < parts;
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

/* No terms yet. */
static void clear_parts(pvid_weak_finish_f32 *self)
{
    const size_t parts = PVID_COUNT(PVID_MAX_FUNCTIONS + PVID_MAX_POWER, self->white.parts);
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < parts; i++) {
        self->work.rows.part[i] = 0.0f;
    }
}

PVID_SELDOM static void scale_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    pvid_weak_white_scale_f32(&finish->white, self->harmonics);
    clear_parts(finish);
    for (size_t i = 0; (finish->kind == 0u) && (i < (size_t)PVID_MAX_THETA); i++) {
        finish->work.rows.score[i] = 0.0f;
    }
}

/* Rows of a family of the present column from its parts. */
static void reflect_parts(pvid_weak_finish_f32 *self, size_t family)
{
    const pvid_weak_white_f32 *white = &self->white;
    const size_t vectors = PVID_COUNT(PVID_MAX_POWER / 2, white->vectors);
    const size_t cosines = PVID_COUNT(PVID_MAX_HARMONICS, white->cosines);
    const size_t parts = PVID_COUNT(PVID_MAX_FUNCTIONS + PVID_MAX_POWER, white->parts);
    const size_t first = (family == 0u) ? 0u : cosines;
    const size_t rows = ((family == 0u) ? cosines : (parts - cosines)) - vectors;
    float *row = &self->work.rows.of_kind.column[self->index][(family == 0u) ? 0u : (cosines - vectors)];
    float *part = &self->work.rows.part[first];
    pvid_weak_white_reflect_f32(white, family, self->work.rows.part);
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < rows; i++) {
        row[i] = part[vectors + i];
    }
}

/* The present column: its parts, then the rows of one family after the other. */
PVID_SELDOM static bool column_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    if (finish->phase == 0u) {
        finish->phase = (uint8_t)(gather_term(self) ? 0u : 1u);
        return true;
    }
    if (finish->phase == 1u) {
        reflect_parts(finish, 0);
    }
    if ((finish->phase == 1u) && (self->design->functions > BOTH_FAMILIES)) {
        finish->phase = 2;
        return true;
    }
    reflect_parts(finish, 1);
    clear_parts(finish);
    finish->phase = 0;
    finish->index++;
    return finish->index < columns_of(kind_of(self));
}

/* Columns that a stage projects. */
static size_t projections_per_stage(const pvid_weak_design_f32 *design)
{
    return ((2u * (size_t)design->functions) < PRODUCTS_PER_STAGE) ? (PRODUCTS_PER_STAGE / (2u * design->functions))
                                                                   : 1u;
}

/* Of each nuisance in order: part 0 its inverse square, then the columns without it, those of theta, Y and the
 * nuisances behind it. */
PVID_SELDOM static bool project_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const pvid_weak_kind *kind = kind_of(self);
    const size_t rows = self->design->functions;
    const size_t first = (size_t)kind->thetas + 1u;
    const size_t nuisance = first + finish->index;
    if (finish->index >= kind->nuisances) {
        return false;
    }
    if (finish->phase == 0u) {
        if (finish->index == 0u) {
            for (size_t i = first; i < columns_of(kind); i++) {
                finish->work.rows.own[i] =
                    pvid_product_f32(finish->work.rows.of_kind.column[i], finish->work.rows.of_kind.column[i], rows);
            }
        }
        const bool kept = pvid_weak_columns_keep_f32(rows, finish->work.rows.of_kind.column[nuisance],
                                                     finish->work.rows.own[nuisance], &finish->work.rows.own[nuisance]);
        finish->live = (uint8_t)(finish->live + (kept ? 1u : 0u));
        finish->phase = 1;
        return true;
    }
    const size_t others = (first + kind->nuisances) - (finish->index + 1u);
    for (size_t left = projections_per_stage(self->design); (left > 0u) && (finish->phase <= others); left--) {
        const size_t place = finish->phase - 1u;
        const size_t column = (place < first) ? place : (place + finish->index + 1u);
        pvid_weak_columns_project_f32(rows, finish->work.rows.of_kind.column[nuisance], finish->work.rows.own[nuisance],
                                      finish->work.rows.of_kind.column[column]);
        finish->phase++;
    }
    if (finish->phase > others) {
        finish->phase = 0;
        finish->index++;
    }
    return finish->index < kind->nuisances;
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
PVID_SELDOM static bool residual_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const pvid_weak_kind *kind = kind_of(self);
    const float *theta = &self->estimator.theta[finish->theta];
    const size_t rows = self->design->functions;
    const size_t end = (size_t)finish->index + rows_per_stage(kind);
    const size_t last = (end < rows) ? end : rows;
    float *e = finish->work.rows.of_kind.column[kind->thetas];
    float rss = finish->rss;
    for (size_t k = finish->index; k < last; k++) {
        float left = e[k];
        for (size_t j = 0; j < kind->thetas; j++) {
            left -= theta[j] * finish->work.rows.of_kind.column[j][k];
        }
        e[k] = left;
        rss += left * left;
    }
    finish->rss = rss;
    finish->index = (uint16_t)last;
    return last < rows;
}

PVID_SELDOM static bool squares_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t thetas = kind_of(self)->thetas;
    const size_t end = (size_t)finish->index + products_per_stage(self->design);
    const size_t last = (end < thetas) ? end : thetas;
    for (size_t j = finish->index; j < last; j++) {
        finish->work.rows.own[j] = pvid_product_f32(finish->work.rows.of_kind.column[j],
                                                    finish->work.rows.of_kind.column[j], self->design->functions);
    }
    finish->index = (uint16_t)last;
    return last < thetas;
}

/* Test functions less nuisances: the dimensions that the rows of the kind span. */
static float freedom_of(const pvid_weak_f32 *self)
{
    return (float)self->design->functions - (float)self->finish.live;
}

PVID_SELDOM static bool pull_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t end = entries_end(self);
    if (finish->index == 0u) {
        memset(finish->work.rows.pull, 0, sizeof finish->work.rows.pull);
    }
    if (finish->compensation) {
        pvid_weak_white_pull_f32(&finish->white, self->design, finish->kind, &self->estimator.theta[finish->theta],
                                 finish->index, end, &finish->work.rows.pull[finish->theta]);
    }
    finish->index = (uint16_t)end;
    return end < self->design->n_noise;
}

PVID_SELDOM static void correct_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t thetas = kind_of(self)->thetas;
    for (size_t j = finish->theta; j < finish->theta + thetas; j++) {
        finish->work.rows.score[j] += finish->work.rows.pull[j];
    }
    if (finish->compensation) {
        (void)pvid_estimator_add_to_b_f32(&self->estimator, finish->work.rows.pull);
    }
    finish->expected += pvid_weak_white_sensors_f32(&finish->white, self->design);
}

/* Products of column `index` with those behind it, the last of them e: a row of M without its diagonal, and an entry of
 * b. */
PVID_SELDOM static bool add_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const size_t thetas = kind_of(self)->thetas;
    const size_t rows = self->design->functions;
    float *low = self->estimator.information.low;
    pvid_block block;
    pvid_information_block_f32(self->estimator.model, finish->theta, &block);
    if (finish->index == thetas) {
        pvid_products_end_f32(&self->estimator, &block, finish->work.rows.gradient, finish->rss, (uint32_t)rows);
        return false;
    }
    for (size_t left = products_per_stage(self->design); (left > 0u) && (finish->index < thetas); left--) {
        const size_t i = finish->index;
        if (finish->other == 0u) {
            low[block.moment + finish->moment] += finish->work.rows.own[i];
            finish->moment++;
            finish->other = (uint8_t)(i + 1u);
        }
        const float product = pvid_product_f32(finish->work.rows.of_kind.column[i],
                                               finish->work.rows.of_kind.column[finish->other], rows);
        if (finish->other < thetas) {
            low[block.moment + finish->moment] += product;
            finish->moment++;
            finish->other++;
            continue;
        }
        low[(size_t)self->estimator.model->n_moments + finish->theta + i] += product;
        finish->work.rows.gradient[i] = product;
        finish->work.rows.score[finish->theta + i] += product;
        finish->other = 0;
        finish->index++;
    }
    return true;
}

/* ---- steps of p and verdict ---- */

static void begin_solve(pvid_weak_f32 *self)
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
}

PVID_SELDOM static bool solve_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    if (!pvid_estimator_advance_f32(&self->estimator, &finish->work.solve)) {
        return true;
    }
    finish->iteration++;
    finish->reason = finish->work.solve.reason;
    finish->size = finish->work.solve.size;
    return false;
}

/* ACCUMULATED: the divider allows no solve after this window. */
static bool solves_again(const pvid_weak_f32 *self)
{
    return (self->finish.reason != PVID_ACCUMULATED) &&
           (self->finish.iteration < pvid_weak_steps(self->iterations, self->trust.groups));
}

/* The larger of the two standard errors of a parameter; the covariance grows with it. */
PVID_SELDOM static bool cluster_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    pvid_estimate_f32 *estimate = &finish->candidate;
    const size_t n_p = self->estimator.model->n_p;
    const size_t a = finish->index;
    const float wide = finish->work.solve.variance * self->estimator.settings.correlation;
    const float variance =
        pvid_weak_scores_variance_f32(&finish->scores, n_p, a, (const float (*)[PVID_MAX_P])estimate->covariance, wide,
                                      estimate->weight / rows_of(self));
    /* NaN fails the comparison */
    if ((variance > (estimate->se[a] * estimate->se[a])) && (variance <= VARIANCE_MAX)) {
        estimate->se[a] = sqrtf(variance);
    }
    finish->index++;
    return finish->index < n_p;
}

PVID_SELDOM static void grow_stage(pvid_weak_f32 *self)
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
}

PVID_SELDOM static void judge_stage(pvid_weak_f32 *self)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const float expected = finish->expected / (float)finish->used;
    const float variance_ratio = finish->work.solve.group_rss / (finish->free * expected);
    finish->verdict =
        (uint8_t)pvid_trust_decide_f32(&self->trust, &self->estimator, finish->reason, finish->size,
                                       finish->work.solve.above_noise, variance_ratio, &finish->candidate);
}

/* ---- the order of the stages ---- */

/* Behind the residuals: the estimator and the gate. Returns the next stage. */
static uint8_t gated(pvid_weak_f32 *self, pvid_reason *reason)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    const float freedom = freedom_of(self);
    const pvid_reason accepted =
        pvid_products_accept_f32(&self->estimator, kind_of(self)->thetas, finish->work.rows.own, finish->rss);
    if (accepted != PVID_ACCUMULATED) {
        *reason = accepted;
        return STAGE_SCORE; /* that is, the next kind */
    }
    const pvid_gate_verdict verdict = pvid_gate_judge_f32(&finish->gate[finish->kind], finish->rss / freedom);
    if (verdict == PVID_GATE_REJECTS) {
        pvid_count_up(&self->estimator.counters.rejected_outlier);
        *reason = PVID_REJECTED_OUTLIER;
        return STAGE_SCORE;
    }
    if (verdict == PVID_GATE_OPENS) {
        pvid_trust_begin_anew_f32(&self->trust, &self->estimator);
        pvid_weak_scores_init_f32(&finish->scores, finish->scores.memory);
    }
    if (finish->used == 0u) {
        const float factor = pvid_trust_fade_factor_f32(&self->trust);
        if (factor < 1.0f) {
            pvid_information_fade_f32(&self->estimator.information, factor);
        }
    }
    finish->used++;
    finish->free += freedom;
    finish->square += finish->rss;
    if (!finish->shares) {
        finish->expected += 1.0f;
    }
    return finish->shares ? (uint8_t)STAGE_PULL : (uint8_t)STAGE_ADD;
}

/* Behind a kind: the next kind, or the solves; nothing if no kind has been added. */
static void end_kind(pvid_weak_f32 *self)
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
        finish->stage = STAGE_IDLE;
    } else {
        finish->stage = STAGE_SCORE;
    }
}

/* The stage after one that is complete. */
static uint8_t stage_after(pvid_weak_f32 *self, pvid_reason *reason)
{
    switch (self->finish.stage) {
    case STAGE_BASIS:
        return self->finish.shares ? (uint8_t)STAGE_SHARE : (uint8_t)STAGE_NOISE;
    case STAGE_GATE:
        return gated(self, reason);
    case STAGE_SOLVE:
        return solves_again(self) ? (uint8_t)STAGE_BEGIN : (uint8_t)STAGE_MEAN;
    case STAGE_MEAN: /* no assessment if no solve was due */
        return (self->finish.reason == PVID_ACCUMULATED) ? (uint8_t)STAGE_JUDGE : (uint8_t)STAGE_PREPARE;
    case STAGE_PUBLISH:
        return STAGE_IDLE;
    default:
        return (uint8_t)(self->finish.stage + 1u);
    }
}

PVID_SELDOM static void next_stage(pvid_weak_f32 *self, pvid_reason *reason)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    finish->stage = stage_after(self, reason);
    finish->index = 0;
    finish->phase = 0;
    if (finish->stage == (uint8_t)STAGE_SCORE) {
        end_kind(self);
    }
}

void pvid_weak_finish_step_f32(pvid_weak_f32 *self, pvid_reason *reason)
{
    pvid_weak_finish_f32 *finish = &self->finish;
    bool repeat = false;
    switch (finish->stage) {
    case STAGE_WEIGH:
        repeat = weigh_stage(self);
        break;
    case STAGE_SPECTRUM:
        pvid_weak_white_spectrum_f32(&finish->white, self->design, finish->kind, self->harmonics);
        break;
    case STAGE_SCALE:
        scale_stage(self);
        break;
    case STAGE_NOISE:
        repeat = noise_stage(self);
        break;
    case STAGE_BASIS:
        repeat = basis_stage(self);
        break;
    case STAGE_SHARE:
        repeat = share_stage(self);
        break;
    case STAGE_COLUMN:
        repeat = column_stage(self);
        break;
    case STAGE_PROJECT:
        repeat = project_stage(self);
        break;
    case STAGE_RESIDUAL:
        repeat = residual_stage(self);
        break;
    case STAGE_SQUARES:
        repeat = squares_stage(self);
        break;
    case STAGE_PULL:
        repeat = pull_stage(self);
        break;
    case STAGE_GATE:
        break;
    case STAGE_CORRECT:
        correct_stage(self);
        break;
    case STAGE_ADD:
        repeat = add_stage(self);
        break;
    case STAGE_SCORE:
        pvid_weak_scores_take_f32(&finish->scores, &self->estimator, finish->work.rows.score);
        break;
    case STAGE_BEGIN:
        begin_solve(self);
        break;
    case STAGE_SOLVE:
        repeat = solve_stage(self);
        break;
    case STAGE_PREPARE:
        pvid_estimator_assess_solved_f32(&self->estimator, &finish->work.solve, &finish->candidate);
        break;
    case STAGE_ASSESS:
        repeat = !pvid_estimator_assess_advance_f32(&self->estimator, &finish->work.solve);
        break;
    case STAGE_MEAN:
        pvid_weak_scores_add_f32(&finish->scores, self->estimator.model->n_p, finish->square / finish->free);
        break;
    case STAGE_CLUSTER:
        repeat = cluster_stage(self);
        break;
    case STAGE_GROW:
        grow_stage(self);
        break;
    case STAGE_JUDGE:
        judge_stage(self);
        break;
    case STAGE_PUBLISH:
        *reason = pvid_trust_publish_f32(&self->trust, &self->estimator, (pvid_reason)finish->verdict, finish->reason,
                                         &finish->candidate);
        break;
    default:
        return;
    }
    if (!repeat) {
        next_stage(self, reason);
    }
}

/* ---- their number ---- */

static uint32_t parts_of(uint32_t all, uint32_t each)
{
    const uint32_t parts = (all + (each - 1u)) / each;
    return (parts > 0u) ? parts : 1u;
}

/* A stage for each term, and one for each column without any. */
static uint32_t gather_stages(const pvid_weak_design_f32 *design, const pvid_weak_kind *kind)
{
    const pvid_weak_term_f32 *term = design->model->term;
    uint32_t stages = (uint32_t)columns_of(kind);
    for (size_t i = (size_t)kind->first + 1u; i < kind->end; i++) {
        stages += (term[i].column == term[i - 1u].column) ? 1u : 0u;
    }
    return stages;
}

/* For a column. */
static uint32_t reflect_stages(const pvid_weak_design_f32 *design)
{
    return (design->functions <= BOTH_FAMILIES) ? 1u : 2u;
}

/* For nuisance i its square, then all columns but itself and those before it. */
static uint32_t project_stages(const pvid_weak_design_f32 *design, const pvid_weak_kind *kind)
{
    uint32_t stages = 0;
    for (uint32_t i = 0; i < kind->nuisances; i++) {
        const uint32_t others = ((uint32_t)columns_of(kind) - 1u) - i;
        stages += 1u + parts_of(others, (uint32_t)projections_per_stage(design));
    }
    return (stages > 0u) ? stages : 1u;
}

/* Of a kind until its columns are formed. */
static uint32_t stages_of_columns(const pvid_weak_f32 *self, const pvid_weak_kind *kind)
{
    const pvid_weak_design_f32 *design = self->design;
    const uint32_t columns = (uint32_t)columns_of(kind);
    const uint32_t entries = parts_of(design->n_noise, ENTRIES_PER_STAGE);
    const uint32_t pairs = (uint32_t)pvid_weak_noise_pairs_f32(design, (uint8_t)(kind - design->model->kind));
    const uint32_t noise =
        checks_noise(self)
            ? (1u + parts_of(design->model->model->n_c, NONZEROS_PER_STAGE) + parts_of(pairs, PAIRS_PER_STAGE))
            : 1u;
    const uint32_t shares = self->finish.shares ? parts_of((uint32_t)pvid_weak_parts(design), SHARES_PER_STAGE) : 0u;
    return entries + 2u + noise + (uint32_t)pvid_weak_basis_stages(design) + shares + gather_stages(design, kind) +
           (reflect_stages(design) * columns); /* 2: SPECTRUM, SCALE */
}

static uint32_t stages_of_kind(const pvid_weak_f32 *self, const pvid_weak_kind *kind)
{
    const pvid_weak_design_f32 *design = self->design;
    const uint32_t thetas = kind->thetas;
    const uint32_t products = (uint32_t)products_per_stage(design);
    uint32_t stages = stages_of_columns(self, kind) + project_stages(design, kind) + 1u; /* GATE */
    stages += parts_of(design->functions, (uint32_t)rows_per_stage(kind)) + parts_of(thetas, products);
    stages += parts_of((thetas * (thetas + 1u)) / 2u, products) + 1u;
    if (self->finish.shares) {
        stages += parts_of(design->n_noise, ENTRIES_PER_STAGE) + 1u; /* CORRECT */
    }
    return stages;
}

uint32_t pvid_weak_finish_columns_f32(const pvid_weak_f32 *self)
{
    const pvid_weak_model_f32 *model = self->design->model;
    uint32_t stages = 0;
    for (size_t i = 0; (i + 1u) < model->kinds; i++) {
        stages += stages_of_kind(self, &model->kind[i]);
    }
    return stages + stages_of_columns(self, &model->kind[model->kinds - 1u]);
}

uint32_t pvid_weak_finish_stages_f32(const pvid_weak_f32 *self)
{
    const pvid_weak_model_f32 *model = self->design->model;
    uint32_t stages = 7u + model->model->n_p; /* SCORE, BEGIN, MEAN, PREPARE, GROW, JUDGE, PUBLISH; CLUSTER */
    for (size_t i = 0; i < model->kinds; i++) {
        stages += stages_of_kind(self, &model->kind[i]);
    }
    const uint32_t first = pvid_estimator_stages_f32(&self->estimator, true);
    const uint32_t more = pvid_estimator_stages_f32(&self->estimator, false);
    return stages + first + ((self->iterations - 1u) * (more + 1u)) + /* BEGIN */
           pvid_estimator_assess_solved_stages_f32(&self->estimator);
}
