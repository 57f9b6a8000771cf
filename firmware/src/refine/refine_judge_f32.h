/* Standard errors of the refined estimate, and whether it is published. Private to the core. */
#ifndef PVID_REFINE_JUDGE_F32_H
#define PVID_REFINE_JUDGE_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/detail/refine_state.h"

/* sqrt(level), at least 1 */
float pvid_refine_root_f32(float level);

/* |x| < limit, false of NaN */
bool pvid_refine_within_f32(float x, float limit);

/* The covariance of the steps of r: begin with 0, add each column of the triangle's inverse times the variance of a
 * row, end. */
void pvid_refine_assess_begin_f32(pvid_refine_estimate_f32 *estimate);
void pvid_refine_assess_column_f32(pvid_refine_estimate_f32 *estimate, const float triangle[], size_t column,
                                   float variance);
void pvid_refine_assess_end_f32(pvid_refine_estimate_f32 *estimate, const float r[], float level, float clash);

/* Adds the shared errors of trust.h, whose units are those of the steps. */
void pvid_refine_add_shared_f32(pvid_refine_estimate_f32 *estimate, const float shared[]);

/* PVID_UPDATED, PVID_HELD_UNCERTAIN or PVID_HELD_DISAGREES. */
pvid_reason pvid_refine_verdict_f32(const pvid_refine_estimate_f32 *estimate, const pvid_refine_config_f32 *config,
                                    const float weak[], const float weak_se[]);

#endif
