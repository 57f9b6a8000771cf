/* pvid/strong.h - identifies a pendulum by the paper's strong form in float32: samples in, parameters out.
 *
 * A bank of derivative filters for phi and y_A, the row of the strong form, the estimator of estimator.h for its three
 * parameters. The angle is differentiated four times, which needs a sensor of about 20 bits; weak.h needs 14.
 *
 * How often p is solved for, and at what cost, follows from two fields (instructions a tick in the mean and of the
 * longest tick: host/docs/benchmarks/cost.md):
 *
 *   divider 1, exact_every 1: S = C^T M C and F from all sums at every row; the paper's law (5) literally
 *   divider 1, exact_every 8: a solve at every row; S and F come from all sums at every eighth row. In between, each
 *                             row adds the square of its gradient to S, and F is the innovation of the row
 *   divider 8:                a solve at every eighth row; the projection, the solve and the folding of the sums are
 *                             done at different rows. The same for all multiples of 4 from 8 to 64, without a dead
 *                             zone; any other divider above 1 does the whole solve in one row
 *
 *   static pvid_strong_f32 identifier;
 *   static pvid_strong_config_f32 config = { .sample_rate_hz = 1000.0f, .l1 = 0.3f, .bank = ... };
 *   config.estimator = pvid_estimator_defaults_f32; ...
 *   if (pvid_strong_init_f32(&identifier, &config) != PVID_OK) ...
 *   each tick: reason = pvid_strong_step_f32(&identifier, phi, y);
 *
 * The identifier does not copy its configuration: the configuration must outlive the identifier, unchanged. A constant
 * one, as `pvid tables --form strong` prints it, takes no RAM.
 *
 * Never allocates; every input is allowed. Call all functions of an object from one context; publication.h passes
 * estimates to other contexts. RAM: sizeof(pvid_strong_f32), mostly the windows.
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
    pvid_fir_bank_f32 bank;    /* filters of both channels */
    pvid_gate_config_f32 gate; /* outlier gate on the innovation of a row */
    uint16_t exact_every;      /* rows from one exact projection to the next if divider is 1, 1..255; 0: 8, with the law
                                  pseudovelocity or a dead zone 1 */
    pvid_estimator_config_f32 estimator; /* model, update_rate_hz, noise_margin and row_weight are not used */
} pvid_strong_config_f32;

/* State: detail/strong_state.h, not API. Only the functions below write to it. */
typedef struct pvid_strong_f32 pvid_strong_f32;
typedef struct pvid_strong_estimator_f32 pvid_strong_estimator_f32;

/* Initialises `self`. config and its tables must outlive the identifier, unchanged. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER), or
 *   - a field of config is out of its range (the status names it). */
pvid_status pvid_strong_init_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config);

/* One tick: phi [rad] and y_A [m], sampled at the same time. Returns
 *   - PVID_WARMING_UP until the windows are full, PVID_ACCUMULATED within a block of samples,
 *   - PVID_REJECTED_NOT_FINITE for a sample that is not finite: it restarts the windows, the sums are kept,
 *   - PVID_HELD_NOT_EXCITED without drive: the noise of a resting sensor, differentiated four times, would look
 *     like motion,
 *   - PVID_REJECTED_OUTLIER for a row that the gate rejects, PVID_HELD_FROZEN while frozen,
 *   - PVID_MISFIT instead of PVID_UPDATED during the alarm of misfit.h: do not trust the estimate,
 *   - otherwise the estimator's reason. */
pvid_reason pvid_strong_step_f32(pvid_strong_f32 *self, float phi, float y);

/* The same for a row from derivatives of your own: phi, phi', .. phi'''' [rad/s^k] and u = y_A''/l1, u', u'' [1/s^2 ..]
 * of the same instant. The windows and the drive are not used. Returns the reasons of a row. */
pvid_reason pvid_strong_row_step_f32(pvid_strong_f32 *self, const float phi[PVID_ORDERS], const float u[3]);

/* Standard errors, kappa and residual of the present p, as pvid_estimator_assess_f32. Cost: about two solves. */
void pvid_strong_assess_f32(const pvid_strong_f32 *self, pvid_estimate_f32 *estimate);

/* Writes the values of the sums of M, B, Y^2 and the weight, sums[58], without the rows of an unfinished block. */
void pvid_strong_read_sums_f32(const pvid_strong_f32 *self, float sums[]);

/* The running hash of fnv.h for this estimator: continues hash after a tick with this reason. */
uint32_t pvid_fnv_strong_f32(uint32_t hash, const pvid_strong_estimator_f32 *estimator, pvid_reason reason);

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
