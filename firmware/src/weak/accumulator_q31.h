/* From counts to the sums of windows, with the work spread over the ticks. Private to the core.
 *
 * The last tick of a step's D forms its channels. The others add a block of four steps to the sums, some harmonics a
 * tick, and at the end of a window join these; when nothing is to be added they are free for stages of the last whole
 * window, all or every second, fourth ... of them. With D = 1 every tick does both. All other ticks only add their
 * readings to the front end's block. */
#ifndef PVID_WEAK_ACCUMULATOR_Q31_H
#define PVID_WEAK_ACCUMULATOR_Q31_H

#include <stdbool.h>

#include "pvid/weak_q31.h"
#include "weak/weak_front_q31.h"

typedef enum {
    PVID_WEAK_BUSY,    /* the tick did a part of its block's work */
    PVID_WEAK_FREE,    /* it did none: it is free for a window's work */
    PVID_WEAK_WINDOW,  /* the S_h of a window are complete in self->window */
    PVID_WEAK_REJECTED /* a count beyond full scale or a jet beyond its reach: restarted */
} pvid_weak_tick;

/* Fewest ticks that are free for a window's work before the next one is joined. */
uint32_t pvid_weak_free_ticks_q31(const pvid_weak_design_q31 *design);

/* Those of them before the next half's first block is added. */
uint32_t pvid_weak_ticks_behind_join_q31(const pvid_weak_design_q31 *design);

/* The pace of so many stages of a window, `columns` of which read its sums: steps.h. */
uint8_t pvid_weak_pace_q31(const pvid_weak_design_q31 *design, uint32_t stages, uint32_t columns);

/* Returns whether PVID_MAX_BLOCKS are enough: one is where the ticks of a step add and join all harmonics. */
bool pvid_weak_blocks_fit_q31(const pvid_weak_design_q31 *design);

/* Requires a valid design; offset as in the configuration. */
void pvid_weak_accumulator_init_q31(pvid_weak_accumulator_q31 *self, const pvid_weak_design_q31 *design,
                                    const int32_t offset[]);

/* The windows restart; integrals since the start of the run are kept. */
void pvid_weak_accumulator_reset_q31(pvid_weak_accumulator_q31 *self);

/* The last tick of a step, after its readings. */
pvid_weak_tick pvid_weak_accumulator_end_q31(pvid_weak_accumulator_q31 *self);

/* Another tick, while a block is being added, after its readings. */
pvid_weak_tick pvid_weak_accumulator_work_q31(pvid_weak_accumulator_q31 *self);

/* One tick. */
static inline pvid_weak_tick pvid_weak_accumulator_step_q31(pvid_weak_accumulator_q31 *self, const int32_t reading[])
{
    if (!pvid_weak_front_add_q31(&self->front, self->design, reading)) {
        pvid_weak_accumulator_reset_q31(self);
        return PVID_WEAK_REJECTED;
    }
    self->front.wait--;
    if (self->front.wait == 0u) {
        return pvid_weak_accumulator_end_q31(self);
    }
    return (self->sums.left > 0u) ? pvid_weak_accumulator_work_q31(self) : PVID_WEAK_FREE;
}

#endif
