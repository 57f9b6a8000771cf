/* pvid/detail/differentiator_state.h - the state behind differentiator.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_DIFFERENTIATOR_STATE_H
#define PVID_DETAIL_DIFFERENTIATOR_STATE_H

#include "pvid/differentiator.h"

/* Only the functions of differentiator.h write to it. */
struct pvid_differentiator_f32 {
    pvid_fir_bank_f32 bank;
    float scale[PVID_ORDERS];       /* rate^0..rate^4 over the samples of a block [1/s^k] */
    uint16_t length;                /* places of the ring */
    uint16_t head;                  /* place of the oldest point, and of the sum of a block until it replaces that */
    uint16_t at;                    /* samples in this sum */
    uint16_t missing;               /* points until the window is full */
    float history[PVID_MAX_WINDOW]; /* the ring of points */
};

#endif
