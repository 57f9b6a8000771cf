/* A whole window: from its sums to rows, to steps of p, to the published estimate. One stage per call; finish_q31.c
 * lists the stages. Private to the core. */
#ifndef PVID_WEAK_FINISH_Q31_H
#define PVID_WEAK_FINISH_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/weak_q31.h"

/* No work; `self` is all zeros. Requires a valid design. Fails iff the gate's configuration is out of its range. */
pvid_status pvid_weak_finish_init_q31(pvid_weak_finish_q31 *self, const pvid_weak_config_q31 *config);

/* Begins a window at the estimator's present p. */
void pvid_weak_finish_begin_q31(pvid_weak_finish_q31 *self);

/* The next window has no neighbour before it: windows have been dropped or restarted. */
void pvid_weak_finish_skip_q31(pvid_weak_finish_q31 *self);

/* The stage behind the last one. */
#define PVID_WEAK_IDLE_Q31 21u

/* Whether a window is being processed. */
static inline bool pvid_weak_finish_is_busy_q31(const pvid_weak_finish_q31 *self)
{
    return self->stage != PVID_WEAK_IDLE_Q31;
}

/* Runs one stage. Sets *reason if a row is rejected, if the gate rejects the rows of a kind, or at the last stage. */
void pvid_weak_finish_step_q31(pvid_weak_q31 *self, pvid_reason *reason);

/* Number of stages of a window up to the last that reads its sums. */
uint32_t pvid_weak_finish_columns_q31(const pvid_weak_q31 *self);

/* Number of stages of a window. */
uint32_t pvid_weak_finish_stages_q31(const pvid_weak_q31 *self);

#endif
