#include "number/uncontracted.h"

#include "weak/finish_f32.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "solve/cholesky_f32.h"
#include "number/count.h"
#include "solve/staged_f32.h"
#include "solve/state_f32.h"
#include "number/finite_f32.h"
#include "number/unroll.h"
#include "full_angle_f32.h"
#include "weak/whiten_f32.h"
#include "weak/window_f32.h"

enum {
    STAGE_COMBINE,     /* K times: a row of R0 at p; sums of a function to the columns (Y, N, a, b) of its row */
    STAGE_REMAINDER,   /* correction for large angles, if enabled: its own stages (full_angle_f32.h) */
    STAGE_FACTOR,      /* K times: a row of L, R0 = L L^T */
    STAGE_TRACE,       /* 4 K times: a row of L^-1, then its part of the three noise traces */
    STAGE_WHITEN,      /* K times: a row of L^-1 (Y, N, a, b) */
    STAGE_DIRECTION_A, /* column a over the functions as a unit vector */
    STAGE_ALONG_A,     /* components of all columns along it, a few functions at a time */
    STAGE_REMOVE_A,    /* subtracts them, a few functions at a time */
    STAGE_DIRECTION_B, /* the same with column b */
    STAGE_ALONG_B,
    STAGE_REMOVE_B,
    STAGE_FIT,    /* residuals of the rows for the gate, a few functions at a time */
    STAGE_ADD,    /* K times: a row to the estimator; before the first one the gate accepts or rejects the window */
    STAGE_SOLVE,  /* `iterations` solves (steps of p), several stages each: estimator.h */
    STAGE_ASSESS, /* several stages: standard errors, then trust.h publishes the estimate or holds it */
    STAGE_IDLE
};

#define TRACE_STAGES (1u + PVID_NOISE_TRACES)

/* Functions per stage of the projection. */
#define FUNCTIONS_PER_STAGE 6u

void pvid_weak_finish_init_f32(pvid_weak_finish_f32 *self)
{
    self->stage = STAGE_IDLE;
}

bool pvid_weak_finish_is_busy_f32(const pvid_weak_finish_f32 *self)
{
    return self->stage != STAGE_IDLE;
}

/* (N1..N8, Y, a, b, 0, 0) of theory.md, (10) and (11), in place of a function's sums. N1..N3 are where they belong. */
static void assemble(float sum[PVID_WEAK_TERMS])
{
    const float u = sum[PVID_TERM_U];
    const float ut = sum[PVID_TERM_UT];
    const float uiu = sum[PVID_TERM_UIU];
    const float ui1 = sum[PVID_TERM_UI1];
    sum[PVID_WEAK_COLUMN_N + 3] = sum[PVID_TERM_UIF] + sum[PVID_TERM_CHI_UF];
    sum[PVID_WEAK_COLUMN_N + 4] = sum[PVID_TERM_CHI_F];
    sum[PVID_WEAK_COLUMN_N + 5] = uiu;
    sum[PVID_WEAK_COLUMN_N + 6] = ui1 + sum[PVID_TERM_CHI_U];
    sum[PVID_WEAK_COLUMN_N + 7] = sum[PVID_TERM_CHI_1];
    sum[PVID_WEAK_COLUMN_Y] = sum[PVID_TERM_Y];
    sum[PVID_WEAK_COLUMN_A] = u;
    sum[PVID_WEAK_COLUMN_B] = ut;
    sum[PVID_WEAK_COLUMN_C1] = 0.0f;
    sum[PVID_WEAK_COLUMN_C2] = 0.0f;
}

/* x -= a y for the columns of two functions. */
static inline void subtract(float a, const float *restrict y, float *restrict x)
{
    PVID_UNROLL
    for (size_t i = 0; i < PVID_WEAK_COLUMNS; i++) {
        x[i] -= a * y[i];
    }
}

/* The unit vector of a column over the functions; 0 if its squared length is not a positive normal number (without a
 * drive there is nothing to remove). */
static void find_direction(pvid_weak_finish_f32 *self, size_t functions, size_t column,
                           const float sums[][PVID_WEAK_TERMS])
{
    float square = 0.0f;
    for (size_t k = 0; k < functions; k++) {
        square += sums[k][column] * sums[k][column];
    }
    const bool usable = (square >= 1.17549435e-38f) && (square <= 3.4e38f);
    const float inverse = 1.0f / sqrtf(usable ? square : 1.0f);
    for (size_t k = 0; k < functions; k++) {
        self->direction[k] = usable ? (sums[k][column] * inverse) : 0.0f;
    }
}

/* sum += a x for the columns of a function. */
static inline void add_scaled(float a, const float *restrict x, float *restrict sum)
{
    PVID_UNROLL
    for (size_t i = 0; i < PVID_WEAK_COLUMNS; i++) {
        sum[i] += a * x[i];
    }
}

static void find_components(pvid_weak_finish_f32 *self, size_t first, size_t last, const float sums[][PVID_WEAK_TERMS])
{
    if (first == 0u) {
        memset(self->along, 0, sizeof self->along);
    }
    for (size_t k = first; k < last; k++) {
        add_scaled(self->direction[k], sums[k], self->along);
    }
}

static void remove_components(const pvid_weak_finish_f32 *self, size_t first, size_t last,
                              float sums[][PVID_WEAK_TERMS])
{
    for (size_t k = first; k < last; k++) {
        subtract(self->direction[k], self->along, sums[k]);
    }
}

void pvid_weak_finish_begin_f32(pvid_weak_finish_f32 *self, const pvid_estimator_f32 *estimator,
                                pvid_weak_angle_f32 *angle, float expected)
{
    pvid_weak_whiten_begin_f32(&self->whiten, estimator->p);
    self->angle = angle;
    if (pvid_angle_correction_enabled_f32(angle)) {
        pvid_weak_angle_begin_f32(angle, estimator->p);
    }
    self->expected = expected;
    self->iteration = 0;
    self->index = 0;
    self->stage = STAGE_COMBINE;
}

/* rss += e^2 of the rows first..last-1 at the present p. */
static void add_residuals(pvid_weak_finish_f32 *self, const pvid_estimator_f32 *estimator, size_t first, size_t last,
                          const float columns[][PVID_WEAK_TERMS])
{
    if (first == 0u) {
        self->rss = 0.0f;
    }
    for (size_t k = first; k < last; k++) {
        float e = columns[k][PVID_WEAK_COLUMN_Y];
        for (size_t i = 0; i < estimator->model->n_theta; i++) {
            const size_t linear = (size_t)PVID_KAPITZA_WEAK_THETA;
            const size_t column = (i < linear) ? i : ((i - linear) + (size_t)PVID_WEAK_COLUMN_C1);
            e -= columns[k][column] * estimator->theta[i];
        }
        self->rss += e * e;
    }
}

/* Before the rows are added: sets the noise traces of the rows (those of the last window if R0 could not be factored)
 * and fades the sums during a renewal (trust.h). */
static void begin_rows(const pvid_weak_finish_f32 *self, pvid_estimator_f32 *estimator, pvid_trust_f32 *trust)
{
    if (self->whiten.whitened) {
        memcpy(estimator->noise, self->whiten.trace, sizeof estimator->noise);
    }
    pvid_information_fade_f32(&estimator->information, pvid_trust_fade_factor_f32(trust));
}

/* Adds a row to the estimator; sets *reason if the estimator rejects it. */
static void add_row(const float column[PVID_WEAK_TERMS], pvid_estimator_f32 *estimator, pvid_reason *reason)
{
    float n[PVID_KAPITZA_FRICTION_THETA];
    memcpy(n, &column[PVID_WEAK_COLUMN_N], PVID_KAPITZA_WEAK_THETA * sizeof n[0]);
    n[PVID_KAPITZA_WEAK_THETA] = column[PVID_WEAK_COLUMN_C1];
    n[PVID_KAPITZA_WEAK_THETA + 1] = column[PVID_WEAK_COLUMN_C2];
    const pvid_reason added = pvid_estimator_add_f32(estimator, n, column[PVID_WEAK_COLUMN_Y]);
    if (added != PVID_ACCUMULATED) {
        *reason = added;
    }
}

static void begin_solves(pvid_weak_finish_f32 *self, pvid_estimator_f32 *estimator, const pvid_trust_f32 *trust)
{
    pvid_estimator_set_expected_f32(estimator, self->expected);
    pvid_estimator_begin_f32(estimator, &self->solve, true);
    self->solve.fallback = pvid_trust_fallback_f32(trust);
}

/* A stage of a solve. Returns true when the last solve of the window is complete. */
static bool advance_solve(pvid_weak_finish_f32 *self, uint8_t iterations, pvid_estimator_f32 *estimator)
{
    if (!pvid_estimator_advance_f32(estimator, &self->solve)) {
        return false;
    }
    self->iteration++;
    self->reason = self->solve.reason;
    self->size = self->solve.size;
    /* ACCUMULATED: the divider allows no solve after this window */
    if ((self->iteration >= iterations) || (self->reason == PVID_ACCUMULATED)) {
        return true;
    }
    pvid_estimator_begin_f32(estimator, &self->solve, false);
    return false;
}

/* A stage of the assessment. Returns true when the estimate has been judged. self->solve.group_rss is still that of the
 * window's first solve. */
static bool advance_assessment(pvid_weak_finish_f32 *self, const pvid_weak_design_f32 *design,
                               pvid_estimator_f32 *estimator, pvid_trust_f32 *trust)
{
    if (!pvid_estimator_assess_advance_f32(estimator, &self->solve)) {
        return false;
    }
    const float freedom = (float)design->functions - 2.0f;
    const float variance_ratio = self->solve.group_rss / (freedom * self->expected);
    const bool stepped = self->reason == PVID_UPDATED;
    self->reason = pvid_trust_judge_f32(trust, estimator, self->reason, self->size, self->solve.above_noise,
                                        variance_ratio, &self->candidate);
    if (pvid_angle_correction_enabled_f32(self->angle) && stepped) {
        const float worst = pvid_trust_largest_error_f32(estimator, &self->candidate);
        if (pvid_weak_angle_switch_f32(self->angle, estimator->p, worst, trust->groups)) {
            pvid_trust_renew_f32(trust, estimator); /* the sums contain rows without the correction */
        }
    }
    return true;
}

void pvid_weak_finish_step_f32(pvid_weak_finish_f32 *self, const pvid_weak_design_f32 *design, uint8_t iterations,
                               float sums[][PVID_WEAK_TERMS], pvid_estimator_f32 *estimator, pvid_trust_f32 *trust,
                               pvid_reason *reason)
{
    const size_t functions = design->functions;
    const float (*fixed)[PVID_WEAK_TERMS] = (const float (*)[PVID_WEAK_TERMS])sums;
    const size_t row = self->index;
    const size_t few = ((row + FUNCTIONS_PER_STAGE) < functions) ? (row + FUNCTIONS_PER_STAGE) : functions;
    size_t done = row + 1u; /* calls or functions of this stage that are done after this call */
    size_t all = functions; /* the stage ends when so many are done */
    switch (self->stage) {
    case STAGE_COMBINE:
        pvid_weak_whiten_combine_f32(&self->whiten, design, row);
        assemble(sums[row]);
        break;
    case STAGE_REMAINDER:
        if (pvid_angle_correction_enabled_f32(self->angle) &&
            !pvid_weak_angle_step_f32(self->angle, design, estimator->theta, sums)) {
            return;
        }
        done = functions;
        break;
    case STAGE_FACTOR:
        pvid_weak_whiten_factor_f32(&self->whiten, row);
        break;
    case STAGE_TRACE:
        all = TRACE_STAGES * functions;
        if ((row % TRACE_STAGES) == 0u) {
            pvid_weak_whiten_inverse_f32(&self->whiten, row / TRACE_STAGES, self->direction);
        } else {
            pvid_weak_whiten_trace_f32(&self->whiten, design, row / TRACE_STAGES, self->direction,
                                       (row % TRACE_STAGES) - 1u);
        }
        break;
    case STAGE_WHITEN:
        pvid_weak_whiten_row_f32(&self->whiten, row, sums);
        break;
    case STAGE_DIRECTION_A:
        find_direction(self, functions, PVID_WEAK_COLUMN_A, fixed);
        done = functions;
        break;
    case STAGE_DIRECTION_B:
        find_direction(self, functions, PVID_WEAK_COLUMN_B, fixed);
        done = functions;
        break;
    case STAGE_ALONG_A:
    case STAGE_ALONG_B:
        find_components(self, row, few, fixed);
        done = few;
        break;
    case STAGE_REMOVE_A:
    case STAGE_REMOVE_B:
        remove_components(self, row, few, sums);
        done = few;
        break;
    case STAGE_FIT:
        if (self->gate.limit > 0.0f) {
            add_residuals(self, estimator, row, few, fixed);
        }
        done = few;
        break;
    case STAGE_ADD:
        add_row(sums[row], estimator, reason);
        break;
    case STAGE_SOLVE:
        if (!advance_solve(self, iterations, estimator)) {
            return;
        }
        done = functions;
        break;
    case STAGE_ASSESS:
        if (!advance_assessment(self, design, estimator, trust)) {
            return;
        }
        *reason = self->reason;
        done = functions;
        break;
    default:
        return;
    }
    self->index = (uint16_t)done;
    if (done >= all) {
        self->index = 0;
        self->stage++;
        if (self->stage == STAGE_ADD) {
            const float freedom = (float)functions - 2.0f;
            if (pvid_gate_passes_f32(&self->gate, self->rss / (freedom * self->expected))) {
                begin_rows(self, estimator, trust);
            } else {
                pvid_count_up(&estimator->counters.rejected_outlier);
                *reason = PVID_REJECTED_OUTLIER;
                self->stage = STAGE_IDLE;
            }
        } else if (self->stage == STAGE_SOLVE) {
            begin_solves(self, estimator, trust);
        } else if (self->stage == STAGE_ASSESS) {
            pvid_estimator_begin_assessment_f32(estimator, &self->solve, &self->candidate);
        }
    }
}

uint32_t pvid_weak_finish_stages_f32(const pvid_weak_design_f32 *design, uint8_t iterations,
                                     const pvid_estimator_f32 *estimator, const pvid_weak_angle_f32 *angle)
{
    const uint32_t functions = design->functions;
    const uint32_t remainder =
        pvid_angle_correction_enabled_f32(angle) ? pvid_weak_angle_stages_f32(angle, design) : 1u;
    const uint32_t parts = (functions + (FUNCTIONS_PER_STAGE - 1u)) / FUNCTIONS_PER_STAGE;
    const uint32_t rows = ((4u + TRACE_STAGES) * functions) + 2u + (5u * parts) + remainder;
    const uint32_t first = pvid_estimator_stages_f32(estimator, true);
    const uint32_t more = pvid_estimator_stages_f32(estimator, false);
    return rows + first + ((iterations - 1u) * more) + pvid_estimator_assessment_stages_f32(estimator);
}
