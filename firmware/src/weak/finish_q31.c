#include "weak/finish_q31.h"

#include <stddef.h>
#include <string.h>

#include "solve/cholesky_q31.h"
#include "number/count.h"
#include "solve/row_q31.h"
#include "solve/state_q31.h"
#include "number/integer_q31.h"
#include "number/scaled_q31.h"
#include "weak/window_q31.h"

/* Columns of a row. They replace the sums of its function in place. */
enum { COLUMN_N = 0, COLUMN_Y = 8, COLUMN_A = 9, COLUMN_B = 10, COLUMN_SPARE = 11 };

enum {
    STAGE_COMBINE,  /* K times: a row of R0 at p, a combination of the Gram tables */
    STAGE_ASSEMBLE, /* the columns of a few functions at a time */
    STAGE_FACTOR,   /* K times, long rows in parts: a row of L, R0 = L L^T */
    STAGE_TRACE,    /* K times: a row of L^-1 and its part of the three noise traces */
    STAGE_WHITEN,   /* K times: a row of L^-1 (Y, N, a, b) */
    STAGE_SQUARE_A, /* the length of a */
    STAGE_DIRECTION_A,
    STAGE_ALONG_A,  /* a few functions at a time */
    STAGE_REMOVE_A, /* a few functions at a time */
    STAGE_SQUARE_B,
    STAGE_DIRECTION_B,
    STAGE_ALONG_B,
    STAGE_REMOVE_B,
    STAGE_FIT,    /* residuals of the rows for the gate, a few functions at a time */
    STAGE_NOISE,  /* the gate, and the noise of the rows */
    STAGE_FADE,   /* in two parts: multiplies the sums by the factor of a renewal (trust_q31.h) */
    STAGE_ADD,    /* K times: a row to the estimator */
    STAGE_SOLVE,  /* `iterations` solves of several stages each */
    STAGE_ASSESS, /* several stages */
    STAGE_JUDGE,  /* publishes the estimate or holds it */
    STAGE_IDLE
};

/* Functions per stage of assembly, component along a direction, its removal, residuals. */
#define ASSEMBLED_PER_STAGE 3u
#define ALONG_PER_STAGE 6u
#define REMOVED_PER_STAGE 3u
#define FITTED_PER_STAGE 3u

/* Parts of a long row. WHITEN_PARTS divides PVID_WEAK_COLUMNS_Q31. */
#define FACTOR_PARTS 2u
#define TRACE_PARTS 3u
#define WHITEN_PARTS 3u

/* Largest entry of a column once it is whitened: that of a row. */
#define COLUMN_LIMIT PVID_ROW_LIMIT_Q31

#define COMBINATION_BITS 29 /* six of them times a Gram table of 30 bits fit an int64 */
#define DIRECTION_BITS 27   /* squares of 64 of them also fit */

/* The noise of the rows is needed to a few per cent: tables of 14 bits and rows of 13 suffice; their products add
 * up in 32 bits. */
#define GRAM_22 3u    /* the first of the three Gram tables of chi'' and chi: 22, 20 + 02, 00 */
#define GRAM_DOWN 16u /* from a table's 30 bits to 14 */
#define INVERSE_BITS 15
#define INVERSE_LIMIT ((int32_t)1 << 26) /* 64 of them times an entry of L fit an int64 */
#define ROW_BITS 12
#define ROW_LIMIT 4096

void pvid_weak_finish_init_q31(pvid_weak_finish_q31 *self)
{
    self->stage = STAGE_IDLE;
}

bool pvid_weak_finish_is_busy_q31(const pvid_weak_finish_q31 *self)
{
    return self->stage != STAGE_IDLE;
}

/* A factor of a Gram table: m 2^-bits. */
typedef struct {
    int64_t m;
    int32_t bits;
} factor_of_table;

static factor_of_table reduced(int64_t m, int32_t bits, int32_t length)
{
    int32_t mantissa;
    const int32_t exponent = pvid_to_block_q31(1, &m, length, &mantissa);
    const factor_of_table result = {mantissa, bits - exponent};
    return result;
}

/* The residual of p has the filter chi'''' + d1 w chi'' + d2 w^2 chi: factors of its noise covariance beside G44,
 * in one format, that of the largest. */
void pvid_weak_finish_begin_q31(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design,
                                const pvid_estimator_q31 *estimator, pvid_scaled_q31 pivot)
{
    const pvid_scaled_q31 none = {0, 0};
    const factor_of_table two = reduced(estimator->theta[1], estimator->theta_bits[1], 30);
    const factor_of_table offset = reduced(estimator->theta[4], estimator->theta_bits[4], 30);
    const factor_of_table table[PVID_WEAK_GRAMS] = {
        {1, 0},
        two,
        offset,
        {two.m * two.m, 2 * two.bits},
        {two.m * offset.m, two.bits + offset.bits},
        {offset.m * offset.m, 2 * offset.bits},
    };
    factor_of_table part[PVID_WEAK_GRAMS];
    int32_t common = INT32_MAX;
    for (size_t i = 0; i < PVID_WEAK_GRAMS; i++) {
        part[i] = reduced(table[i].m, table[i].bits, COMBINATION_BITS);
        part[i].bits += design->gram_bits[i];
        common = (part[i].bits < common) ? part[i].bits : common;
    }
    common -= common & 1;
    for (size_t i = 0; i < PVID_WEAK_GRAMS; i++) {
        const int64_t scaled = pvid_scale_q31(part[i].m, part[i].bits - common);
        self->combination[i] = (int32_t)pvid_clamp_q31(scaled, PVID_ONE_Q30 / 2);
    }
    self->gram_bits = (int16_t)common;
    for (size_t i = 0; i < PVID_NOISE_TRACES_Q31; i++) {
        self->trace[i] = none;
    }
    /* in units of Y, independent of the sums' exponent */
    const int64_t square = (int64_t)estimator->settings.row_sd * estimator->settings.row_sd;
    self->expected = pvid_scaled_plus_q31(pvid_scaled_of_q31(square, -2 * PVID_ROW_SD_BITS), pivot);
    self->whitened = true;
    self->saturated = false;
    self->iteration = 0;
    self->index = 0;
    self->stage = STAGE_COMBINE;
}

static size_t row_start(size_t row)
{
    return (row * (row + 1u)) / 2u;
}

static int64_t combined(const pvid_weak_finish_q31 *self, const PVID_TABLE int32_t *gram, size_t size)
{
    int64_t sum = 0;
    for (size_t i = 0; i < PVID_WEAK_GRAMS; i++) {
        sum += (int64_t)self->combination[i] * gram[i * size];
    }
    return sum;
}

/* The row's exponent makes its diagonal entry lie in [1/4, 1). */
static void combine_row(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design, size_t row)
{
    const size_t size = row_start(design->functions);
    const size_t start = row_start(row);
    const int64_t diagonal = combined(self, &design->gram[start + row], size);
    self->exponent[row] = (int16_t)pvid_half_exponent_q31((diagonal > 0) ? diagonal : 1);
    for (size_t j = 0; j < row + 1u; j++) {
        const int64_t sum = combined(self, &design->gram[start + j], size);
        const int32_t exponent = self->exponent[row] + self->exponent[j];
        self->factor[start + j] = (int32_t)pvid_clamp_q31(pvid_scale_q31(sum, exponent), PVID_ONE_Q30);
    }
}

/* (N1..N8, Y, a, b, 0) of theory.md, (10) and (11), in place of a function's sums. */
static void assemble(const pvid_weak_design_q31 *design, int32_t sum[PVID_WEAK_TERMS_Q31])
{
    int32_t share[PVID_WEAK_TERMS_Q31];
    for (size_t i = 0; i < PVID_WEAK_TERMS_Q31; i++) {
        share[i] = (int32_t)pvid_round_shift_q31((int64_t)sum[i] * design->multiplier[i], design->shift[i]);
    }
    sum[COLUMN_N] = share[PVID_TERM_UF_Q31];
    sum[COLUMN_N + 1] = share[PVID_TERM_F_Q31];
    sum[COLUMN_N + 2] = share[PVID_TERM_UIUF_HIGH_Q31] + share[PVID_TERM_UIUF_Q31];
    sum[COLUMN_N + 3] = share[PVID_TERM_UIF_HIGH_Q31] + share[PVID_TERM_UIF_Q31] + share[PVID_TERM_CHI_UF_Q31];
    sum[COLUMN_N + 4] = share[PVID_TERM_CHI_F_Q31];
    sum[COLUMN_N + 5] = share[PVID_TERM_UIU_Q31];
    sum[COLUMN_N + 6] = share[PVID_TERM_UI1_Q31] + share[PVID_TERM_CHI_U_Q31];
    sum[COLUMN_N + 7] = share[PVID_TERM_CHI_1_Q31];
    sum[COLUMN_Y] = share[PVID_TERM_Y_Q31];
    sum[COLUMN_A] = share[PVID_TERM_U_Q31];
    sum[COLUMN_B] = share[PVID_TERM_UT_Q31];
    sum[COLUMN_SPARE] = 0;
}

/* Work on a triangle by rows; rows beyond the first third have several parts. Sets row and part of stage `index`. */
typedef struct {
    size_t row;
    size_t part;
    size_t parts;
} row_part;

static row_part part_of_triangle(size_t functions, size_t parts, size_t index)
{
    const size_t whole = functions / 3u;
    row_part part = {index, 0, 1};
    if (index >= whole) {
        const size_t beyond = index - whole;
        part.row = whole + (beyond / parts);
        part.part = beyond % parts;
        part.parts = parts;
    }
    return part;
}

static size_t parts_of_triangle(size_t functions, size_t parts)
{
    const size_t whole = functions / 3u;
    return whole + (parts * (functions - whole));
}

/* Entries first..last-1 of a row of L with L L^T = R0, in place. Rows of L have a length below 1, therefore none
 * of their sums approaches PVID_WIDE unless R0 cannot be factored; then the row's diagonal shows it. */
static void factor_entries(pvid_weak_finish_q31 *self, size_t row, size_t first, size_t last)
{
    int32_t *l = &self->factor[row_start(row)];
    const int32_t *above = &self->factor[row_start(first)];
    for (size_t j = first; j < last; j++) {
        int64_t sum = (int64_t)l[j] * PVID_ONE_Q30;
        for (size_t i = 0; i < j; i++) {
            sum = pvid_clamp_q31(sum - pvid_product_q31(l[i], above[i]), PVID_WIDE);
        }
        l[j] = pvid_divide_q31(sum, self->inverse[j], PVID_ONE_Q30);
        above += j + 1u;
    }
}

/* The diagonal entry, kept inverted. Where R0 cannot be factored the window keeps the whitening of its design. */
static void factor_diagonal(pvid_weak_finish_q31 *self, size_t row)
{
    const int32_t *l = &self->factor[row_start(row)];
    int64_t pivot = (int64_t)l[row] * PVID_ONE_Q30;
    for (size_t j = 0; j < row; j++) {
        pivot = (pivot < 0) ? pivot : (pivot - pvid_square_q31(l[j]));
    }
    if (pvid_pivot_is_significant_q31(pivot, l[row])) {
        self->inverse[row] = pvid_reciprocal_of_q31(pvid_square_root_q31((uint64_t)pivot));
    } else {
        self->whitened = false;
    }
}

/* The first of two parts of a row ends where it has cost as much as the second will, with its root. */
static void factor_part(pvid_weak_finish_q31 *self, row_part part)
{
    if (!self->whitened) {
        return;
    }
    const size_t middle = part.row - (part.row / 4u);
    const bool completes = part.part + 1u == part.parts;
    factor_entries(self, part.row, (part.part == 0u) ? 0u : middle, completes ? part.row : middle);
    if (completes) {
        factor_diagonal(self, part.row);
    }
}

/* r L = e_row^T, from the last entry back: entries first..last-1 of r. */
static void invert_entries(pvid_weak_finish_q31 *self, size_t row, size_t first, size_t last)
{
    for (size_t step = 0; step < last - first; step++) {
        const size_t j = (last - 1u) - step;
        int64_t sum = (j == row) ? ((int64_t)PVID_ONE_Q30 << INVERSE_BITS) : 0;
        size_t at = row_start(j + 1u) + j;
        for (size_t k = j + 1u; k < row + 1u; k++) {
            sum -= (int64_t)self->inverted[k] * self->factor[at];
            at += k + 1u;
        }
        self->inverted[j] = pvid_divide_q31(sum, self->inverse[j], INVERSE_LIMIT);
    }
}

/* The row of L^-1 with the exponents of R0's rows, as a block of ROW_BITS. */
static void weigh_row(pvid_weak_finish_q31 *self, size_t row)
{
    int32_t largest = PVID_ZERO_EXPONENT_Q31;
    for (size_t j = 0; j < row + 1u; j++) {
        const int32_t length = pvid_length_q31(self->inverted[j]) - self->exponent[j];
        largest = (length > largest) ? length : largest;
    }
    self->inverted_exponent = (int16_t)(largest - ROW_BITS);
    for (size_t j = 0; j < row + 1u; j++) {
        const int32_t shift = self->inverted_exponent + self->exponent[j];
        self->inverted[j] = (int32_t)pvid_clamp_q31(pvid_scale_q31(self->inverted[j], shift), ROW_LIMIT);
    }
}

/* w^T G w for the first entries of a Gram table. */
static int64_t form_of(const PVID_TABLE int32_t *gram, const int32_t w[], size_t n)
{
    int64_t sum = 0;
    for (size_t a = 0; a < n; a++) {
        int32_t below = 0;
        for (size_t b = 0; b < a; b++) {
            below += w[b] * pvid_floor_shift_32_q31(gram[b], GRAM_DOWN);
        }
        const int32_t own = w[a] * pvid_floor_shift_32_q31(gram[a], GRAM_DOWN);
        sum += w[a] * ((2 * (int64_t)below) + own);
        gram += a + 1u;
    }
    return sum;
}

/* Adds a row of L^-1 to the trace of R0^-1 G: the noise of the whitened rows in the columns with the filters chi''
 * and chi, for unit variance in Y. */
static void trace_row(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design, size_t row, size_t which)
{
    const size_t table = GRAM_22 + which;
    const int64_t form = form_of(&design->gram[table * row_start(design->functions)], self->inverted, row + 1u);
    const int32_t table_bits = (int32_t)design->gram_bits[table] - (int32_t)GRAM_DOWN;
    const int32_t exponent = (2 * (self->inverted_exponent - INVERSE_BITS)) - table_bits + (self->gram_bits - 30);
    self->trace[which] = pvid_scaled_plus_q31(self->trace[which], pvid_scaled_of_q31(form, exponent));
}

/* Three parts: the row of the inverse without its costliest entries; these, and the first table; the other tables. */
static void trace_part(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design, row_part part)
{
    const bool whole = part.parts == 1u;
    if (!self->whitened) {
        return;
    }
    const size_t middle = part.row / 8u;
    if (part.part == 0u) {
        invert_entries(self, part.row, middle, part.row + 1u);
    }
    if (whole || (part.part == 1u)) {
        invert_entries(self, part.row, 0, middle);
        weigh_row(self, part.row);
        trace_row(self, design, part.row, 0);
    }
    if (whole || (part.part == 2u)) {
        trace_row(self, design, part.row, 1);
        trace_row(self, design, part.row, 2);
    }
}

/* x within COLUMN_LIMIT; sets `saturated` if it was beyond. */
static int32_t clamped(pvid_weak_finish_q31 *self, int64_t x)
{
    self->saturated = self->saturated || (x >= COLUMN_LIMIT) || (x <= -COLUMN_LIMIT);
    return (int32_t)pvid_clamp_q31(x, COLUMN_LIMIT);
}

/* A row of L^-1 times the columns, a part of them at a time. */
static void whiten_part(pvid_weak_finish_q31 *self, row_part part, int32_t sums[][PVID_WEAK_TERMS_Q31])
{
    const size_t row = part.row;
    const size_t columns = PVID_WEAK_COLUMNS_Q31 / part.parts;
    const size_t first = part.part * columns;
    const int32_t *l = &self->factor[row_start(row)];
    const int32_t shift = self->exponent[row] - ((self->gram_bits - 30) / 2);
    int32_t *x = sums[row];
    for (size_t i = first; i < first + columns; i++) {
        if (!self->whitened) {
            x[i] = clamped(self, x[i]);
            continue;
        }
        int64_t sum = (int64_t)clamped(self, pvid_scale_q31(x[i], shift)) * PVID_ONE_Q30;
        for (size_t j = 0; j < row; j++) {
            sum -= pvid_product_q31(l[j], sums[j][i]);
        }
        x[i] = clamped(self, pvid_divide_q31(sum, self->inverse[row], COLUMN_LIMIT));
    }
}

/* A column over the functions and its length; its reciprocal is stored in self->length. 0 for a zero column: no
 * drive, nothing to remove. */
static void find_length(pvid_weak_finish_q31 *self, size_t functions, size_t column,
                        int32_t sums[][PVID_WEAK_TERMS_Q31])
{
    int64_t wide[PVID_MAX_FUNCTIONS] = {0};
    uint64_t square = 0;
    for (size_t k = 0; k < functions; k++) {
        wide[k] = sums[k][column];
    }
    (void)pvid_to_block_q31((uint32_t)functions, wide, DIRECTION_BITS, self->direction);
    for (size_t k = 0; k < functions; k++) {
        square += (uint64_t)pvid_square_q31(self->direction[k]);
    }
    const pvid_reciprocal_q31 none = {0, 0};
    self->length = (square > 0u) ? pvid_reciprocal_of_q31(pvid_square_root_q31(square)) : none;
}

/* The direction: length 1 or 0. */
static void find_direction(pvid_weak_finish_q31 *self, size_t functions)
{
    for (size_t k = 0; k < functions; k++) {
        const int64_t product = (int64_t)self->direction[k] * self->length.m;
        const int64_t share = pvid_round_shift_q31(product, 31u - self->length.k);
        self->direction[k] = (int32_t)pvid_clamp_q31(share, PVID_ONE_Q30);
    }
}

static void find_components(pvid_weak_finish_q31 *self, size_t first, size_t last, int32_t sums[][PVID_WEAK_TERMS_Q31])
{
    if (first == 0u) {
        memset(self->along, 0, sizeof self->along);
    }
    for (size_t k = first; k < last; k++) {
        for (size_t i = 0; i < PVID_WEAK_COLUMNS_Q31; i++) {
            self->along[i] += pvid_product_q31(self->direction[k], sums[k][i]);
        }
    }
}

static void remove_components(pvid_weak_finish_q31 *self, size_t first, size_t last,
                              int32_t sums[][PVID_WEAK_TERMS_Q31])
{
    for (size_t i = 0; i < PVID_WEAK_COLUMNS_Q31; i++) {
        const int64_t along = pvid_round_shift_q31(self->along[i], 30);
        for (size_t k = first; k < last; k++) {
            sums[k][i] = clamped(self, sums[k][i] - pvid_round_shift_q31(self->direction[k] * along, 30));
        }
    }
}

/* Residuals of a window's rows, a few functions at a time; the largest value for a row that does not fit. For the
 * gate only. */
static void add_residuals(pvid_weak_finish_q31 *self, const pvid_estimator_q31 *estimator, size_t first, size_t last,
                          int32_t sums[][PVID_WEAK_TERMS_Q31])
{
    const pvid_block whole = {0, estimator->model->n_theta, 0}; /* rows of one kind */
    if (first == 0u) {
        self->rss = 0;
    }
    for (size_t k = first; k < last; k++) {
        int64_t e;
        (void)pvid_estimator_innovation_q31(estimator, &whole, &sums[k][COLUMN_N], sums[k][COLUMN_Y], &e);
        const int64_t within = pvid_clamp_q31(e, COLUMN_LIMIT);
        self->rss = pvid_clamp_q31(self->rss + (within * within), PVID_WIDE);
    }
}

/* Residual variance of the window over its expectation. */
static pvid_scaled_q31 variance_ratio_of(const pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design)
{
    const pvid_scaled_q31 freedom = pvid_scaled_of_q31((int64_t)design->functions - 2, 0);
    return pvid_scaled_over_q31(pvid_scaled_of_q31(self->rss, 0), pvid_scaled_times_q31(freedom, self->expected));
}

/* Returns whether the gate accepts the window. Saturated rows pass; the estimator rejects them. */
static bool passes(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design)
{
    return (self->gate.limit.m == 0) || self->saturated ||
           pvid_gate_passes_q31(&self->gate, variance_ratio_of(self, design));
}

/* Before the rows: sets the noise of the entries of N, in their formats; the last known one if the window keeps
 * the whitening of its design. */
static void set_noise(const pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design,
                      pvid_estimator_q31 *estimator)
{
    if (!self->whitened) {
        return;
    }
    const uint8_t *noisy = estimator->model->noisy;
    for (size_t i = 0; i < PVID_NOISE_TRACES_Q31; i++) {
        const size_t first = noisy[i / 2u];
        const size_t second = noisy[(i + 1u) / 2u];
        /* n_bits - y_bits of both, and half of the mixed one: its table holds G20 + G02 */
        const int32_t bits = (estimator->align[first] - estimator->theta_bits[first]) +
                             (estimator->align[second] - estimator->theta_bits[second]) - ((i == 1u) ? 1 : 0);
        const pvid_scaled_q31 mean = pvid_scaled_over_q31(self->trace[i], pvid_scaled_of_q31(design->functions, 0));
        estimator->noise[i] = pvid_scaled_shifted_q31(mean, bits);
    }
}

/* Adds a row to the estimator; sets *reason if the estimator rejects it. */
static void add_row(const pvid_weak_finish_q31 *self, const int32_t column[PVID_WEAK_TERMS_Q31],
                    pvid_estimator_q31 *estimator, pvid_reason *reason)
{
    const int32_t y = self->saturated ? INT32_MAX : column[COLUMN_Y]; /* beyond the limit of a row */
    const pvid_reason added = pvid_estimator_add_q31(estimator, &column[COLUMN_N], y);
    if (added != PVID_ACCUMULATED) {
        *reason = added;
    }
}

static void begin_solves(pvid_weak_finish_q31 *self, pvid_estimator_q31 *estimator, const pvid_trust_q31 *trust)
{
    const int32_t *fallback = pvid_trust_fallback_q31(trust);
    pvid_estimator_set_expected_q31(estimator, self->expected);
    pvid_estimator_begin_q31(estimator, &self->solve, true);
    self->rss = self->solve.group_rss;
    if (fallback != NULL) {
        self->solve.has_fallback = true;
        memcpy(self->solve.fallback, fallback, sizeof self->solve.fallback);
    }
}

/* A stage of a solve. Returns true when the last solve of the window is complete. */
static bool advance_solve(pvid_weak_finish_q31 *self, uint8_t iterations, pvid_estimator_q31 *estimator)
{
    if (!pvid_estimator_advance_q31(estimator, &self->solve)) {
        return false;
    }
    self->iteration++;
    self->reason = self->solve.reason;
    self->size = self->solve.size;
    /* ACCUMULATED: the divider allows no solve after this window */
    if ((self->iteration >= iterations) || (self->reason == PVID_ACCUMULATED)) {
        return true;
    }
    pvid_estimator_begin_q31(estimator, &self->solve, false);
    return false;
}

static void judge(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design, pvid_estimator_q31 *estimator,
                  pvid_trust_q31 *trust)
{
    const int64_t variance_ratio = pvid_scaled_fixed_q31(variance_ratio_of(self, design), PVID_VARIANCE_RATIO_BITS);
    self->reason = pvid_trust_judge_q31(trust, estimator, self->reason, self->size, self->solve.above_noise,
                                        variance_ratio, &self->candidate);
}

static size_t at_most(size_t first, size_t few, size_t all)
{
    return ((all - first) > few) ? (first + few) : all;
}

/* The stages up to the rows: those that the window's sums go through. Returns the index after the stage, and writes
 * where the stage is over to *all. */
static size_t prepare(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design,
                      const pvid_estimator_q31 *estimator, int32_t sums[][PVID_WEAK_TERMS_Q31], size_t *all)
{
    const size_t functions = design->functions;
    const size_t index = self->index;
    size_t next = index + 1u;
    *all = functions;
    switch (self->stage) {
    case STAGE_COMBINE:
        combine_row(self, design, index);
        break;
    case STAGE_ASSEMBLE:
        next = at_most(index, ASSEMBLED_PER_STAGE, functions);
        for (size_t k = index; k < next; k++) {
            assemble(design, sums[k]);
        }
        break;
    case STAGE_FACTOR:
        factor_part(self, part_of_triangle(functions, FACTOR_PARTS, index));
        *all = parts_of_triangle(functions, FACTOR_PARTS);
        break;
    case STAGE_TRACE:
        trace_part(self, design, part_of_triangle(functions, TRACE_PARTS, index));
        *all = parts_of_triangle(functions, TRACE_PARTS);
        break;
    case STAGE_WHITEN:
        whiten_part(self, part_of_triangle(functions, WHITEN_PARTS, index), sums);
        *all = parts_of_triangle(functions, WHITEN_PARTS);
        break;
    case STAGE_SQUARE_A:
    case STAGE_SQUARE_B:
        find_length(self, functions, (self->stage == STAGE_SQUARE_A) ? COLUMN_A : COLUMN_B, sums);
        next = functions;
        break;
    case STAGE_DIRECTION_A:
    case STAGE_DIRECTION_B:
        find_direction(self, functions);
        next = functions;
        break;
    case STAGE_ALONG_A:
    case STAGE_ALONG_B:
        next = at_most(index, ALONG_PER_STAGE, functions);
        find_components(self, index, next, sums);
        break;
    case STAGE_REMOVE_A:
    case STAGE_REMOVE_B:
        next = at_most(index, REMOVED_PER_STAGE, functions);
        remove_components(self, index, next, sums);
        break;
    default: /* STAGE_FIT */
        next = at_most(index, FITTED_PER_STAGE, functions);
        if (self->gate.limit.m > 0) {
            add_residuals(self, estimator, index, next, sums);
        }
        break;
    }
    return next;
}

/* Prepares the next stage. */
static void begin_stage(pvid_weak_finish_q31 *self, pvid_estimator_q31 *estimator, const pvid_trust_q31 *trust)
{
    if (self->stage == STAGE_SOLVE) {
        begin_solves(self, estimator, trust);
    } else if (self->stage == STAGE_ASSESS) {
        pvid_estimator_begin_assessment_q31(estimator, &self->solve, &self->candidate);
    }
}

void pvid_weak_finish_step_q31(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design, uint8_t iterations,
                               int32_t sums[][PVID_WEAK_TERMS_Q31], pvid_estimator_q31 *estimator,
                               pvid_trust_q31 *trust, pvid_reason *reason)
{
    size_t next = (size_t)self->index + 1u;
    size_t all = 1;
    switch (self->stage) {
    case STAGE_NOISE:
        if (!passes(self, design)) {
            pvid_count_up(&estimator->counters.rejected_outlier);
            *reason = PVID_REJECTED_OUTLIER;
            self->stage = STAGE_IDLE;
            return;
        }
        set_noise(self, design, estimator);
        break;
    case STAGE_FADE:
        if (self->index == 0u) {
            self->fade_factor = pvid_trust_fade_factor_q31(trust);
        }
        if (self->fade_factor > 0) {
            pvid_information_fade_q31(&estimator->information, self->index, self->fade_factor);
        }
        all = PVID_INFORMATION_END_PARTS;
        break;
    case STAGE_ADD:
        add_row(self, sums[self->index], estimator, reason);
        all = design->functions;
        break;
    case STAGE_SOLVE:
        if (!advance_solve(self, iterations, estimator)) {
            return;
        }
        break;
    case STAGE_ASSESS:
        if (!pvid_estimator_assess_advance_q31(estimator, &self->solve, &self->candidate)) {
            return;
        }
        break;
    case STAGE_JUDGE:
        judge(self, design, estimator, trust);
        *reason = self->reason;
        break;
    case STAGE_IDLE:
        return;
    default:
        next = prepare(self, design, estimator, sums, &all);
        break;
    }
    self->index = (uint8_t)next;
    if (next >= all) {
        self->index = 0;
        self->stage++;
        begin_stage(self, estimator, trust);
    }
}

uint32_t pvid_weak_finish_stages_q31(uint8_t functions, uint8_t iterations, const pvid_estimator_q31 *estimator)
{
    const size_t triangles = parts_of_triangle(functions, FACTOR_PARTS) + parts_of_triangle(functions, TRACE_PARTS) +
                             parts_of_triangle(functions, WHITEN_PARTS);
    const uint32_t along = (functions + (ALONG_PER_STAGE - 1u)) / ALONG_PER_STAGE;
    const uint32_t removed = (functions + (REMOVED_PER_STAGE - 1u)) / REMOVED_PER_STAGE;
    const uint32_t assembled = (functions + (ASSEMBLED_PER_STAGE - 1u)) / ASSEMBLED_PER_STAGE;
    const uint32_t fitted = (functions + (FITTED_PER_STAGE - 1u)) / FITTED_PER_STAGE;
    const uint32_t once = (2u * (uint32_t)functions) + assembled + (uint32_t)triangles + fitted;
    const uint32_t rows = once + (2u * (2u + along + removed));
    const uint32_t first = pvid_estimator_stages_q31(estimator, true);
    const uint32_t more = pvid_estimator_stages_q31(estimator, false);
    return rows + first + ((iterations - 1u) * more) + pvid_estimator_assessment_stages_q31(estimator) +
           PVID_INFORMATION_END_PARTS + 2u;
}
