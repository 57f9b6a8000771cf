/* White columns of a kind's rows from the sums of a window. Private to the core. */
#ifndef PVID_FOURIER_COLUMNS_Q31_H
#define PVID_FOURIER_COLUMNS_Q31_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/fourier_q31.h"

/* Parts of making a column. */
static inline size_t pvid_fourier_column_parts_q31(const pvid_fourier_white_q31 *white)
{
    return (size_t)white->cosines + 2u;
}

/* The next part of making column `place` of a kind in standard deviations, from its terms first..end-1 and the sums of
 * the window; parts count from 0. */
void pvid_fourier_columns_make_q31(pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design,
                                   const pvid_fourier_white_q31 *white, const pvid_fourier_window_q31 *window,
                                   size_t place, size_t first, size_t end, size_t part);

/* sum x^2 2^-16, in the column's own unit. */
uint64_t pvid_fourier_columns_square_q31(const pvid_fourier_design_q31 *design, const int32_t x[]);

/* A nuisance after those before it have been taken off becomes a unit vector; 0 if less than 2^-20 of `whole`, its
 * square before that, remains. Returns whether it is kept. */
bool pvid_fourier_columns_keep_q31(const pvid_fourier_design_q31 *design, uint64_t whole, int32_t x[]);

#endif
