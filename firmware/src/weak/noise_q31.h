/* What the sensors' noise does to the rows of a kind at the present p: shares of their variance, information, bias.
 * Private to the core. */
#ifndef PVID_WEAK_NOISE_Q31_H
#define PVID_WEAK_NOISE_Q31_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/weak_q31.h"

/* Adds to leverage[K + n] the squares of the direction that the reflection `place` removes; u [K + n]: scratch. The
 * first call of a family begins it. */
void pvid_weak_noise_leverage_q31(const pvid_weak_white_q31 *white, const pvid_weak_design_q31 *design, size_t place,
                                  int32_t u[], int32_t leverage[]);

/* Adds harmonic h to the shares Q_j; the first one begins them. */
void pvid_weak_noise_share_q31(const pvid_weak_white_q31 *white, const pvid_weak_design_q31 *design,
                               const int32_t leverage[], size_t h, pvid_scaled_q31 share[]);

/* An entry of the design's noise table, whose kind has these theta [thetas], the first of them `first`: adds its bias
 * to `pull` [thetas] of the kind, in units of b, and its information to the estimator's table. work: with Q_j and C.
 * n_bits: of all theta. */
void pvid_weak_noise_take_q31(pvid_estimator_q31 *estimator, const pvid_weak_design_q31 *design,
                              const pvid_weak_noise_q31 *one, const pvid_weak_noise_work_q31 *work,
                              const pvid_scaled_q31 theta[], size_t first, const int8_t n_bits[], int32_t y_bits,
                              pvid_scaled_q31 pull[]);

/* The part of the rows' variance, 1, that is for each unit of the variance of the equation's own error. */
pvid_scaled_q31 pvid_weak_noise_error_share_q31(const pvid_weak_design_q31 *design, size_t kind,
                                                const pvid_scaled_q31 share[]);

/* The part that the sensors' noise explains. */
pvid_scaled_q31 pvid_weak_noise_sensors_q31(const pvid_weak_design_q31 *design, pvid_scaled_q31 error_variance,
                                            pvid_scaled_q31 error_share);

#endif
