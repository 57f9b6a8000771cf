/* Front end of the fixed-point weak form: exact sums of counts, one rounding each. Private to the core. */
#ifndef PVID_WEAK_FRONT_Q31_H
#define PVID_WEAK_FRONT_Q31_H

#include <stdbool.h>

#include "pvid/weak_q31.h"

void pvid_weak_front_init_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design);

void pvid_weak_front_reset_q31(pvid_weak_front_q31 *self);

/* Stores one sample within full scale and runs a part of the block's FIR job. Returns true if this completes the job,
 * and then writes F and U at the block's centre. */
bool pvid_weak_front_step_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design, int32_t phi, int32_t y,
                              int32_t *f, int64_t *u);

#endif
