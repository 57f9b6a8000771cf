/* Constraints between rates of parameters, A(p) p' = 0, that need not be integrable: parameters drift along few
 * directions D alone, as R and k do with the heat of a winding. Then only what the rows contain along D grows old: with
 * E = C D, for each direction and each kind of rows, whose block of M is M,
 *
 *   M <- M - (1 - keep) M E (E^T M E)^-1 E^T M,    b likewise,    keep = exp(-1/(drift_s update_rate))
 *
 * the information form of a random walk along E of the variance (1/keep - 1) (E^T M E)^-1, of each kind by itself: what
 * only several kinds together contain across D is lost. Private to the core. Source: theory.md 4, (6d). */
#ifndef PVID_DRIFT_F32_H
#define PVID_DRIFT_F32_H

#include "pvid/estimator.h"

#if PVID_MAX_DRIFTS > 0

/* Behind the step of a group: M, b and rr forget along each direction of the model, block by block. A direction of
 * which a block knows nothing changes nothing. Cost: C, and three products with M for each direction. */
void pvid_drift_forget_f32(pvid_estimator_f32 *self);

#endif

#endif
