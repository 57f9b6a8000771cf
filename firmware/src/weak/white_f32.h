/* Noise of a kind's rows: its spectrum, the directions that the test functions leave out, and what follows from its
 * inverse. Private to the core.
 *
 * The rows are made of parts of a window's sums: real parts of the harmonics 0..H, the family 0, and imaginary parts of
 * 1..H or 1..H - 1, the family 1; both are arrays over all harmonics, with zeros where there is no part. */
#ifndef PVID_WEAK_WHITE_F32_H
#define PVID_WEAK_WHITE_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "number/exact.h"
#include "pvid/weak.h"

/* H + 1. */
static inline size_t pvid_weak_harmonics(const pvid_weak_design_f32 *design)
{
    return PVID_COUNT(PVID_MAX_HARMONICS, ((size_t)design->functions / 2u) + ((size_t)design->power / 2u) + 1u);
}

/* The last harmonic with an imaginary part. */
static inline size_t pvid_weak_sines(const pvid_weak_design_f32 *design)
{
    return PVID_COUNT(((PVID_MAX_FUNCTIONS - 1) / 2) + (PVID_MAX_POWER / 2),
                      (((size_t)design->functions - 1u) / 2u) + ((size_t)design->power / 2u));
}

/* n/2: directions of each family. */
static inline size_t pvid_weak_vectors(const pvid_weak_design_f32 *design)
{
    return PVID_COUNT(PVID_MAX_POWER / 2, (size_t)design->power / 2u);
}

/* Stages of the basis: each direction takes four. */
static inline size_t pvid_weak_basis_stages(const pvid_weak_design_f32 *design)
{
    return 4u * pvid_weak_vectors(design);
}

/* Requires a valid design; `self` is all zeros. dt: between steps [s]. */
void pvid_weak_white_init_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, float dt);

/* Adds entries first..last-1 of the noise table to the weights c_j, those of this kind; theta: of its columns, -1 of Y.
 */
void pvid_weak_white_weigh_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                               const float theta[], size_t first, size_t last);

/* D_h from the weights and the variance of the equation's own error; then 1 / sqrt(D_h) in its place. */
void pvid_weak_white_spectrum_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                                  float error_variance);
void pvid_weak_white_scale_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design);

/* The next of the basis' stages, counted from 0. */
void pvid_weak_white_basis_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, size_t stage,
                               pvid_weak_basis_f32 *basis);

/* The first `count` reflections of a family, of its parts x[H + 1]; behind all of them its rows follow the first n/2
 * parts. */
void pvid_weak_white_reflect_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, size_t family,
                                 size_t count, float x[]);

/* The share of the harmonics first..last-1 in Q_j. */
void pvid_weak_white_share_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design,
                               const pvid_weak_basis_f32 *basis, size_t first, size_t last);

/* out[thetas + 1] += V x by entries first..last-1 of the noise table, V the covariance that the sensors' noise has in
 * the columns of the kind, sum factor Q_j; x and out: of theta's columns, then of Y. */
void pvid_weak_white_pull_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                              const float x[], size_t first, size_t last, float out[]);

/* Mean variance of the white rows: by the sensors alone; for each unit of the variance of the own error. */
float pvid_weak_white_sensors_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design);
float pvid_weak_white_error_share_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design,
                                      uint8_t kind);

#endif
