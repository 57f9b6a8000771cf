/* From counts to the sums of windows, with the work spread over the ticks. Private to the core. */
#ifndef PVID_FOURIER_COLLECT_Q31_H
#define PVID_FOURIER_COLLECT_Q31_H

#include <stdbool.h>

#include "pvid/fourier_q31.h"

typedef enum {
    PVID_FOURIER_BUSY,    /* the tick did a part of its block's work */
    PVID_FOURIER_FREE,    /* it did none, or D is small: it is free for a window's work */
    PVID_FOURIER_WINDOW,  /* the S_h of a window are complete in self->window */
    PVID_FOURIER_REJECTED /* a count beyond full scale or a jet beyond its reach: restarted */
} pvid_fourier_tick;

/* Fewest ticks that are free for a window's work before the next one is joined. */
uint32_t pvid_fourier_free_ticks_q31(const pvid_fourier_design_q31 *design);

/* Requires a valid design. */
void pvid_fourier_collect_init_q31(pvid_fourier_collect_q31 *self, const pvid_fourier_design_q31 *design);

/* The windows restart; integrals since the start of the run are kept. */
void pvid_fourier_collect_reset_q31(pvid_fourier_collect_q31 *self);

/* One tick: counts about their offsets. */
pvid_fourier_tick pvid_fourier_collect_step_q31(pvid_fourier_collect_q31 *self, const int32_t counts[]);

#endif
