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

/* Above the diagonal the entries of a column are n - 1, n - 2, .. apart; from the diagonal on they are a row,
 * consecutively. */
void pvid_pattern_add_column_f32(const pvid_model_f32 *model, size_t j, float a, const float m[], float t[])
{
    pvid_block block;
    pvid_information_block_f32(model, j, &block);
    const size_t column = j - block.first;
    const float *restrict entry = &m[block.moment + column];
    float *restrict to = &t[block.first];
    const float *diagonal = &to[column];
    const float *end = &to[block.n];
    size_t apart = block.n - 1u;
    while (to != diagonal) {
        *to += *entry * a;
        to++;
        entry = &entry[apart];
        apart--;
    }
    while (to != end) {
        *to += *entry * a;
        to++;
        entry++;
    }
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

void pvid_pattern_project_row_f32(const pvid_model_f32 *model, const float c[], size_t start, const float t[],
                                  float s[])
{
    const size_t n_c = model->n_c;
    size_t column = model->c_column[start];
    float sum = 0.0f;
    for (size_t k = start; k < n_c; k++) {
        if (model->c_column[k] != column) {
            s[column] = sum;
            column = model->c_column[k];
            sum = 0.0f;
        }
        sum += c[k] * t[model->c_row[k]];
    }
    s[column] = sum;
}
