/* A complete window of the fixed-point weak form: from sums to rows, to steps of p, to the published estimate. One
 * stage per call; finish_q31.c lists the stages. Private to the core. */
#ifndef PVID_WEAK_FINISH_Q31_H
#define PVID_WEAK_FINISH_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/weak_q31.h"

/* No work. */
void pvid_weak_finish_init_q31(pvid_weak_finish_q31 *self);

/* Begins a window, whose sums are in self->buffer, at the estimator's present p. pivot: variance of a row by the pivot
 * sensor's noise [Y's integer^2]. */
void pvid_weak_finish_begin_q31(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design,
                                const pvid_estimator_q31 *estimator, pvid_scaled_q31 pivot);

/* Returns whether a window is being processed. */
bool pvid_weak_finish_is_busy_q31(const pvid_weak_finish_q31 *self);

/* Runs one stage; `sums` are those of self->buffer, which become the columns of the rows. Sets *reason if a row is
 * rejected, if the gate rejects the window, or at its last stage. */
void pvid_weak_finish_step_q31(pvid_weak_finish_q31 *self, const pvid_weak_design_q31 *design, uint8_t iterations,
                               int32_t sums[][PVID_WEAK_TERMS_Q31], pvid_estimator_q31 *estimator,
                               pvid_trust_q31 *trust, pvid_reason *reason);

/* Number of stages of a window. */
uint32_t pvid_weak_finish_stages_q31(uint8_t functions, uint8_t iterations, const pvid_estimator_q31 *estimator);

#endif
