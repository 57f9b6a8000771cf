/* pvid/detail/differentiator_state_q31.h - the state behind differentiator_q31.h. Not API: it may change with any
 * release. */
#ifndef PVID_DETAIL_DIFFERENTIATOR_STATE_Q31_H
#define PVID_DETAIL_DIFFERENTIATOR_STATE_Q31_H

#include "pvid/differentiator_q31.h"

/* Only the functions of differentiator_q31.h write to it. */
struct pvid_differentiator_q31 {
    pvid_fir_bank_q31 bank;
    uint16_t length;  /* places of the ring */
    uint16_t head;    /* place of the oldest point, and of the sums of a block until they replace it */
    uint16_t at;      /* samples in these sums */
    uint16_t missing; /* points until the window is full */
    bool five_points; /* the bank is that of pvid_five_points_q31, no shift */
    int32_t history[PVID_MAX_WINDOW][2]; /* phi, y: the ring of points */
};

#endif
