/* Front end of the weak form: smoothing, second derivative and decimation. Private to the core. */
#ifndef PVID_WEAK_FRONT_F32_H
#define PVID_WEAK_FRONT_F32_H

#include <stdbool.h>

#include "pvid/weak.h"

void pvid_weak_front_init_f32(pvid_weak_front_f32 *self, const pvid_weak_design_f32 *design, float sample_rate_hz,
                              float l1);

void pvid_weak_front_reset_f32(pvid_weak_front_f32 *self);

/* Stores one finite sample and runs a part of the block's FIR job. Returns true if this completes the job, and then
 * writes phi [rad] and u = y_A''/l1 [1/s^2] at the block's centre: once per `decimation` samples, in the first half of
 * a block. */
bool pvid_weak_front_step_f32(pvid_weak_front_f32 *self, float phi, float y, float *smooth_phi, float *u);

#endif
