/* Front end: from samples to signals, from the last signals to jets at a step. Private to the core. */
#ifndef PVID_FOURIER_FRONT_F32_H
#define PVID_FOURIER_FRONT_F32_H

#include <stdbool.h>

#include "pvid/fourier.h"

/* Half of the longest filter of the jets. */
uint16_t pvid_fourier_front_half_f32(const pvid_fourier_design_f32 *design);

/* Pairs of all filters of the jets. */
uint32_t pvid_fourier_front_pairs_f32(const pvid_fourier_design_f32 *design);

/* Requires a valid design. */
void pvid_fourier_front_init_f32(pvid_fourier_front_f32 *self, const pvid_fourier_design_f32 *design,
                                 float sample_rate_hz);

/* Ticks from the first sample after a restart to the first step. */
uint16_t pvid_fourier_front_lead_f32(const pvid_fourier_front_f32 *self);

/* Empty ring, no job. */
void pvid_fourier_front_reset_f32(pvid_fourier_front_f32 *self, const pvid_fourier_design_f32 *design);

/* Stores the finite samples of a tick and runs a part of the job. Returns true if this tick is that of a step: then
 * jet_value contains the step's jets. */
bool pvid_fourier_front_step_f32(pvid_fourier_front_f32 *self, const pvid_fourier_design_f32 *design,
                                 const float sample[]);

#endif
