/* The engine of models with their own `project`. Private to the core. */
#ifndef PVID_DIRECT_F32_H
#define PVID_DIRECT_F32_H

#include "solve/state_f32.h"

/* Adds a row and, if it ends a group and one is due, solves. e, gradient: of `innovate`, while g < 1. */
pvid_reason pvid_direct_take_row_f32(pvid_estimator_f32 *self, const float n[], float y, float e,
                                     const float gradient[], bool ends_group);

/* pvid_estimator_assess_f32. */
void pvid_direct_assess_f32(const pvid_estimator_f32 *self, pvid_estimate_f32 *estimate);

/* A solve of the present sums: at the end of a group, or a further Gauss-Newton step. */
pvid_reason pvid_direct_solve_f32(pvid_estimator_f32 *self, bool ends_group);

/* Writes the residuals of the normal equations. rss_minus_yy: what `project` (model.h) returns for these sums. */
void pvid_direct_residual_f32(const pvid_estimator_f32 *self, const float sums[], float rss_minus_yy,
                              pvid_system_f32 *system);

/* One step of p from the normal equations; `gain` is g of estimator.h. Adds H0 to S. */
pvid_reason pvid_direct_move_f32(pvid_estimator_f32 *self, float gain, pvid_system_f32 *system);

/* ---- inlined ---- */

/* Adds the prior and turns F into the right-hand side, for parameter a; `gain` is g of estimator.h. */
static inline void pvid_direct_complete_f32(pvid_estimator_f32 *self, size_t a, float gain, float s[][PVID_MAX_P],
                                            float rhs[])
{
    s[a][a] += self->settings.prior[a];
    rhs[a] = (gain * rhs[a]) + ((1.0f - gain) * self->innovation[a]);
    self->innovation[a] = 0.0f;
}

#endif
