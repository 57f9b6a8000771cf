/* From counts to the sums of windows, with the work spread over the ticks. Private to the core.
 *
 * The last tick of a step's D forms its channels. The others add a block of four steps to the sums, some harmonics a
 * tick, and at the end of a window join these; when nothing is to be added they are free for stages of the last whole
 * window. With D = 1 every tick does both. All other ticks only add their readings to the front end's block. */
#ifndef PVID_FOURIER_COLLECT_Q31_H
#define PVID_FOURIER_COLLECT_Q31_H

#include <stdbool.h>

#include "fourier/fourier_front_q31.h"
#include "pvid/fourier_q31.h"

typedef enum {
    PVID_FOURIER_BUSY,    /* the tick did a part of its block's work */
    PVID_FOURIER_FREE,    /* it did none: it is free for a window's work */
    PVID_FOURIER_WINDOW,  /* the S_h of a window are complete in self->window */
    PVID_FOURIER_REJECTED /* a count beyond full scale or a jet beyond its reach: restarted */
} pvid_fourier_tick;

/* Fewest ticks that are free for a window's work before the next one is joined. */
uint32_t pvid_fourier_free_ticks_q31(const pvid_fourier_design_q31 *design);

/* Returns whether PVID_MAX_BLOCKS are enough: one is where the ticks of a step add and join all harmonics. */
bool pvid_fourier_blocks_fit_q31(const pvid_fourier_design_q31 *design);

/* Requires a valid design; offset as in the configuration. */
void pvid_fourier_collect_init_q31(pvid_fourier_collect_q31 *self, const pvid_fourier_design_q31 *design,
                                   const int32_t offset[]);

/* The windows restart; integrals since the start of the run are kept. */
void pvid_fourier_collect_reset_q31(pvid_fourier_collect_q31 *self);

/* The last tick of a step, after its readings. */
pvid_fourier_tick pvid_fourier_collect_end_q31(pvid_fourier_collect_q31 *self);

/* Another tick, while a block is being added, after its readings. */
pvid_fourier_tick pvid_fourier_collect_work_q31(pvid_fourier_collect_q31 *self);

/* One tick. */
static inline pvid_fourier_tick pvid_fourier_collect_step_q31(pvid_fourier_collect_q31 *self, const int32_t reading[])
{
    if (!pvid_fourier_front_add_q31(&self->front, self->design, reading)) {
        pvid_fourier_collect_reset_q31(self);
        return PVID_FOURIER_REJECTED;
    }
    self->front.wait--;
    if (self->front.wait == 0u) {
        return pvid_fourier_collect_end_q31(self);
    }
    return (self->sums.left > 0u) ? pvid_fourier_collect_work_q31(self) : PVID_FOURIER_FREE;
}

#endif
