/* Noise of a kind's rows: spectrum, covariance, its Cholesky factors, and what follows from its inverse. Private to the
 * core. */
#ifndef PVID_FOURIER_WHITE_F32_H
#define PVID_FOURIER_WHITE_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/fourier.h"

/* Requires a valid design. dt: between steps [s]. */
void pvid_fourier_white_init_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, float dt);

/* Adds entries first..last-1 of the noise table to the weights c_j, those of this kind, at its theta. */
void pvid_fourier_white_weigh_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, uint8_t kind,
                                  const float theta[], size_t first, size_t last);

/* D_h from the weights and the equation's own error. */
void pvid_fourier_white_spectrum_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, uint8_t kind,
                                     uint8_t harmonics);

/* A row of R; then the same row of its factor. */
void pvid_fourier_white_gram_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, size_t row);
void pvid_fourier_white_factor_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, size_t row);

/* x <- L^-1 x for the rows of the cosines (sines: false) or of the sines, from row `first` of the family; x[0] is the
 * family's first row. */
void pvid_fourier_white_forward_f32(const pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design,
                                    bool sines, size_t first, float x[]);

/* Adds the share of a harmonic of a family to Q_j; the cosines' harmonic 0 comes first. */
void pvid_fourier_white_share_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, bool sines,
                                  size_t harmonic);

/* g += 1/2 sum_j dc_j/dtheta Q_j by entries first..last-1 of the noise table. */
void pvid_fourier_white_pull_f32(const pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, uint8_t kind,
                                 const float theta[], size_t first, size_t last, float g[]);

/* Mean variance of the white rows by the sensors alone. */
float pvid_fourier_white_sensors_f32(const pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design);

#endif
