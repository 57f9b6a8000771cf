/* Variance of an equation's own error, from the residuals as the run goes on. Private to the core. */
#ifndef PVID_WEAK_ERROR_F32_H
#define PVID_WEAK_ERROR_F32_H

#include "pvid/weak.h"

/* Starts with the design's variances. */
void pvid_weak_error_init_f32(pvid_weak_error_f32 self[], const pvid_weak_design_f32 *design);

/* Takes the residuals of a window of one kind, at a p that has arrived.
 *
 * least: the design's variance. residual: mean square of the white rows; its expectation is 1, of which `share` is for
 * each unit of the variance. Returns what is left of the information in older rows: below 1 if they were taken for more
 * exact than they are, else 1. */
float pvid_weak_error_take_f32(pvid_weak_error_f32 *self, float least, float residual, float share);

#endif
