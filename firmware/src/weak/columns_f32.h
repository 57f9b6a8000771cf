/* Columns of a kind's rows from the sums of a window. Private to the core. */
#ifndef PVID_WEAK_COLUMNS_F32_H
#define PVID_WEAK_COLUMNS_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/weak.h"

/* part += factor (-1)^order (i omega_h)^order S_h of a term over the standard deviation, real and imaginary parts. */
void pvid_weak_columns_add_f32(const pvid_weak_design_f32 *design, const pvid_weak_term_f32 *term,
                               const pvid_weak_white_f32 *white, const float window[][PVID_MAX_CHANNELS][2],
                               float part[2][PVID_MAX_HARMONICS]);

/* A nuisance after those before it have been taken off: keeps 1 / its square, or 0 if less than 1e-6 of `whole`, its
 * square before that, remains. Returns whether it is kept. */
bool pvid_weak_columns_keep_f32(size_t rows, const float nuisance[], float whole, float *inverse);

/* Takes a nuisance off a column. */
void pvid_weak_columns_project_f32(size_t rows, const float nuisance[], float inverse, float column[]);

#endif
