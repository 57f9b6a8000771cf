/* A complete window of the weak form: from sums to rows, to steps of p, to the published estimate. One stage per call;
 * finish_f32.c lists the stages. Private to the core. */
#ifndef PVID_WEAK_FINISH_F32_H
#define PVID_WEAK_FINISH_F32_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/weak.h"

/* No work. */
void pvid_weak_finish_init_f32(pvid_weak_finish_f32 *self);

/* Begins a window, whose sums are in self->buffer, at the estimator's present p. expected: variance of a row by the
 * sensors' noise; angle: NULL for linear rows. */
void pvid_weak_finish_begin_f32(pvid_weak_finish_f32 *self, const pvid_estimator_f32 *estimator,
                                pvid_weak_angle_f32 *angle, float expected);

/* Returns whether a window is being processed. */
bool pvid_weak_finish_is_busy_f32(const pvid_weak_finish_f32 *self);

/* Runs one stage; `sums` are those of self->buffer, which become the columns of the rows. Sets *reason if a row is
 * rejected, if the gate rejects the window, or at its last stage. */
void pvid_weak_finish_step_f32(pvid_weak_finish_f32 *self, const pvid_weak_design_f32 *design, uint8_t iterations,
                               float sums[][PVID_WEAK_TERMS], pvid_estimator_f32 *estimator, pvid_trust_f32 *trust,
                               pvid_reason *reason);

/* Number of stages of a window. */
uint32_t pvid_weak_finish_stages_f32(const pvid_weak_design_f32 *design, uint8_t iterations,
                                     const pvid_estimator_f32 *estimator, const pvid_weak_angle_f32 *angle);

#endif
