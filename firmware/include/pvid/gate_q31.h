/* pvid/gate_q31.h - rejects outliers: gate.h with integers only.
 *
 * The same rule and scale. Squares of residuals exceed any fixed-point range; therefore squares and scale are
 * numbers of 30 bits with an exponent. Every input is allowed. Cost: about ten shifts and products per residual.
 */
#ifndef PVID_GATE_Q31_H
#define PVID_GATE_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/detail/gate_verdict.h"
#include "pvid/estimator_q31.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    uint32_t sigmas;          /* largest residual [multiples of the usual size], Q16: 2..1000; 0: no gate */
    uint32_t patience_groups; /* rows (strong form) or windows (weak form) after which a changed mechanism is
                                 accepted, 1..2^30; 0: never */
} pvid_gate_config_q31;

/* State: detail/gate_state_q31.h, not API. Only the functions below write to it. */
typedef struct pvid_gate_q31 pvid_gate_q31;

/* Initialises `self`; the scale averages over `memory` residuals (0 counts as 1) and is never below `floor` (> 0,
 * at most 2^100). Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER), or
 *   - a field of config is out of its range (the status names it). */
pvid_status pvid_gate_init_q31(pvid_gate_q31 *self, const pvid_gate_config_q31 *config, uint32_t memory,
                               pvid_scaled_q31 floor);

/* Returns whether a residual is accepted, given its square, m >= 0, below 2^200. The first `memory` residuals are
 * accepted. */
bool pvid_gate_passes_q31(pvid_gate_q31 *self, pvid_scaled_q31 square);

/* As pvid_gate_passes_q31; PVID_GATE_OPENS: the mechanism has changed. Call only one of the two on a gate. */
pvid_gate_verdict pvid_gate_judge_q31(pvid_gate_q31 *self, pvid_scaled_q31 square);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/gate_state_q31.h"

#endif
