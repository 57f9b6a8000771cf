/* From the jets of a step to the values of its channels. Private to the core. */
#ifndef PVID_WEAK_STEP_F32_H
#define PVID_WEAK_STEP_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/weak.h"

/* No step is known. lead: from a run's first sample to its first step [s]. `self` is all zeros. */
void pvid_weak_step_init_f32(pvid_weak_history_f32 *self, float lead);

/* Before the first step of a run: its runs move by dt, by half of it at the first output, with these jets. */
void pvid_weak_step_begin_f32(pvid_weak_history_f32 *self, const pvid_weak_design_f32 *design, float dt,
                              const float jet[], bool first);

/* No step is known; the integrals since the start of the run are kept. */
void pvid_weak_step_reset_f32(pvid_weak_history_f32 *self);

/* Takes the jets of a step, which are in inputs[newest]. Returns true if the channels of the step two before it are
 * known from now on, and writes their values. channels: that are summed; dt: between steps [s]; index: of that step in
 * its half window. */
bool pvid_weak_step_take_f32(pvid_weak_history_f32 *self, const pvid_weak_design_f32 *design, float dt, uint16_t index,
                             float channel[]);

#endif
