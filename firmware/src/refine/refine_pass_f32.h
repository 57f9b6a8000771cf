/* One pass of the refinement over one block, in jobs for one tick each. Private to the core. */
#ifndef PVID_REFINE_PASS_F32_H
#define PVID_REFINE_PASS_F32_H

#include <stdbool.h>

#include "pvid/detail/refine_state.h"

/* Steps before and behind three neighbouring ones whose inputs a skew needs. */
#define PVID_REFINE_REACH (2 * PVID_REFINE_SKEW)
#define PVID_REFINE_POINTS ((2 * PVID_REFINE_REACH) + 1)

/* Signals of up to three neighbouring steps: inputs, with those of the reach, and outputs (NaN: missing). */
typedef struct {
    float u[3 + (2 * PVID_REFINE_REACH)][PVID_REFINE_INPUTS];
    float z[3][PVID_REFINE_OUTPUTS];
} pvid_refine_signals_f32;

/* Begins at a state with parameters r and steps of h seconds. */
void pvid_refine_pass_begin_f32(pvid_refine_pass_f32 *self, const float r[], const float start[], float h, float gate);

/* Number of neighbouring steps whose signals the next job needs, 0, 1 or 3; *first: the first one of the block. */
uint32_t pvid_refine_pass_needs_f32(const pvid_refine_pass_f32 *self, uint32_t *first);

/* Whether the pass is complete: a block of `length` big steps. */
bool pvid_refine_pass_ends_f32(const pvid_refine_pass_f32 *self, uint32_t length);

/* The next job. `weight`: factor on the rows of each output. Cost on a Cortex-M4F: up to 1 000 instructions. */
void pvid_refine_pass_job_f32(pvid_refine_pass_f32 *self, const float r[], const float weight[],
                              const pvid_refine_signals_f32 *signals);

#endif
