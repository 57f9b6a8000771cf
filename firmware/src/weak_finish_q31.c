#include "weak_finish_q31.h"

#include <stddef.h>
#include <string.h>

#include "cholesky_q31.h"
#include "integer_q31.h"
#include "weak_window_q31.h"

/* Columns of a row once it is assembled, in place of its terms. */
enum { COLUMN_N = 0, COLUMN_Y = 8, COLUMN_A = 9, COLUMN_B = 10, COLUMN_SPARE = 11 };

enum {
    STAGE_COMBINE, /* K times: a row of the Gram matrix at p, the columns of a function */
    STAGE_FACTOR,  /* K times: a row of its Cholesky factor */
    STAGE_WHITEN,  /* K times: a row of L^-1 (Y, N, a, b) */
    STAGE_DIRECTION_A,
    STAGE_ALONG_A,  /* a few functions at a time */
    STAGE_REMOVE_A, /* likewise */
    STAGE_DIRECTION_B,
    STAGE_ALONG_B,
    STAGE_REMOVE_B,
    STAGE_ADD,   /* K times: a row to the estimator */
    STAGE_SOLVE, /* `iterations` solves of several stages each */
    STAGE_IDLE
};

/* Functions whose columns one stage of the projection takes. */
#define FUNCTIONS_A_STAGE 6u

/* Largest entry of a column once it is whitened: that of a row. */
#define COLUMN_LIMIT PVID_ROW_LIMIT_Q31

#define COMBINATION_BITS 29 /* six of them times a Gram table of 30 bits fit an int64 */
#define DIRECTION_BITS 27   /* squares of 64 of them likewise */

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

/* The residual of p has the filter chi'''' + d1 w chi'' + d2 w^2 chi: what its noise covariance is made of, beside
 * G44. The factors get one format, that of the table which needs the most of it. */
void pvid_weak_finish_begin_q31(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design,
                                const pvid_estimator_q31 *estimator)
{
    const factor_of_table two = reduced(estimator->theta[1], estimator->theta_bits[1], 30);
    const factor_of_table zero = reduced(estimator->theta[4], estimator->theta_bits[4], 30);
    const factor_of_table table[PVID_WEAK_GRAMS] = {
        {1, 0},
        two,
        zero,
        {two.m * two.m, 2 * two.bits},
        {two.m * zero.m, two.bits + zero.bits},
        {zero.m * zero.m, 2 * zero.bits},
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
        self->combination[i] = (int32_t)pvid_scale_q31(part[i].m, part[i].bits - common);
    }
    self->gram_bits = (int16_t)common;
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
    for (size_t j = 0; j <= row; j++) {
        const int64_t sum = combined(self, &design->gram[start + j], size);
        const int32_t exponent = self->exponent[row] + self->exponent[j];
        self->factor[start + j] = (int32_t)pvid_clamp_q31(pvid_scale_q31(sum, exponent), PVID_ONE_Q30);
    }
}

/* (N1..N8, Y, a, b, 0) from the terms of a function, in their place. */
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

/* Row of L with L L^T = R0, in place. Where R0 cannot be factored the window keeps the whitening of its design. */
static void factor_row(pvid_weak_finish_q31 *self, size_t row)
{
    int32_t *l = &self->factor[row_start(row)];
    const int32_t *above = self->factor;
    const int32_t diagonal = l[row];
    int64_t pivot = (int64_t)diagonal * PVID_ONE_Q30;
    for (size_t j = 0; j < row; j++) {
        int64_t sum = (int64_t)l[j] * PVID_ONE_Q30;
        for (size_t i = 0; i < j; i++) {
            sum -= (int64_t)l[i] * above[i];
        }
        l[j] = pvid_divide_q31(sum, self->inverse[j], PVID_ONE_Q30);
        pivot -= (int64_t)l[j] * l[j];
        above += j + 1u;
    }
    self->whitened = self->whitened && pvid_pivot_is_data_q31(pivot, diagonal);
    const uint64_t square = self->whitened ? (uint64_t)pivot : (uint64_t)((int64_t)1 << 60);
    self->inverse[row] = pvid_reciprocal_of_q31(pvid_square_root_q31(square));
}

/* x held within COLUMN_LIMIT, and noted if it was not. */
static int32_t held(pvid_weak_finish_q31 *self, int64_t x)
{
    self->saturated = self->saturated || (x >= COLUMN_LIMIT) || (x <= -COLUMN_LIMIT);
    return (int32_t)pvid_clamp_q31(x, COLUMN_LIMIT);
}

static void whiten_row(pvid_weak_finish_q31 *self, size_t row, int32_t sums[][PVID_WEAK_TERMS_Q31])
{
    const int32_t *l = &self->factor[row_start(row)];
    const int32_t shift = self->exponent[row] - ((self->gram_bits - 30) / 2);
    int32_t *x = sums[row];
    for (size_t i = 0; i < PVID_WEAK_COLUMNS_Q31; i++) {
        if (!self->whitened) {
            x[i] = held(self, x[i]);
            continue;
        }
        int64_t sum = (int64_t)held(self, pvid_scale_q31(x[i], shift)) * PVID_ONE_Q30;
        for (size_t j = 0; j < row; j++) {
            sum -= (int64_t)l[j] * sums[j][i];
        }
        x[i] = held(self, pvid_divide_q31(sum, self->inverse[row], COLUMN_LIMIT));
    }
}

/* The direction of a column over the functions; none, that is zero, where the column is (no drive: then there is
 * nothing to remove either). */
static void find_direction(pvid_weak_finish_q31 *self, size_t functions, size_t column,
                           int32_t sums[][PVID_WEAK_TERMS_Q31])
{
    int64_t wide[PVID_MAX_FUNCTIONS] = {0};
    uint64_t square = 0;
    for (size_t k = 0; k < functions; k++) {
        wide[k] = sums[k][column];
    }
    (void)pvid_to_block_q31((uint32_t)functions, wide, DIRECTION_BITS, self->direction);
    for (size_t k = 0; k < functions; k++) {
        square += (uint64_t)((int64_t)self->direction[k] * self->direction[k]);
    }
    if (square == 0u) {
        return;
    }
    const pvid_reciprocal_q31 inverse = pvid_reciprocal_of_q31(pvid_square_root_q31(square));
    for (size_t k = 0; k < functions; k++) {
        const int64_t product = (int64_t)self->direction[k] * inverse.m;
        self->direction[k] = (int32_t)pvid_round_shift_q31(product, 31u - inverse.k);
    }
}

static void find_components(pvid_weak_finish_q31 *self, size_t first, size_t last, int32_t sums[][PVID_WEAK_TERMS_Q31])
{
    if (first == 0u) {
        memset(self->along, 0, sizeof self->along);
    }
    for (size_t k = first; k < last; k++) {
        for (size_t i = 0; i < PVID_WEAK_COLUMNS_Q31; i++) {
            self->along[i] += (int64_t)self->direction[k] * sums[k][i];
        }
    }
}

static void remove_components(pvid_weak_finish_q31 *self, size_t first, size_t last,
                              int32_t sums[][PVID_WEAK_TERMS_Q31])
{
    for (size_t i = 0; i < PVID_WEAK_COLUMNS_Q31; i++) {
        const int64_t along = pvid_round_shift_q31(self->along[i], 30);
        for (size_t k = first; k < last; k++) {
            sums[k][i] = held(self, sums[k][i] - pvid_round_shift_q31(self->direction[k] * along, 30));
        }
    }
}

/* A row to the estimator; its reason is told if it was refused. */
static void add_row(const pvid_weak_finish_q31 *self, const int32_t column[PVID_WEAK_TERMS_Q31],
                    pvid_estimator_q31 *estimator, pvid_reason *reason)
{
    const int32_t y = self->saturated ? INT32_MAX : column[COLUMN_Y]; /* beyond the limit of a row */
    const pvid_reason added = pvid_estimator_add_q31(estimator, &column[COLUMN_N], y);
    if (added != PVID_ACCUMULATED) {
        *reason = added;
    }
}

/* A stage of a solve; true once the last one of the window is complete. */
static bool solve_on(pvid_weak_finish_q31 *self, uint8_t iterations, pvid_estimator_q31 *estimator)
{
    if (!pvid_estimator_advance_q31(estimator, &self->solve)) {
        return false;
    }
    self->iteration++;
    /* not due: the divider says that this window only accumulates */
    if ((self->iteration >= iterations) || (self->solve.reason == PVID_ACCUMULATED)) {
        return true;
    }
    pvid_estimator_begin_q31(estimator, &self->solve, false);
    return false;
}

void pvid_weak_finish_step_q31(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design, uint8_t iterations,
                               int32_t sums[][PVID_WEAK_TERMS_Q31], pvid_estimator_q31 *estimator, pvid_reason *reason)
{
    const size_t functions = design->functions;
    const size_t row = self->index;
    const size_t few = ((functions - row) > FUNCTIONS_A_STAGE) ? (row + FUNCTIONS_A_STAGE) : functions;
    size_t done = row + 1u; /* functions, after this stage; all of them end it */
    switch (self->stage) {
    case STAGE_COMBINE:
        combine_row(self, design, row);
        assemble(design, sums[row]);
        break;
    case STAGE_FACTOR:
        factor_row(self, row);
        break;
    case STAGE_WHITEN:
        whiten_row(self, row, sums);
        break;
    case STAGE_DIRECTION_A:
        find_direction(self, functions, COLUMN_A, sums);
        done = functions;
        break;
    case STAGE_DIRECTION_B:
        find_direction(self, functions, COLUMN_B, sums);
        done = functions;
        break;
    case STAGE_ALONG_A:
    case STAGE_ALONG_B:
        find_components(self, row, few, sums);
        done = few;
        break;
    case STAGE_REMOVE_A:
    case STAGE_REMOVE_B:
        remove_components(self, row, few, sums);
        done = few;
        break;
    case STAGE_ADD:
        add_row(self, sums[row], estimator, reason);
        break;
    case STAGE_SOLVE:
        if (!solve_on(self, iterations, estimator)) {
            return;
        }
        *reason = self->solve.reason;
        done = functions;
        break;
    default:
        return;
    }
    self->index = (uint8_t)done;
    if (done == functions) {
        self->index = 0;
        self->stage++;
        if (self->stage == STAGE_SOLVE) {
            pvid_estimator_begin_q31(estimator, &self->solve, true);
        }
    }
}

uint32_t pvid_weak_finish_stages_q31(uint8_t functions, uint8_t iterations, const pvid_estimator_q31 *estimator)
{
    const uint32_t parts = (functions + (FUNCTIONS_A_STAGE - 1u)) / FUNCTIONS_A_STAGE;
    const uint32_t rows = (4u * (uint32_t)functions) + 2u + (4u * parts);
    const uint32_t first = pvid_estimator_stages_q31(estimator, true);
    const uint32_t more = pvid_estimator_stages_q31(estimator, false);
    return rows + first + ((iterations - 1u) * more);
}
