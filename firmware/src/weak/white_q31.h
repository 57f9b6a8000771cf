/* Noise of a kind's rows: its spectrum, and the directions that the test functions leave out. Private to the core. */
#ifndef PVID_WEAK_WHITE_Q31_H
#define PVID_WEAK_WHITE_Q31_H

#include <stddef.h>

#include "number/integer_q31.h"
#include "pvid/weak_q31.h"

/* Parts of the sums of a window, K + n: real parts of the harmonics 0.., then imaginary parts of the harmonics 1.. */
static inline size_t pvid_weak_sums_rows_q31(const pvid_weak_design_q31 *design)
{
    return (size_t)design->functions + design->power;
}

/* Requires a valid design. */
void pvid_weak_white_init_q31(pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design);

/* Adds entries first..last-1 of the noise table to the weights c_j, those of this kind, at its theta. */
void pvid_weak_white_weigh_q31(const pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design, uint8_t kind,
                               const pvid_scaled_q31 theta[], size_t first, size_t last, pvid_scaled_q31 weight[]);

/* D_h of harmonics first..last-1 from the weights and the variance of the equation's own error. */
void pvid_weak_white_spectrum_q31(pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design, uint8_t kind,
                                  pvid_scaled_q31 error_variance, const pvid_scaled_q31 weight[], size_t first,
                                  size_t last);

/* The least D_h: 2^-33 of the mean of all. */
pvid_scaled_q31 pvid_weak_white_floor_q31(const pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design);

/* 1 / sqrt(D_h) in place of D_h, of harmonics first..last-1. */
void pvid_weak_white_invert_q31(pvid_weak_white_q31 *self, pvid_scaled_q31 least, size_t first, size_t last);

/* weight h 2^-(bits of h), which loses one bit at most. */
static inline int32_t pvid_weak_white_times_q31(int32_t weight, size_t h)
{
    const uint32_t up = 30u - pvid_byte_length_q31(h);
    return (int32_t)pvid_floor_shift_q31(pvid_short_product_q31(weight, (int32_t)((uint32_t)h << up)), 30);
}

/* The exponent of 1 / sqrt(D_h) behind `order` of them. */
static inline int32_t pvid_weak_white_exponent_q31(const pvid_weak_white_q31 *self, size_t h, size_t order)
{
    return self->scale[h].e + (int32_t)(order * pvid_byte_length_q31(h));
}

/* Reflections of a kind: n. */
static inline size_t pvid_weak_reflectors_q31(const pvid_weak_design_q31 *design)
{
    return design->power;
}

/* Makes the reflection `place`, counted from 0: those of the real parts, then those of the imaginary parts. */
void pvid_weak_white_reflector_q31(pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design, size_t place);

/* A block [K + n] to its K white rows. */
void pvid_weak_white_remove_q31(const pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design, int32_t column[]);

#endif
