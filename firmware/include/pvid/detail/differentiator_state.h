/* pvid/detail/differentiator_state.h - the state behind differentiator.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_DIFFERENTIATOR_STATE_H
#define PVID_DETAIL_DIFFERENTIATOR_STATE_H

#include "pvid/differentiator.h"

/* Only the functions of differentiator.h write to it. */
struct pvid_differentiator_f32 {
    pvid_fir_bank_f32 bank;
    float rate_power[PVID_ORDERS - 1]; /* rate^1..rate^4 [1/s^k] */
    uint16_t length;                   /* samples in the window */
    uint16_t head;                     /* place of the oldest sample */
    uint16_t filled;                   /* samples since the reset, at most length */
    float history[PVID_MAX_WINDOW];
};

#endif
