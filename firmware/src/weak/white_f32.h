/* Noise of a kind's rows: its spectrum, the directions that the test functions leave out, and what follows from its
 * inverse. Private to the core. */
#ifndef PVID_WEAK_WHITE_F32_H
#define PVID_WEAK_WHITE_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/weak.h"

/* Parts of the sums of a window that its rows are made of, K + n: real parts of the harmonics 0.., then imaginary parts
 * of the harmonics 1... */
static inline size_t pvid_weak_parts(const pvid_weak_design_f32 *design)
{
    return (size_t)design->functions + design->power;
}

/* Stages of the basis. */
static inline size_t pvid_weak_basis_stages(const pvid_weak_design_f32 *design)
{
    return 2u * (size_t)design->power;
}

/* Requires a valid design. dt: between steps [s]. */
void pvid_weak_white_init_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, float dt);

/* Adds entries first..last-1 of the noise table to the weights c_j, those of this kind, at its theta. */
void pvid_weak_white_weigh_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                               const float theta[], size_t first, size_t last);

/* D_h from the weights and the equation's own error; then 1 / sqrt(D_h) in its place. */
void pvid_weak_white_spectrum_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                                  uint8_t harmonics);
void pvid_weak_white_scale_f32(pvid_weak_white_f32 *self, uint8_t harmonics);

/* The next of the basis' stages, counted from 0. */
void pvid_weak_white_basis_f32(pvid_weak_white_f32 *self, size_t stage, pvid_weak_basis_f32 *basis);

/* Reflects the parts of a family, 0: real, 1: imaginary; its rows are behind the first n/2. */
void pvid_weak_white_reflect_f32(const pvid_weak_white_f32 *self, size_t family, float x[]);

/* The share of parts first..last-1 in Q_j. */
void pvid_weak_white_share_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, const float leverage[],
                               size_t first, size_t last);

/* g += 1/2 sum_j dc_j/dtheta Q_j by entries first..last-1 of the noise table. */
void pvid_weak_white_pull_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                              const float theta[], size_t first, size_t last, float g[]);

/* Mean variance of the white rows by the sensors alone. */
float pvid_weak_white_sensors_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design);

#endif
