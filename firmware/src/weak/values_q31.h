/* From the jets of a step to the channels of an earlier one: signs, runs, generated values, integrals. Private to the
 * core. */
#ifndef PVID_WEAK_VALUES_Q31_H
#define PVID_WEAK_VALUES_Q31_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/weak_q31.h"

typedef enum {
    PVID_WEAK_NO_CHANNELS, /* steps before are missing yet */
    PVID_WEAK_CHANNELS,
    PVID_WEAK_BEYOND /* an input is beyond its reach */
} pvid_weak_outcome;

/* Channels that are summed: all but a constant at the end. */
static inline size_t pvid_weak_summed_q31(const pvid_weak_model_q31 *model)
{
    const size_t last = (size_t)model->channels - 1u;
    return (model->channel[last].gain == PVID_WEAK_NONE) ? last : (last + 1u);
}

/* The runs start at the first sample, `lead` ticks before the first step. */
void pvid_weak_values_init_q31(pvid_weak_values_q31 *self, uint16_t lead);

/* After missing samples: the runs are kept. */
void pvid_weak_values_reset_q31(pvid_weak_values_q31 *self);

/* Takes the jets of the next step, and writes the channels of step self->index of its half self->half, each
 * PVID_WEAK_BLOCK_Q31 places behind the one before. At the first step of a half, self->edge of the half before is
 * complete. pvid_weak_values_next_q31 then moves on. */
pvid_weak_outcome pvid_weak_values_step_q31(pvid_weak_values_q31 *self, const pvid_weak_design_q31 *design,
                                            const int32_t jet[], pvid_weak_entry_q31 channel[]);

/* Before the first step of a run: its runs move by a step, by half of one at the first output, with these jets. */
void pvid_weak_values_begin_q31(pvid_weak_values_q31 *self, const pvid_weak_design_q31 *design, const int32_t jet[],
                                bool first);

/* To the next step. */
void pvid_weak_values_next_q31(pvid_weak_values_q31 *self, uint16_t hop);

#endif
