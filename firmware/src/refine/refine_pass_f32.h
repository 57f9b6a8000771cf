/* One pass of the refinement over one block, in jobs. Private to the core. */
#ifndef PVID_REFINE_PASS_F32_H
#define PVID_REFINE_PASS_F32_H

#include <stdbool.h>
#include <stdint.h>

#include "refine/refine_front_f32.h"

/* Begins at a state with parameters r. */
void pvid_refine_pass_begin_f32(pvid_refine_pass_f32 *self, const float r[], const float start[],
                                const pvid_refine_steps_f32 *steps, float gate);

/* What a pass needs: another tick, an entry of the ring that is not there yet, or nothing more; or an entry that has
 * been overwritten. */
typedef enum {
    PVID_REFINE_PASS_ON,
    PVID_REFINE_PASS_WAITS,
    PVID_REFINE_PASS_DONE,
    PVID_REFINE_PASS_LOST
} pvid_refine_progress;

/* A block in the ring: its first entry, its big steps; weight: factor on the rows of each output. */
typedef struct {
    const float *r;
    const float *weight;
    uint32_t begin;
    uint32_t length;
} pvid_refine_block_f32;

/* The next jobs, at most so many. Cost on a Cortex-M4F: up to 450 instructions each. */
pvid_refine_progress pvid_refine_pass_run_f32(pvid_refine_pass_f32 *self, const pvid_refine_front_f32 *front,
                                              const pvid_refine_block_f32 *block, uint32_t jobs);

/* Whether the next job needs signals; *step: of which step of the block. */
bool pvid_refine_pass_needs_f32(const pvid_refine_pass_f32 *self, uint32_t *step);

/* Whether the pass is complete: a block of `length` big steps. */
bool pvid_refine_pass_ends_f32(const pvid_refine_pass_f32 *self, uint32_t length);

/* The next job with its signals. */
void pvid_refine_pass_job_f32(pvid_refine_pass_f32 *self, const float r[], const float weight[],
                              const pvid_refine_signals_f32 *signals);

#endif
