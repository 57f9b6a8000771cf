/* From the jets of a step to the channels of an earlier one: signs, runs, generated values, integrals. Private to the
 * core. */
#ifndef PVID_FOURIER_VALUES_Q31_H
#define PVID_FOURIER_VALUES_Q31_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/fourier_q31.h"

typedef enum {
    PVID_FOURIER_NO_CHANNELS, /* steps before are missing yet */
    PVID_FOURIER_CHANNELS,
    PVID_FOURIER_BEYOND /* an input is beyond its reach */
} pvid_fourier_outcome;

/* Channels that are summed: all but a constant at the end. */
static inline size_t pvid_fourier_summed_q31(const pvid_fourier_model_q31 *model)
{
    const size_t last = (size_t)model->channels - 1u;
    return (model->channel[last].gain == PVID_FOURIER_NONE) ? last : (last + 1u);
}

/* The runs start at the first sample, `lead` ticks before the first step. */
void pvid_fourier_values_init_q31(pvid_fourier_values_q31 *self, uint16_t lead);

/* After missing samples: the runs are kept. */
void pvid_fourier_values_reset_q31(pvid_fourier_values_q31 *self);

/* Takes the jets of the next step, and writes the channels of step self->index of its half self->half. At the first
 * step of a half, self->edge of the half before is complete. pvid_fourier_values_next_q31 then moves on. */
pvid_fourier_outcome pvid_fourier_values_step_q31(pvid_fourier_values_q31 *self, const pvid_fourier_design_q31 *design,
                                                  const int32_t jet[], int32_t channel[]);

/* To the next step. */
void pvid_fourier_values_next_q31(pvid_fourier_values_q31 *self, uint16_t hop);

#endif
