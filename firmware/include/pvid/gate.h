/* pvid/gate.h - keeps what does not fit out of the sums: a jolt, a sensor that sticks or jumps, a wrong sample.
 *
 * Looks at residuals, squared (a row's innovation in the strong form; the mean over a window's rows, relative to what
 * the sensors' noise explains, in the weak form), before they are taken in. One that is larger than so many times
 * the usual size is an outlier: its row or window is left out, p and the sums stay, and the tick says so.
 *
 * The usual size is robust: the mean square of what passes, which follows downwards and upwards alike; outliers
 * do not count in it. But each of them widens it a little, so that a mechanism that has changed is let in again after
 * `patience_s`, or never, as you say. (In that time the scale of squares grows by 10^4.)
 *
 * A rig file has it on where it does not say, but in equation (5) (pvid_law), which is to stay as the paper has it; a
 * configuration of zeros has none. Total; one comparison, one division a residual.
 */
#ifndef PVID_GATE_H
#define PVID_GATE_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float sigmas;     /* largest residual [times the usual size], 2..1e3; 0: no gate */
    float patience_s; /* until a changed mechanism is believed [s], 0..1e12; 0: never */
} pvid_gate_config_f32;

/* State; only the functions below write to it. */
typedef struct {
    float limit;    /* sigmas^2; 0: no gate */
    float memory;   /* residuals that the scale remembers */
    float floor;    /* least scale */
    float widening; /* factor on the scale at an outlier */
    float judged;   /* residuals taken in; stops at memory */
    float scale;    /* mean square of what passed */
} pvid_gate_f32;

/* Prepares `self` for residuals that come at rate_hz, of which the scale remembers `memory` (at least 1) and whose mean
 * square is never taken to be below `floor` (> 0). Fails iff a field of config is not as described there; the status
 * names it. */
pvid_status pvid_gate_init_f32(pvid_gate_f32 *self, const pvid_gate_config_f32 *config, float rate_hz, float memory,
                               float floor);

/* Whether a residual may be taken in, by its square. The first `memory` ones may; so may what is no number or
 * infinite, which others refuse for what it is. */
bool pvid_gate_passes_f32(pvid_gate_f32 *self, float square);

#ifdef __cplusplus
}
#endif

#endif
