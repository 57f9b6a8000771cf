/* White columns of a kind's rows from the sums of a window. Private to the core. */
#ifndef PVID_FOURIER_COLUMNS_Q31_H
#define PVID_FOURIER_COLUMNS_Q31_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/fourier_q31.h"

/* Column `place` of a kind in standard deviations, from its terms first..end-1 and the sums of the window: K + n parts
 * that the reflections of white_q31.h make K rows of. */
void pvid_fourier_columns_make_q31(pvid_fourier_columns_q31 *self, const pvid_fourier_design_q31 *design,
                                   const pvid_fourier_white_q31 *white, const pvid_fourier_window_q31 *window,
                                   size_t place, size_t first, size_t end);

/* sum x^2 2^-16, in the column's own unit, |x| < 2^31. */
uint64_t pvid_fourier_columns_square_q31(size_t n, const int32_t x[]);

/* A nuisance [n] without those before it becomes a reflection that leaves of it its first entry alone; 0, no
 * reflection, if less than 2^-20 of `whole`, its square before that, remains. Returns whether it is kept. */
bool pvid_fourier_columns_keep_q31(uint64_t whole, size_t n, int32_t x[]);

/* The first n entries of a column in a format of the rows, saturated. */
void pvid_fourier_columns_format_q31(pvid_fourier_columns_q31 *self, size_t place, size_t first, size_t last,
                                     int32_t bits);

#endif
