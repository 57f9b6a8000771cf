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

/* Adds a score, as a solve leaves it, to the means. residual: mean square of the window's rows before its steps of p,
 * > 0. */
void pvid_weak_scores_add_q31(pvid_weak_scores_q31 *self, const pvid_estimator_q31 *estimator,
                              const int32_t score[PVID_MAX_P], pvid_scaled_q31 residual);

/* Standard error of p[a] from the scatter, behind an assessment whose matrix was factored. correlation: row a of its
 * own; windows: scores in the sums. */
int32_t pvid_weak_scores_error_q31(const pvid_weak_scores_q31 *self, const pvid_estimator_q31 *estimator,
                                   const pvid_estimator_solve_q31 *solve, size_t a, const int32_t correlation[],
                                   pvid_scaled_q31 windows);

#endif
