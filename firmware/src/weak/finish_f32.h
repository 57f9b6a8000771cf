/* A complete window of the weak form: from sums to rows to steps, one stage a call. Private to the core. */
#ifndef PVID_WEAK_FINISH_F32_H
#define PVID_WEAK_FINISH_F32_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/weak.h"

/* No work. */
void pvid_weak_finish_init_f32(pvid_weak_finish_f32 *self);

/* Starts on the window with the sums of self->buffer, at the estimator's present p; `expected`: variance of a row
 * by noise; angle: NULL for linear rows. */
void pvid_weak_finish_begin_f32(pvid_weak_finish_f32 *self, const pvid_estimator_f32 *estimator,
                                pvid_weak_angle_f32 *angle, float expected);

/* Whether a window is in work. */
bool pvid_weak_finish_is_busy_f32(const pvid_weak_finish_f32 *self);

/* One stage; sums are those of self->buffer. Sets *reason if a row was refused or the window is complete. */
void pvid_weak_finish_step_f32(pvid_weak_finish_f32 *self, const pvid_weak_design_f32 *design, uint8_t iterations,
                               float sums[][PVID_WEAK_TERMS], pvid_estimator_f32 *estimator, pvid_trust_f32 *trust,
                               pvid_reason *reason);

/* Number of stages of a window. */
uint32_t pvid_weak_finish_stages_f32(const pvid_weak_design_f32 *design, uint8_t iterations,
                                     const pvid_estimator_f32 *estimator, const pvid_weak_angle_f32 *angle);

#endif
