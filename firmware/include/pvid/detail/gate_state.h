/* pvid/detail/gate_state.h - the state behind gate.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_GATE_STATE_H
#define PVID_DETAIL_GATE_STATE_H

#include "pvid/gate.h"

/* Only the functions of gate.h write to it. */
struct pvid_gate_f32 {
    float limit;    /* sigmas^2; 0: no gate */
    float memory;   /* residuals over which the scale averages */
    float floor;    /* least scale */
    float widening; /* factor on the scale at an outlier */
    float judged;   /* accepted residuals; stops at memory */
    float scale;    /* mean square of the accepted residuals, wider by each outlier since */
    float usual;    /* scale behind the last residual that pvid_gate_judge_f32 accepted */
};

#endif
