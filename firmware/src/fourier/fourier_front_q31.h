/* Front end: from counts to signals, from the last signals to the jets of a step. Private to the core. */
#ifndef PVID_FOURIER_FRONT_Q31_H
#define PVID_FOURIER_FRONT_Q31_H

#include <stdbool.h>

#include "pvid/fourier_q31.h"

/* Half of the longest filter of the jets. */
uint16_t pvid_fourier_front_half_q31(const pvid_fourier_design_q31 *design);

/* Ticks from the first sample to the first step: two at least, so that signals of several samples are right there. */
static inline uint16_t pvid_fourier_front_lead_q31(const pvid_fourier_design_q31 *design)
{
    const uint16_t half = pvid_fourier_front_half_q31(design);
    return (half > 2u) ? half : 2u;
}

/* Ticks that a job takes: half of a block at most, but one at least. */
uint32_t pvid_fourier_front_job_q31(const pvid_fourier_design_q31 *design);

/* Requires a valid design. */
void pvid_fourier_front_init_q31(pvid_fourier_front_q31 *self, const pvid_fourier_design_q31 *design);

/* Empty ring, no job. */
void pvid_fourier_front_reset_q31(pvid_fourier_front_q31 *self, const pvid_fourier_design_q31 *design);

/* Stores the counts of a tick, each within its full scale, and runs a part of the job. Returns true if this completes
 * the job: then `value` contains the step's jets. */
bool pvid_fourier_front_step_q31(pvid_fourier_front_q31 *self, const pvid_fourier_design_q31 *design,
                                 const int32_t counts[]);

/* Whether a job is under way. */
static inline bool pvid_fourier_front_is_busy_q31(const pvid_fourier_front_q31 *self,
                                                  const pvid_fourier_design_q31 *design)
{
    return self->jet < design->model->jets;
}

#endif
