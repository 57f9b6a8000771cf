/* pvid/strong.h - identifies a pendulum by the paper's strong form in float32: samples in, parameters out.
 *
 * Two differentiators (phi and y_A, same bank, same delay), the row of the strong form, the estimator: one row and
 * one solve per tick. The angle is differentiated four times, which needs a sensor of about 20 bits; weak.h needs
 * 14.
 *
 *   static pvid_strong_f32 identifier;
 *   pvid_strong_config_f32 config = { .sample_rate_hz = 1000.0f, .l1 = 0.3f, .bank = ...,
 *                                     .estimator = pvid_estimator_defaults_f32 };
 *   if (pvid_strong_init_f32(&identifier, &config) != PVID_OK) ...
 *   each tick: reason = pvid_strong_step_f32(&identifier, phi, y);
 *
 * Never allocates; every input is allowed. Call all functions of an object from one context; publication.h passes
 * estimates to other contexts. RAM: sizeof(pvid_strong_f32), mostly the two windows.
 */
#ifndef PVID_STRONG_H
#define PVID_STRONG_H

#include "pvid/differentiator.h"
#include "pvid/estimator.h"
#include "pvid/gate.h"
#include "pvid/mechanism.h"
#include "pvid/misfit.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float sample_rate_hz; /* sample rate [Hz], 1e-3..1e6 */
    float l1;             /* length of rod 1 [m], > 0 */
    float drive_min; /* least rms of u = y_A''/l1 over the last second [1/s^2], >= 0: with less drive no row is used.
                        Choose ten times the noise of u. 0: every row is used */
    pvid_fir_bank_f32 bank;              /* filters of both channels; the weights must outlive the identifier */
    pvid_gate_config_f32 gate;           /* outlier gate on the innovation of a row */
    pvid_estimator_config_f32 estimator; /* init sets model and update_rate_hz */
} pvid_strong_config_f32;

/* State: detail/strong_state.h, not API. Only the functions below write to it. */
typedef struct pvid_strong_f32 pvid_strong_f32;

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER), or
 *   - a field of config is out of its range (the status names it). */
pvid_status pvid_strong_init_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config);

/* One tick: phi [rad] and y_A [m], sampled at the same time. Returns
 *   - PVID_WARMING_UP until the windows are full,
 *   - PVID_REJECTED_NOT_FINITE for a sample that is not finite: it restarts the windows, the sums are kept,
 *   - PVID_HELD_NOT_EXCITED without drive: the noise of a resting sensor, differentiated four times, would look
 *     like motion,
 *   - PVID_REJECTED_OUTLIER for a row that the gate rejects, PVID_HELD_FROZEN while frozen,
 *   - PVID_MISFIT instead of PVID_UPDATED during the alarm of misfit.h: do not trust the estimate,
 *   - else the estimator's reason. */
pvid_reason pvid_strong_step_f32(pvid_strong_f32 *self, float phi, float y);

/* Call this when samples are missing: the windows restart, all other state is kept. */
void pvid_strong_gap_f32(pvid_strong_f32 *self);

/* Freezes the identifier (true) or resumes it (false). While frozen, ticks with a row return PVID_HELD_FROZEN; p
 * and the sums are kept without forgetting. The differentiators continue, so that resuming is bumpless. */
void pvid_strong_freeze_f32(pvid_strong_f32 *self, bool frozen);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/strong_state.h"

#endif
