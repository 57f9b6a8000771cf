/* The gate of gate_q31.h begins anew. Private to the core. */
#ifndef PVID_JUDGE_GATE_Q31_H
#define PVID_JUDGE_GATE_Q31_H

#include "pvid/gate_q31.h"

/* Forgets the usual size: the next residuals are accepted, as the first ones were. */
static inline void pvid_gate_begin_anew_q31(pvid_gate_q31 *self)
{
    self->judged = 0;
}

#endif
