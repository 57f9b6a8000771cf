/* The estimator of the strong form: estimator.h for rows of theory.md 2 and three parameters. Private to the core. */
#ifndef PVID_KAPITZA_ESTIMATOR_F32_H
#define PVID_KAPITZA_ESTIMATOR_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/strong.h"

/* Initialises `self`, which is all zeros, for rows at rate_hz. Fails as pvid_strong_init_f32. */
pvid_status pvid_kapitza_estimator_init_f32(pvid_strong_estimator_f32 *self, const pvid_strong_config_f32 *config,
                                            float rate_hz);

/* Residuals at p. */
typedef struct {
    float rss;    /* residual sum of squares [units of Y^2] */
    float floor;  /* its rounding [units of Y^2] */
    float weight; /* rows */
} pvid_kapitza_residual_f32;

/* S and F at p of the rows in the sums and of the first `rows` in `block`. */
void pvid_kapitza_gather_f32(const pvid_strong_estimator_f32 *self, size_t rows, float s[6], float force[3]);

/* S, F and the residuals of all rows. */
void pvid_kapitza_gather_residuals_f32(const pvid_strong_estimator_f32 *self, float s[6], float force[3],
                                       pvid_kapitza_residual_f32 *residual);

/* pvid_strong_assess_f32. */
void pvid_kapitza_assess_f32(const pvid_strong_estimator_f32 *self, pvid_estimate_f32 *estimate);

/* Whether p is within the dead zone (estimator.h), given force^T (S + H0)^-1 force. */
bool pvid_kapitza_is_at_rest_f32(const pvid_strong_estimator_f32 *self, float square,
                                 const pvid_kapitza_residual_f32 *residual);

#endif
