/* Variance of an equation's own error, from the residuals as the run goes on, in integers. Private to the core. */
#ifndef PVID_WEAK_ERROR_Q31_H
#define PVID_WEAK_ERROR_Q31_H

#include <stdbool.h>

#include "pvid/weak_q31.h"

/* Starts with the design's variances. */
void pvid_weak_error_init_q31(pvid_weak_error_q31 self[], const pvid_weak_design_q31 *design);

/* Takes the residuals of a window of one kind, at a p that has arrived: mean square of the white rows, >= 0, whose
 * expectation is 1. Returns whether the variance is to be changed; least: the design's. */
bool pvid_weak_error_take_q31(pvid_weak_error_q31 *self, pvid_scaled_q31 least, pvid_scaled_q31 residual);

/* Changes the variance if it is to be. share: of each unit of it in that expectation. Returns what is left of the
 * information in older rows, Q31: below INT32_MAX if they were taken for more exact than they are. */
int32_t pvid_weak_error_change_q31(pvid_weak_error_q31 *self, pvid_scaled_q31 least, pvid_scaled_q31 share);

#endif
