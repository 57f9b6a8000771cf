/* Noise of a kind's rows: its spectrum, and the directions that the test functions leave out. Private to the core. */
#ifndef PVID_FOURIER_WHITE_Q31_H
#define PVID_FOURIER_WHITE_Q31_H

#include <stddef.h>

#include "pvid/fourier_q31.h"

/* Rows of a window, K + n: real parts of the harmonics 0.., then imaginary parts of the harmonics 1.. */
static inline size_t pvid_fourier_rows_q31(const pvid_fourier_design_q31 *design)
{
    return (size_t)design->functions + design->power;
}

/* Harmonic of a row. */
static inline size_t pvid_fourier_harmonic_q31(const pvid_fourier_white_q31 *self, size_t row)
{
    return (row < self->cosines) ? row : ((row + 1u) - self->cosines);
}

/* Stages of the basis. */
static inline size_t pvid_fourier_basis_stages_q31(const pvid_fourier_design_q31 *design)
{
    const size_t vectors = design->power / 2u;
    return vectors * vectors;
}

/* Requires a valid design. */
void pvid_fourier_white_init_q31(pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design);

/* Adds entries first..last-1 of the noise table to the weights c_j, those of this kind, at its theta. */
void pvid_fourier_white_weigh_q31(pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design, uint8_t kind,
                                  const pvid_scaled_q31 theta[], size_t first, size_t last);

/* D_h of harmonics first..last-1 from the weights and the equation's own error. */
void pvid_fourier_white_spectrum_q31(pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design, uint8_t kind,
                                     size_t first, size_t last);

/* The least D_h: 2^-20 of the mean of all. */
pvid_scaled_q31 pvid_fourier_white_floor_q31(const pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design);

/* 1 / sqrt(D_h) in place of D_h, of harmonics first..last-1. */
void pvid_fourier_white_invert_q31(pvid_fourier_white_q31 *self, pvid_scaled_q31 least, size_t first, size_t last);

/* The next of the basis' stages, counted from 0. */
void pvid_fourier_white_basis_q31(pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design, size_t stage);

/* Takes the vectors of this place in the basis, one of each family, off a column. */
void pvid_fourier_white_remove_q31(const pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design,
                                   size_t place, int32_t column[]);

#endif
