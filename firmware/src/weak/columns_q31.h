/* White columns of a kind's rows from the sums of a window. Private to the core. */
#ifndef PVID_WEAK_COLUMNS_Q31_H
#define PVID_WEAK_COLUMNS_Q31_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/weak_q31.h"

/* Begins the columns of a kind: all entries 0. */
void pvid_weak_columns_begin_q31(pvid_weak_columns_q31 *self, const pvid_weak_design_q31 *design, size_t kind);

/* The unit of each column: all harmonics, each in turn; length[channels] of the window's sums there. */
void pvid_weak_columns_scan_q31(pvid_weak_columns_q31 *self, const pvid_weak_design_q31 *design, size_t kind,
                                const pvid_weak_white_q31 *white, const uint8_t length[], size_t h);

/* Adds harmonic h of the window's sums [channels], over its standard deviation, to the K + n parts of all columns. */
void pvid_weak_columns_take_q31(pvid_weak_columns_q31 *self, const pvid_weak_design_q31 *design, size_t kind,
                                const pvid_weak_white_q31 *white, const uint8_t length[], const int32_t sums[][2],
                                size_t h);

/* Behind all harmonics: the K white rows of a column. */
void pvid_weak_columns_end_q31(pvid_weak_columns_q31 *self, const pvid_weak_design_q31 *design,
                               const pvid_weak_white_q31 *white, size_t place);

/* sum x^2 2^-16, in the column's own unit, |x| < 2^31. */
uint64_t pvid_weak_columns_square_q31(size_t n, const int32_t x[]);

/* A nuisance [n] without those before it becomes a reflection that leaves of it its first entry alone; 0, no
 * reflection, if less than 2^-20 of `whole`, its square before that, remains. Returns whether it is kept. */
bool pvid_weak_columns_keep_q31(uint64_t whole, size_t n, int32_t x[]);

/* The first n entries of a column in a format of the rows, saturated. */
void pvid_weak_columns_format_q31(pvid_weak_columns_q31 *self, size_t place, size_t first, size_t last, int32_t bits);

#endif
