/* The end of a block: its sums and the carried triangle give the step of r and of the block's start, in jobs for one
 * tick each. Private to the core. */
#ifndef PVID_REFINE_SOLVE_F32_H
#define PVID_REFINE_SOLVE_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/detail/refine_state.h"

typedef enum { PVID_REFINE_SOLVING, PVID_REFINE_SOLVED, PVID_REFINE_UNSOLVED } pvid_refine_solution;

/* Whether steps of this entry of r are steps of its logarithm. */
bool pvid_refine_is_logarithmic_f32(size_t parameter);

/* Whether a parameter is the width of a sign: each block has its own, no estimate waits until it is certain. */
static inline bool pvid_refine_is_width(size_t parameter)
{
#if PVID_REFINE_WIDTHS > 0
    return parameter < (size_t)PVID_REFINE_WIDTHS;
#else
    (void)parameter;
    return false;
#endif
}

/* The step from one value of an entry of r to another. */
float pvid_refine_difference_f32(size_t parameter, float to, float from);

/* r after a step. */
void pvid_refine_move_f32(const float r[], const float step[], float moved[]);

/* Standard deviations of the steps: a diagonal triangle in residuals of `sd`. */
void pvid_refine_prior_f32(const float prior_sd[], float sd, float triangle[]);

#if PVID_REFINE_WIDTHS > 0
/* Removes the information on the widths. They come first in r, so that without their rows the triangle is that of the
 * other entries for any widths. The prior takes their place. */
void pvid_refine_forget_widths_f32(const float prior_sd[], float sd, float triangle[]);
#endif

void pvid_refine_solve_begin_f32(pvid_refine_solve_f32 *self);

/* The next job. The sums of the pass are used up; the triangle is that of the past, whose minimum is at
 * `past`; `linear` is the pass's. The step is shortened to step_limit prior_sd. Cost on a Cortex-M4F: up to 700
 * instructions. */
pvid_refine_solution pvid_refine_solve_job_f32(pvid_refine_solve_f32 *self, pvid_refine_pass_f32 *pass,
                                               const float triangle[], const float past[], const float linear[],
                                               const float prior_sd[], float step_limit);

/* The state at the end of the pass, corrected by the steps to first order. */
void pvid_refine_end_state_f32(const pvid_refine_solve_f32 *self, const pvid_refine_pass_f32 *pass,
                               const float linear[], float state[]);

/* Column `column` of the inverse of a triangle; entries below `column` are 0. */
void pvid_refine_inverse_column_f32(const float triangle[], size_t column, float out[]);

#endif
