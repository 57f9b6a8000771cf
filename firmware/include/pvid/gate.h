/* pvid/gate.h - rejects outliers: jolts, stuck or jumping sensors, wrong samples.
 *
 * A residual is compared with the usual size before its row or window is added. In the strong form it is a row's
 * squared innovation; in the weak form the mean over a window's rows, relative to the sensors' noise. Beyond
 * `sigmas` times the usual size the row or window is dropped: p and the sums are unchanged, and the tick returns
 * PVID_REJECTED_OUTLIER.
 *
 * The usual size is the running mean square of accepted residuals; outliers do not contribute. Each outlier widens
 * it slightly (squares: by 10^4 within patience_s), so that a changed mechanism is accepted after `patience_s`, or
 * never. A residual that is accepted only because outliers have widened the scale means that the mechanism has changed:
 * the weak form then begins its sums anew, for old and new rows together fit no p.
 *
 * Enabled by default in rig files, except for the paper's law (5); a zeroed configuration disables it. Every input
 * is allowed. Cost: one comparison and one division per residual.
 */
#ifndef PVID_GATE_H
#define PVID_GATE_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/detail/gate_verdict.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float sigmas;     /* largest residual [multiples of the usual size], 2..1e3; 0: no gate */
    float patience_s; /* time after which a changed mechanism is accepted [s], 0..1e12; 0: never */
} pvid_gate_config_f32;

/* State: detail/gate_state.h, not API. Only the functions below write to it. */
typedef struct pvid_gate_f32 pvid_gate_f32;

/* Initialises `self` for residuals at rate_hz [Hz]; the scale averages over `memory` (>= 1) of them and is never
 * below `floor` (> 0). Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER), or
 *   - a field of config is out of its range (the status names it). */
pvid_status pvid_gate_init_f32(pvid_gate_f32 *self, const pvid_gate_config_f32 *config, float rate_hz, float memory,
                               float floor);

/* Returns whether a residual is accepted, given its square. The first `memory` residuals are accepted. NaN and
 * infinity pass: the estimator rejects them with their own reason. */
bool pvid_gate_passes_f32(pvid_gate_f32 *self, float square);

/* As pvid_gate_passes_f32; PVID_GATE_OPENS: the mechanism has changed. Call only one of the two on a gate. */
pvid_gate_verdict pvid_gate_judge_f32(pvid_gate_f32 *self, float square);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/gate_state.h"

#endif
