/* pvid/gate_q31.h - keeps what does not fit out of the sums: gate.h in integers alone.
 *
 * The same rule, the same robust scale, the same patience: see there. Squares of residuals span more
 * than any fixed point holds, so they are weighed as numbers of 30 digits with an exponent; the scale is one, too.
 * Total and bounded: some ten shifts and products a residual.
 */
#ifndef PVID_GATE_Q31_H
#define PVID_GATE_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/estimator_q31.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    uint32_t sigmas;          /* largest residual [times the usual size], Q16: 2..1000; 0: no gate */
    uint32_t patience_groups; /* rows (strong form) or windows (weak form) until a changed mechanism is believed,
                                 1..2^30; 0: never */
} pvid_gate_config_q31;

/* State: detail/gate_state_q31.h. Only the functions below write to it. */
typedef struct pvid_gate_q31 pvid_gate_q31;

/* Prepares `self` for residuals of which the scale remembers `memory` (0 counts as 1) and whose mean square is never
 * taken to be below `floor` (> 0, at most 2^100). Fails iff a field of config is not as described there; the status
 * names it. */
pvid_status pvid_gate_init_q31(pvid_gate_q31 *self, const pvid_gate_config_q31 *config, uint32_t memory,
                               pvid_scaled_q31 floor);

/* Whether a residual may be taken in, by its square: m >= 0, below 2^200. The first `memory` ones may. */
bool pvid_gate_passes_q31(pvid_gate_q31 *self, pvid_scaled_q31 square);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/gate_state_q31.h"

#endif
