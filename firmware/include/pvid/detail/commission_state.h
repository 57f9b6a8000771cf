/* pvid/detail/commission_state.h - the state behind commission.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_COMMISSION_STATE_H
#define PVID_DETAIL_COMMISSION_STATE_H

#include "pvid/commission.h"

/* Only the functions of commission.h write to it. */
struct pvid_commission_f32 {
    const pvid_commission_config_f32 *config; /* NULL: not ready */
    pvid_commission_result_f32 result;
    uint32_t phase; /* pvid_commission_state; written by step in bursts and at the end, by work while it solves */
    uint32_t head;  /* samples of the burst in the ring so far: written by step, read by work */
    uint32_t tail;  /* of these, samples that work has taken: written by work, read by step */
    uint32_t asked; /* abort: 1 */
    /* of step */
    bool is_moving; /* the excitations of this burst have been started */
    bool is_ending; /* the verdict is there, the drives are not 0 yet */
    /* of work */
    bool has_begun; /* the pass */
    uint8_t pass;
    float start[PVID_MAX_P];
    float own[PVID_MAX_P]; /* standard errors of the result without those that all windows share */
};

#endif
