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
 * The strong form differentiates the angle four times: it needs a sensor of about 20 bits. Not
 * thread-safe. RAM: sizeof(pvid_strong_f32), mostly the two windows.
 */
#ifndef PVID_STRONG_H
#define PVID_STRONG_H

#include "pvid/differentiator.h"
#include "pvid/estimator.h"
#include "pvid/kapitza.h"

typedef struct {
    float sample_rate_hz;     /* 1e-3..1e6 */
    float l1;                 /* length of rod 1 [m], > 0 */
    pvid_fir_bank_f32 bank;   /* for both channels; the weights must outlive the identifier */
    pvid_estimator_config_f32 estimator; /* model and update_rate_hz are filled in by init */
} pvid_strong_config_f32;

typedef struct {
    pvid_differentiator_f32 phi;
    pvid_differentiator_f32 y;
    float inverse_l1; /* [1/m] */
    pvid_estimator_f32 estimator;
} pvid_strong_f32;

/* Prepares `self`. Fails iff a field of config is out of its range; the status names it. */
pvid_status pvid_strong_init_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config);

/* One tick: phi [rad] and y_A [m] sampled together. A sample that is not finite is rejected and
 * empties the windows (its neighbours are no longer equidistant); the sums keep what they know. */
pvid_reason pvid_strong_step_f32(pvid_strong_f32 *self, float phi, float y);

/* Tells the identifier that samples are missing: the windows start again, nothing else is lost. */
void pvid_strong_gap_f32(pvid_strong_f32 *self);

#endif
