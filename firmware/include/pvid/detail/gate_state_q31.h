/* pvid/detail/gate_state_q31.h - the state behind gate_q31.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_GATE_STATE_Q31_H
#define PVID_DETAIL_GATE_STATE_Q31_H

#include "pvid/gate_q31.h"

/* Only the functions of gate_q31.h write to it. */
struct pvid_gate_q31 {
    pvid_scaled_q31 limit;    /* sigmas^2; 0: no gate */
    pvid_scaled_q31 floor;    /* least scale */
    pvid_scaled_q31 widening; /* factor on the scale at an outlier */
    pvid_scaled_q31 scale;    /* mean square of the accepted residuals, wider by each outlier since */
    pvid_scaled_q31 usual;    /* scale behind the last residual that pvid_gate_judge_q31 accepted */
    pvid_scaled_q31 part;     /* of it that the next one replaces: 1 / judged */
    uint32_t memory;          /* residuals that the scale remembers */
    uint32_t judged;          /* accepted residuals; stops at memory */
};

#endif
