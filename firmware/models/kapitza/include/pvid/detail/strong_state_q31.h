/* pvid/detail/strong_state_q31.h - the state behind strong_q31.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_STRONG_STATE_Q31_H
#define PVID_DETAIL_STRONG_STATE_Q31_H

#include "pvid/strong_q31.h"

/* Only the functions of strong_q31.h write to it. */
struct pvid_strong_q31 {
    pvid_differentiator_q31 differentiator;
    pvid_strong_row_q31 row;
    int32_t u_multiplier[PVID_Y_ORDERS_Q31];
    uint8_t u_shift[PVID_Y_ORDERS_Q31];
    int32_t phi_offset;
    int32_t y_offset;
    int64_t drive;            /* mean square of u over about drive_ticks */
    int64_t drive_min;        /* mean square of u below which no row is used */
    int32_t drive_forgetting; /* share of a tick in this mean, Q31 */
    bool frozen;
    bool alarm; /* the last block of rows was a misfit: see misfit.h */
    pvid_gate_q31 gate;
    pvid_misfit_q31 misfit;
    pvid_kapitza_estimator_q31 estimator;
};

#endif
