/* Standard errors from the scatter of the windows' scores. Private to the core. */
#ifndef PVID_WEAK_SCORES_F32_H
#define PVID_WEAK_SCORES_F32_H

#include <stddef.h>

#include "pvid/weak.h"

/* forgetting: windows in the estimator's memory; 0: all. */
void pvid_weak_scores_init_f32(pvid_weak_scores_f32 *self, float forgetting);

/* A window without a score: the next one has no neighbour. */
void pvid_weak_scores_skip_f32(pvid_weak_scores_f32 *self);

/* The score of a window from sum N e + g of all theta, at the present p. */
void pvid_weak_scores_take_f32(pvid_weak_scores_f32 *self, const pvid_estimator_f32 *estimator, const float sum[]);

/* Adds it to the means. residual: mean square of the window's rows before its steps of p. */
void pvid_weak_scores_add_f32(pvid_weak_scores_f32 *self, size_t n_p, float residual);

/* Variance of p[a] from the scatter, given the covariance of an assessment, `wide` times the inverse of S, and the
 * number of windows in the sums. */
float pvid_weak_scores_variance_f32(const pvid_weak_scores_f32 *self, size_t n_p, size_t a,
                                    const float covariance[][PVID_MAX_P], float wide, float windows);

#endif
