/* pvid/weak.h - identifies a pendulum from an encoder and the pivot's height: the weak form in float32.
 *
 * Multiplies the equation of motion by K test functions (modulating functions) over a window of about a second and
 * integrates by parts (theory.md 5). No derivative of the angle remains, only y_A'' of the pivot, so
 * that a 14-bit encoder suffices. Each window gives K rows (Y, N) for the estimator. The strong form
 * differentiates the angle four times and needs 20 bits.
 *
 *   static pvid_weak_f32 identifier;
 *   pvid_weak_config_f32 config = { .sample_rate_hz = 1000.0f, .l1 = 0.3f, .design = &table,
 *                                   .zero_unknown = true, .iterations = 3,
 *                                   .estimator = pvid_estimator_defaults_f32,
 *                                   .trust = pvid_trust_defaults_f32 };
 *   if (pvid_weak_init_f32(&identifier, &config) != PVID_OK) ...
 *   each tick:     reason = pvid_weak_step_f32(&identifier, phi, y);
 *   same context:  estimate = pvid_weak_estimate_f32(&identifier);
 *   other context: if (pvid_weak_read_f32(&identifier, &copy, &number) && (number > 0)) ...
 *
 * Never allocates. Every input is allowed: a sample that is not finite is rejected and restarts the windows; the
 * sums are kept. Call all functions of an object from one context, except pvid_weak_read_f32 (publication.h). RAM:
 * sizeof(pvid_weak_f32); the tables stay in flash.
 *
 * Schedule. Samples are smoothed over `taps` and decimated by D. Two windows of W decimated samples overlap by
 * half; every H = (W - 1) / 2 decimated samples one of them is complete. In a block of D ticks the first half
 * smooths, a part of the taps per tick; the second half adds the result to the windows, a part of the functions
 * per tick. In the first half the last complete window is also processed, one stage per tick: rows, Gauss-Newton
 * steps, assessment, publication. The longest tick costs about 3 times the mean tick for K <= 12, 4 times for K =
 * 16. If H has fewer free ticks than stages, a tick runs `stages_per_tick` stages and is longer by this factor.
 * The work of a tick depends on its place in the schedule, not on the data, except that a dropped window is not
 * processed.
 *
 * The first window in use sets c to its mean phi: the encoder's offset may be large.
 */
#ifndef PVID_WEAK_H
#define PVID_WEAK_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/estimator.h"
#include "pvid/gate.h"
#include "pvid/mechanism.h"
#include "pvid/trust.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The tables of a design: constant data from `pvid tables`, kept by reference.
 *
 * The test functions chi_k and their first three derivatives vanish at both ends of the window; therefore the
 * first and the last row of chi are not read. The functions are combined such that their residual filters chi''''
 * + d1 w chi'' + d2 w^2 chi are orthonormal at a nominal p; the Gram tables make them orthonormal at the present
 * p. */
typedef struct {
    uint16_t taps;       /* smoothing filter [samples], odd, 5..PVID_MAX_TAPS */
    uint16_t decimation; /* D, 1..PVID_MAX_DECIMATION */
    uint16_t window;     /* W [decimated samples], odd, 9..PVID_MAX_WEAK_WINDOW */
    uint8_t functions;   /* K, 4..PVID_MAX_FUNCTIONS */
    const float *smooth; /* [(taps - 1) / 2] weights of the value, folded as in differentiator.h: x0 + sum w q_i */
    const float *second; /* [(taps - 1) / 2] weights of the second derivative per sample^2, folded: sum w q_i */
    const float *chi;    /* [W][3][K] chi, chi'' [1/s^2], chi'''' [1/s^4] at the window's samples */
    const float *gram;   /* [6][K (K + 1) / 2] lower triangles by rows: G44, G42 + G24, G40 + G04, G22,
                            G20 + G02, G00 with G_ij = sum over samples of chi^(i) chi^(j)^T */
    float overlap;       /* variance inflation by the noise that overlapping windows share, >= 1 */
    uint8_t lag; /* decimated samples between the three samples of the curvature for the misfit alarm, 1..255: a sixth
                    of the fast mode's period */
} pvid_weak_design_f32;

typedef struct pvid_weak_angle_f32 pvid_weak_angle_f32;

typedef struct {
    float sample_rate_hz; /* sample rate [Hz], 1e-3..1e6 */
    float l1;             /* length of rod 1 [m], > 0 */
    float drive_min; /* least rms of u = y_A''/l1 about its mean in a window [1/s^2], >= 0: a window with less drive is
                        dropped. Choose ten times the noise of u. 0: every window is used */
    float pivot_noise; /* variance of a row by the pivot sensor's noise per (rad/s^2)^2 of mean square phi'' [s^4], >=
                          0; used by the misfit alarm. 0: exact pivot */
    float angle_limit; /* largest |phi - c| in a window [rad], >= 0: a window beyond it is dropped. 0: no limit */
    const pvid_weak_design_f32 *design; /* must outlive the identifier, with its tables */
    pvid_weak_angle_f32
        *angle;         /* memory for full_angle and friction, must outlive the identifier; NULL if both are false */
    bool full_angle;    /* correct the rows for sin and cos once the estimate has converged; set angle_limit to 0.2 rad,
                           the limit of its accuracy */
    bool friction;      /* p = (w, d1, d2, c, c1, c2): two viscous friction coefficients, nuisance parameters. Needs
                           zero_unknown, PVID_MAX_P 6 and PVID_MAX_MOMENTS 55 */
    uint8_t passes;     /* iterations of the correction per window, 1..PVID_MAX_PASSES; recommended: 3 */
    bool zero_unknown;  /* true: p = (w, d1, d2, c), c [rad] the encoder's reading at rest; false: c = 0 */
    uint8_t iterations; /* Gauss-Newton steps per window, 1..PVID_MAX_ITERATIONS; recommended: 3. Always 1 if g < 1 */
    pvid_estimator_config_f32 estimator; /* one group of rows per window; row_sd [rad] is the noise of a decimated
                                            sample. init sets model, update_rate_hz, row_weight and correlation */
    pvid_trust_config_f32 trust;         /* conditions of publication */
    pvid_gate_config_f32 gate;           /* outlier gate on the residuals of a window */
} pvid_weak_config_f32;

/* State: detail/weak_state.h, not API. Only the functions below write to it. */
typedef struct pvid_weak_f32 pvid_weak_f32;

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - a field of config or design is out of its range (the status names it),
 *   - a table is NULL or contains a number that is not finite (PVID_BAD_DESIGN), or
 *   - a window cannot be processed before the next one is complete (PVID_BAD_ITERATIONS).
 * A window has H D / 2 free ticks, at least one per sample, and needs at most 10 K + 35 stages, 19 per
 * Gauss-Newton step and K / 6 + W / 4 + 3 per pass of the correction. A tick runs 1..32 stages. */
pvid_status pvid_weak_init_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config);

/* One tick: phi [rad] and y_A [m], sampled at the same time. Returns
 *   - PVID_WARMING_UP until the first window is complete,
 *   - PVID_REJECTED_NOT_FINITE if a sample is not finite, PVID_REJECTED_SATURATED if a row of the window exceeds
 *     its limit,
 *   - PVID_HELD_NOT_EXCITED or PVID_HELD_OUT_OF_RANGE when a window is dropped for too little drive or too large
 *     an angle, PVID_REJECTED_OUTLIER when the gate rejects it, PVID_HELD_FROZEN while frozen,
 *   - the reason of trust.h at the tick that completes a window's processing,
 *   - PVID_ACCUMULATED at all other ticks. */
pvid_reason pvid_weak_step_f32(pvid_weak_f32 *self, float phi, float y);

/* The published estimate, for the context that calls step: the last trusted estimate, or the start before the
 * first one (then self->trust.published is false). Count the ticks since PVID_UPDATED or PVID_MISFIT to know its
 * age. */
const pvid_estimate_f32 *pvid_weak_estimate_f32(const pvid_weak_f32 *self);

/* Copies the published estimate from any context, also while another one calls step (publication.h). *number:
 * estimates published so far, 0: *estimate is the start; may be NULL. Fails iff
 *   - an estimate was published during each of PVID_READ_ATTEMPTS attempts, or
 *   - `self` is not initialised.
 * On failure *estimate is undefined. */
bool pvid_weak_read_f32(const pvid_weak_f32 *self, pvid_estimate_f32 *estimate, uint32_t *number);

/* Call this when samples are missing: the windows restart, all other state is kept. */
void pvid_weak_gap_f32(pvid_weak_f32 *self);

/* Freezes the identifier (true) or resumes it (false). While frozen, complete windows are dropped with
 * PVID_HELD_FROZEN; p and the sums are kept without forgetting. The window in processing is finished within half a
 * window. Windows continue to fill, so that resuming is bumpless: the next window is complete after at most half a
 * window, and may contain samples from before the resumption. */
void pvid_weak_freeze_f32(pvid_weak_f32 *self, bool frozen);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/full_angle_state.h"
#include "pvid/detail/weak_state.h"

#endif
