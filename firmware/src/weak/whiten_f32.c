#include "number/uncontracted.h"

#include "weak/whiten_f32.h"

#include <math.h>

#include "solve/cholesky_f32.h"
#include "number/finite_f32.h"
#include "number/unroll.h"

/* The first of the three Gram tables of chi'' and chi: G22, G20 + G02, G00. */
#define GRAM_22 3u

static size_t row_start(size_t row)
{
    return (row * (row + 1u)) / 2u;
}

void pvid_weak_whiten_begin_f32(pvid_weak_whiten_f32 *self, const float p[])
{
    /* factors of chi'' and of chi in the filter */
    const float factor2 = p[PVID_KAPITZA_D1] * p[PVID_KAPITZA_W];
    const float factor0 = (p[PVID_KAPITZA_D2] * p[PVID_KAPITZA_W]) * p[PVID_KAPITZA_W];
    self->combination[0] = factor2;
    self->combination[1] = factor0;
    self->combination[2] = factor2 * factor2;
    self->combination[3] = factor2 * factor0;
    self->combination[4] = factor0 * factor0;
    self->whitened = true;
}

void pvid_weak_whiten_combine_f32(pvid_weak_whiten_f32 *self, const pvid_weak_design_f32 *design, size_t row)
{
    const size_t size = row_start(design->functions);
    const float *c = self->combination;
    const size_t last = row_start(row + 1u);
    for (size_t i = row_start(row); i < last; i++) {
        const float *g = &design->gram[i];
        float sum = g[0];
        sum += c[0] * g[size];
        sum += c[1] * g[2u * size];
        sum += c[2] * g[3u * size];
        sum += c[3] * g[4u * size];
        sum += c[4] * g[5u * size];
        self->factor[i] = sum;
    }
}

/* In place; the diagonal of L is kept inverted. */
void pvid_weak_whiten_factor_f32(pvid_weak_whiten_f32 *self, size_t row)
{
    float *l = &self->factor[row_start(row)];
    const float *above = self->factor;
    const float diagonal = l[row];
    float pivot = diagonal;
    for (size_t j = 0; j < row; j++) {
        float sum = l[j];
        for (size_t i = 0; i < j; i++) {
            sum -= l[i] * above[i];
        }
        l[j] = sum * above[j];
        pivot -= l[j] * l[j];
        above += j + 1u;
    }
    self->whitened = self->whitened && (pivot > (PVID_PIVOT_MIN * diagonal)) && pvid_finite_f32(pivot);
    l[row] = 1.0f / sqrtf(self->whitened ? pivot : 1.0f);
}

/* x -= a y for the columns of two functions. */
static inline void subtract(float a, const float *restrict y, float *restrict x)
{
    PVID_UNROLL
    for (size_t i = 0; i < PVID_WEAK_COLUMNS; i++) {
        x[i] -= a * y[i];
    }
}

void pvid_weak_whiten_row_f32(const pvid_weak_whiten_f32 *self, size_t row, float x[][PVID_WEAK_TERMS])
{
    if (!self->whitened) {
        return;
    }
    const float *l = &self->factor[row_start(row)];
    float *own = x[row];
    for (size_t j = 0; j < row; j++) {
        subtract(l[j], x[j], own);
    }
    for (size_t i = 0; i < PVID_WEAK_COLUMNS; i++) {
        own[i] *= l[row];
    }
}

/* r L = e_row^T, from the last entry back. */
void pvid_weak_whiten_inverse_f32(const pvid_weak_whiten_f32 *self, size_t row, float inverse[])
{
    inverse[row] = self->factor[row_start(row) + row];
    for (size_t j = row; j-- > 0u;) {
        float sum = 0.0f;
        size_t at = row_start(j + 1u) + j;
        for (size_t k = j + 1u; k < row + 1u; k++) {
            sum += inverse[k] * self->factor[at];
            at += k + 1u;
        }
        inverse[j] = -(sum * self->factor[row_start(j) + j]);
    }
}

void pvid_weak_whiten_trace_f32(pvid_weak_whiten_f32 *self, const pvid_weak_design_f32 *design, size_t row,
                                const float inverse[], size_t which)
{
    const float *g = &design->gram[(GRAM_22 + which) * row_start(design->functions)];
    float trace = (row == 0u) ? 0.0f : self->trace[which];
    for (size_t a = 0; a < row + 1u; a++) {
        float below = 0.0f;
        for (size_t b = 0; b < a; b++) {
            below += inverse[b] * g[b];
        }
        trace += inverse[a] * ((2.0f * below) + (inverse[a] * g[a]));
        g += a + 1u;
    }
    if (row + 1u == design->functions) {
        const float a_row = 1.0f / (float)design->functions;
        trace *= (which == 1u) ? (0.5f * a_row) : a_row; /* the table holds G20 + G02 */
    }
    self->trace[which] = trace;
}
