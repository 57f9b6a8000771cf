/* Products with C and M: C is given by its non-zeros (model.h), M as the packed upper triangles of its blocks by rows,
 * a block for each kind of rows (kinds.h). Private to the core; every function is a few loops of fixed length. */
#ifndef PVID_PATTERN_F32_H
#define PVID_PATTERN_F32_H

#include <stddef.h>

#include "pvid/model.h"
#include "solve/kinds.h"

/* out[n_p] = C^T x for the non-zeros c of C and a vector that is x[block->n] in this block and 0 outside. */
void pvid_pattern_transpose_times_f32(const pvid_model_f32 *model, const float c[], const pvid_block *block,
                                      const float x[], float out[]);

/* One past the last non-zero of the column that starts at `start`. */
size_t pvid_pattern_end_f32(const pvid_model_f32 *model, size_t start);

/* t[n_theta] += a times column j of M. */
void pvid_pattern_add_column_f32(const pvid_model_f32 *model, size_t j, float a, const float m[], float t[]);

/* Row a of S = C^T M C from the diagonal on, s[b] = c_b^T t for a <= b < n_p, given t = M c_a. */
void pvid_pattern_project_row_f32(const pvid_model_f32 *model, const float c[], size_t start, const float t[],
                                  float s[]);

/* Place of M_ii in a packed block of order n. */
static inline size_t pvid_pattern_diagonal_f32(size_t n, size_t i)
{
    return (i * ((2u * n) + 1u - i)) / 2u;
}

#endif
