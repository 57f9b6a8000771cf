/* The gate of gate_q31.h begins anew. Private to the core. */
#ifndef PVID_JUDGE_GATE_Q31_H
#define PVID_JUDGE_GATE_Q31_H

#include "pvid/gate_q31.h"

/* Forgets the usual size: the next residuals are accepted, as the first ones were. */
static inline void pvid_gate_begin_anew_q31(pvid_gate_q31 *self)
{
    self->judged = 0;
}

/* As behind init: a usual size from before means nothing. */
static inline void pvid_gate_restart_q31(pvid_gate_q31 *self)
{
    self->judged = 0;
    self->scale = self->floor;
    self->usual = self->floor;
}

/* The hash of a gate's settings, continued from `hash`. */
uint32_t pvid_fingerprint_gate_q31(uint32_t hash, const pvid_gate_config_q31 *config);

#endif
