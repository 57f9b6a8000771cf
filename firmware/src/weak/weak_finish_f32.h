/* A whole window: from its sums to rows, to steps of p, to the published estimate. One stage per call; finish_f32.c
 * lists the stages. Private to the core. */
#ifndef PVID_WEAK_FINISH_F32_H
#define PVID_WEAK_FINISH_F32_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/weak.h"

/* Stage without work. */
#define PVID_WEAK_IDLE 255u

/* No work; `self` is all zeros. Requires a valid design; dt: between steps [s]. Fails iff the gate's configuration is
 * out of its range. */
pvid_status pvid_weak_finish_init_f32(pvid_weak_finish_f32 *self, const pvid_weak_config_f32 *config, float dt);

/* Begins a window at the estimator's present p. */
void pvid_weak_finish_begin_f32(pvid_weak_finish_f32 *self);

/* The next window has no neighbour before it: windows have been dropped or restarted. */
void pvid_weak_finish_skip_f32(pvid_weak_finish_f32 *self);

/* Returns whether a window is being processed. */
static inline bool pvid_weak_finish_is_busy_f32(const pvid_weak_finish_f32 *self)
{
    return self->stage != (uint8_t)PVID_WEAK_IDLE;
}

/* Runs so many stages of a window that is being processed, at least one, or up to the last. finish.report is
 * PVID_ACCUMULATED before; it becomes their reason if a row is rejected, if the gate rejects the rows of a kind, or at
 * the last stage. */
void pvid_weak_finish_run_f32(pvid_weak_f32 *self, uint32_t stages);

/* Number of stages of a window, at most. */
uint32_t pvid_weak_finish_stages_f32(const pvid_weak_f32 *self);

/* Number of stages until all columns of a window are formed, at most. */
uint32_t pvid_weak_finish_columns_f32(const pvid_weak_f32 *self);

#endif
