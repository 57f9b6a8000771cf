/* pvid/strong.h - the paper's identifier, whole: samples in, parameters out.
 *
 * Two differentiators (phi and y_A, one bank, one delay), the strong-form row, the estimator.
 *
 *   static pvid_strong_f32 identifier;
 *   pvid_strong_config_f32 config = { .sample_rate_hz = 1000.0f, .l1 = 0.3f, .bank = ...,
 *                                     .estimator = pvid_estimator_defaults_f32 };
 *   if (pvid_strong_init_f32(&identifier, &config) != PVID_OK) ...
 *   each tick: reason = pvid_strong_step_f32(&identifier, phi, y);
 *
 * The strong form differentiates the angle four times: it needs a sensor of about 20 bits. Call all functions of an
 * object from one context; publication.h passes an estimate to other contexts.
 * RAM: sizeof(pvid_strong_f32), mostly the two windows.
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
    float sample_rate_hz;                /* 1e-3..1e6 */
    float l1;                            /* length of rod 1 [m], > 0 */
    float drive_min;                     /* rms of u = y_A''/l1 [1/s^2] over the last second below which the pivot
                                            counts as still and no row is taken in; some ten times the noise of u.
                                            0: every row is taken in */
    pvid_fir_bank_f32 bank;              /* for both channels; the weights must outlive the identifier */
    pvid_gate_config_f32 gate;           /* on the innovation of a row */
    pvid_estimator_config_f32 estimator; /* model and update_rate_hz are filled in by init */
} pvid_strong_config_f32;

/* State: detail/strong_state.h. Only the functions below write to it. */
typedef struct pvid_strong_f32 pvid_strong_f32;

/* Prepares `self`. Fails iff a field of config is out of its range; the status names it. */
pvid_status pvid_strong_init_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config);

/* One tick: phi [rad] and y_A [m] sampled together. Answers as the estimator does, PVID_WARMING_UP
 * until the windows are full, PVID_REJECTED_OUTLIER for a row that the gate kept out, PVID_MISFIT in place of
 * PVID_UPDATED while the rows leave more unexplained than they should (misfit.h: the estimate is not to be believed),
 * and PVID_HELD_NOT_EXCITED while the pivot is still: without a drive the noise of a still sensor, differentiated four
 * times, would pass for one. A sample that is not finite is rejected and empties the windows (its neighbours are no
 * longer equidistant); the sums keep what they know. */
pvid_reason pvid_strong_step_f32(pvid_strong_f32 *self, float phi, float y);

/* Tells the identifier that samples are missing: the windows start again, nothing else is lost. */
void pvid_strong_gap_f32(pvid_strong_f32 *self);

/* Freezes the identifier, or lets it go on. While it is frozen nothing is taken in: p and the sums stay, and nothing is
 * forgotten; the differentiators are kept filled, so that it goes on without a bump with the next sample. Ticks that
 * would have given a row return PVID_HELD_FROZEN. */
void pvid_strong_freeze_f32(pvid_strong_f32 *self, bool frozen);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/strong_state.h"

#endif
