/* The misfit alarm of the strong form, by its residuals: see pvid/misfit.h. Private to the core. */
#ifndef PVID_MISFIT_F32_H
#define PVID_MISFIT_F32_H

#include <stdbool.h>

#include "pvid/misfit.h"

/* Initialises `self` for rows at rate_hz (> 0) and a time constant of forgetting of forgetting_s, 0: none. The
 * estimator has checked both. */
void pvid_misfit_init_f32(pvid_misfit_f32 *self, float rate_hz, float forgetting_s);

/* Ends a block. Returns whether it is a misfit. */
bool pvid_misfit_judge_f32(pvid_misfit_f32 *self);

/* Adds a row: the squares of its residual and of its sensitivity, p[0] times its gradient in p[0]. Returns the rows
 * that are left of the block: it ends when there is none, and must then be judged, or deferred. */
static inline uint32_t pvid_misfit_add_f32(pvid_misfit_f32 *self, float square, float signal)
{
    const uint32_t left = (uint32_t)self->left - 1u;
    self->rss += square;
    self->signal += signal;
    self->left = (uint16_t)left;
    return left;
}

/* A block that ends takes one row more. */
static inline void pvid_misfit_defer_f32(pvid_misfit_f32 *self)
{
    self->left = 1;
}

#endif
