#include "number/uncontracted.h"

#include "solve/pattern_f32.h"

#include "solve/information_f32.h"

void pvid_pattern_transpose_times_f32(const pvid_model_f32 *model, const float c[], const pvid_block *block,
                                      const float x[], float out[])
{
    const uint8_t *c_row = model->c_row;
    const uint8_t *c_column = model->c_column;
    const size_t n_c = model->n_c;
    const size_t n_p = model->n_p;
    float sum[PVID_MAX_P] = {0.0f};
    for (size_t k = 0; k < n_c; k++) {
        const size_t i = (size_t)c_row[k] - block->first; /* beyond n also for a row before the block */
        if (i < block->n) {
            sum[c_column[k]] += c[k] * x[i];
        }
    }
    for (size_t a = 0; a < n_p; a++) {
        out[a] = sum[a];
    }
}

/* t[n] += M e_j a. Above the diagonal the entries of column j are n - 1, n - 2, .. apart; from the diagonal on
 * they are row j, consecutively. */
static inline void add_column(size_t n, const float *restrict m, size_t j, float a, float *restrict t)
{
    size_t at = j;
    for (size_t i = 0; i < j; i++) {
        t[i] += m[at] * a;
        at += (n - 1u) - i;
    }
    const float *restrict row = &m[at - j];
    for (size_t i = j; i < n; i++) {
        t[i] += row[i] * a;
    }
}

size_t pvid_pattern_start_f32(const pvid_model_f32 *model, size_t a)
{
    size_t k = 0;
    while ((k < model->n_c) && (model->c_column[k] < a)) {
        k++;
    }
    return k;
}

size_t pvid_pattern_end_f32(const pvid_model_f32 *model, size_t start)
{
    const uint8_t *c_column = model->c_column;
    const size_t n_c = model->n_c;
    size_t k = start;
    while ((k < n_c) && (c_column[k] == c_column[start])) {
        k++;
    }
    return k;
}

void pvid_pattern_add_columns_f32(const pvid_model_f32 *model, const float c[], size_t first, size_t last,
                                  const float m[], float t[])
{
    const uint8_t *c_row = model->c_row;
    pvid_block block = {0, 0, 0};
    for (size_t k = first; k < last; k++) {
        if (c_row[k] >= (block.first + block.n)) { /* they ascend */
            pvid_information_block_f32(model, c_row[k], &block);
        }
        add_column(block.n, &m[block.moment], c_row[k] - block.first, c[k], &t[block.first]);
    }
}

void pvid_pattern_project_row_f32(const pvid_model_f32 *model, const float c[], size_t start, const float t[],
                                  float s[])
{
    const uint8_t *c_row = model->c_row;
    const uint8_t *c_column = model->c_column;
    const size_t n_c = model->n_c;
    const size_t n_p = model->n_p;
    size_t k = start;
    for (size_t b = c_column[start]; b < n_p; b++) {
        float sum = 0.0f;
        while ((k < n_c) && (c_column[k] == b)) {
            sum += c[k] * t[c_row[k]];
            k++;
        }
        s[b] = sum;
    }
}

float pvid_pattern_times_f32(size_t n, const float m[], size_t i, const float x[])
{
    size_t at = i;
    float sum = 0.0f;
    for (size_t j = 0; j < i; j++) {
        sum += m[at] * x[j];
        at += (n - 1u) - j;
    }
    for (size_t j = i; j < n; j++) {
        sum += m[at] * x[j];
        at++;
    }
    return sum;
}
