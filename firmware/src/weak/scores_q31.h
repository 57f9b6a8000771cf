/* Standard errors from the scatter of the windows' scores, in integers. All zeros: no windows yet. Private to the core.
 */
#ifndef PVID_WEAK_SCORES_Q31_H
#define PVID_WEAK_SCORES_Q31_H

#include <stddef.h>

#include "pvid/weak_q31.h"

/* A window without a score: the next one has no neighbour. */
static inline void pvid_weak_scores_skip_q31(pvid_weak_scores_q31 *self)
{
    self->known = false;
}

/* Adds the score that a solve has left to the means. variance_ratio: residual variance of the window's rows before its
 * steps of p over its expectation, Q24, >= 0. */
void pvid_weak_scores_add_q31(pvid_weak_scores_q31 *self, const pvid_estimator_q31 *estimator,
                              const pvid_estimator_solve_q31 *solve, int64_t variance_ratio);

/* Widens the standard errors of p[first..last - 1] to those from the scatter, if these are larger, behind an assessment
 * whose matrix could be factored. rows: of a score. */
void pvid_weak_scores_widen_q31(const pvid_weak_scores_q31 *self, const pvid_estimator_q31 *estimator,
                                const pvid_estimator_solve_q31 *assessment, uint32_t rows, size_t first, size_t last,
                                pvid_estimate_q31 *estimate);

#endif
