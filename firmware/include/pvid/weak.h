/* pvid/weak.h - identifies any compiled mechanism from its sensors: the weak form with Fourier modulating functions.
 *
 * A compiled model (`pvid model build`) has one or more kinds of rows, one for each equation:
 *
 *   sum_j theta_j(p) N_j = Y,     N_j, Y = sum_m D^m[channel]
 *
 * A channel is a function of the signals at one instant, or such a function times a running integral. Rows are
 * multiplied by K test functions sin^n(pi t/T) e^(2 pi i f t/T) over windows of T that overlap by half, and D^m moves
 * to the test function. Each test function is a sum of few exponentials: a window needs only these sums of a channel:
 *
 *   S_h = sum_k channel(t_k) e^(2 pi i h k / (2 hop)),   h = 0 .. H = K/2 + n/2,
 *
 * Each half of a window is summed once: S_h = A_h + (-1)^h B_h. Derivatives are factors (i omega_h)^m. The noise of the
 * S_h is independent, and its variance follows from p. The white rows of a window are the S_h divided by their standard
 * deviations, without the directions that no test function contains (src/weak/white_f32.c).
 *
 *   static pvid_weak_f32 identifier;
 *   if (pvid_weak_init_f32(&identifier, &config) != PVID_OK) ...     config: printed by `pvid model build`
 *   each tick:     reason = pvid_weak_step_f32(&identifier, sample);
 *   or each block: reason = pvid_weak_step_block_f32(&identifier, samples, 24);
 *   same context:  estimate = pvid_weak_estimate_f32(&identifier);
 *   other context: if (pvid_weak_read_f32(&identifier, &copy, &number) && (number > 0)) ...
 *
 * Never allocates. Every input is allowed: a sample that is not finite is rejected and restarts the windows; the sums
 * are kept. Call all functions of an object from one context, except pvid_weak_read_f32 (publication.h).
 */
#ifndef PVID_WEAK_H
#define PVID_WEAK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/estimator.h"
#include "pvid/gate.h"
#include "pvid/layout.h"
#include "pvid/trust.h"
#include "pvid/weak_parts.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- the model: generated, the same for every rig ---- */

/* A share of a column: += factor D^order[channel]. */
typedef struct {
    uint8_t channel;
    uint8_t order;
    uint8_t column; /* of its kind: theta's in order, then Y, then the nuisances */
    float factor;
} pvid_weak_term_f32;

typedef struct {
    uint8_t samples;    /* entries of the argument of step */
    uint8_t signals;    /* samples, and signals made of them: weak_parts.h */
    uint8_t jets;       /* inputs of `prepare`, the first inputs of `values` */
    uint8_t runs;       /* integrals since the start of the run: inputs of `values` after the jets */
    uint8_t signs;      /* arguments of sgn: inputs of `values` after the runs */
    uint8_t gains;      /* first results of `values` */
    uint8_t integrands; /* results of `values` after the gains */
    uint8_t channels;
    uint8_t kinds;
    const pvid_weak_signal *signal;   /* [signals] */
    const pvid_weak_jet *jet;         /* [jets] */
    const pvid_weak_channel *channel; /* [channels] */
    const pvid_weak_term_f32 *term;   /* [kind[kinds - 1].end] */
    const pvid_weak_kind *kind;       /* [kinds] */
    /* From the jets: the derivatives of the runs [runs], then the arguments of sgn [signs]. NULL if there are none. */
    void (*prepare)(const float jet[], float out[]);
    /* From jets, runs and signs: the gains, then the integrands. */
    void (*values)(const float in[], float out[]);
    /* The values of the summed channels, from the gains of a step, I^1 and I^2 of each integrand, and the time since
     * the start of the half [s]. */
    void (*form)(const float gain[], const float integral[], float t, float channel[]);
    const pvid_model_f32 *model; /* theta and C of all kinds */
} pvid_weak_model_f32;

/* ---- the design: tables for a rig ---- */

/* Steps of half a window for each one in which a sign may be in doubt. */
#define PVID_WEAK_DOUBT 20u

/* Compensator: gives a jet at a step from the block sums x of its signal (src/weak/weak_front_f32.c); with D = 1 x is
 * the signal. i = 1..half.
 *   even order:  x + sum_i w_i ((x_+i - x) + (x_-i - x)), without the leading x if the order is above 0
 *   odd order:   sum_i w_i (x_+i - x_-i) */
typedef struct {
    uint16_t half;        /* steps on either side; 0: x itself */
    const float *weights; /* [half], outwards, per second^order */
} pvid_weak_filter_f32;

/* A part of the variance D_h at harmonic h, in the rows of a kind, that the sensors' noise causes:
 * += factor theta_a theta_b omega_h^(2 power), with theta = -1 for the column of Y. */
typedef struct {
    uint8_t kind;
    uint8_t power;
    uint8_t a; /* columns of the kind, a <= b; pairs with a < b are counted once, with twice the factor */
    uint8_t b;
    float factor;
} pvid_weak_noise_f32;

typedef struct {
    const pvid_weak_model_f32 *model;
    uint8_t functions;  /* K, 4..PVID_MAX_FUNCTIONS: f = 0, then cosine and sine of f = 1, 2, ...; an even K
                           ends with a cosine */
    uint8_t power;      /* n of sin^n, even, at least 2 above the highest order of the terms, at most 8 */
    uint8_t decimation; /* D, ticks a step, 1..PVID_MAX_DECIMATION */
    uint16_t hop;       /* steps of half a window, a multiple of 8; 2 H < hop */
    const pvid_weak_filter_f32 *compensator; /* [jets] */
    const float *circle;                     /* [5 hop / 2] sin(pi j / hop): a turn and a quarter */
    const pvid_weak_noise_f32 *noise;        /* [n_noise] */
    uint16_t n_noise;
    const uint8_t *error_order;  /* [kinds] the equation error is the derivative of this order of white noise */
    const float *error_variance; /* [kinds] least variance of that noise at a step, >= 0; residuals raise it */
    const float *sign_width;     /* [signs] of the soft sign tanh(v / width); 0: the mean of sgn over a step */
    const float *sign_doubt; /* [signs] within -sign_doubt..sign_doubt the sign of v is in doubt, >= 0: a window with
                                a half in which one is for over a PVID_WEAK_DOUBT of the steps is dropped: the
                                mechanism sticks or creeps; NULL: no check */
    float overlap;           /* variance inflation by the noise that overlapping windows share, >= 1 */
} pvid_weak_design_f32;

/* ---- a second stage ---- */

struct pvid_refine_f32;
struct pvid_refine_config_f32;

/* Its functions: pvid_refiner_f32 of refine.h. The weak form calls them through this table alone: without a second
 * stage no code of it is linked. */
typedef struct {
    pvid_status (*init)(struct pvid_refine_f32 *self, const struct pvid_refine_config_f32 *config, size_t samples,
                        const float shared[]);
    pvid_reason (*step)(struct pvid_refine_f32 *self, const float sample[], const pvid_estimate_f32 *weak, bool busy);
    void (*gap)(struct pvid_refine_f32 *self);
    void (*freeze)(struct pvid_refine_f32 *self, bool frozen);
} pvid_weak_refiner_f32;

/* A refinement, with its storage. */
typedef struct {
    const pvid_weak_refiner_f32 *refiner; /* &pvid_refiner_f32 */
    struct pvid_refine_f32 *storage;      /* must outlive the identifier, whose init initialises it */
    const struct pvid_refine_config_f32 *config;
} pvid_weak_refine_f32;

/* ---- the configuration ---- */

typedef struct {
    float sample_rate_hz;               /* ticks per second [Hz], 1e-3..1e6 */
    const pvid_weak_design_f32 *design; /* must outlive the identifier, with its tables */
    const float *range;     /* [samples] a window with a larger absolute value is dropped, > 0; NULL: no check */
    const float *drive_min; /* [samples] a window with a half in which a sample has a smaller standard deviation is
                               dropped, >= 0: its sensor stands still; NULL: no check */
    bool compensation;      /* corrects the bias by the sensors' noise (errors in variables) */
    uint8_t iterations;     /* Gauss-Newton steps in each of the first eight windows, 1..PVID_MAX_ITERATIONS; then one.
                               Recommended: 2; with 1 a start that is 50 % off needs three or four windows more */
    pvid_estimator_config_f32 estimator; /* row_sd 1: rows are in standard deviations. init sets model, update_rate_hz,
                                            row_weight and correlation */
    pvid_trust_config_f32 trust;         /* conditions of publication */
    pvid_gate_config_f32 gate;           /* outlier gate on the residuals of a window, for each kind */
    const pvid_weak_refine_f32 *refine;  /* second stage, refine.h: gets every sample, each new estimate, gaps and
                                            freezes; must outlive the identifier. NULL: none */
} pvid_weak_config_f32;

/* State: detail/weak_state.h, not API. Only the functions below write to it. */
typedef struct pvid_weak_f32 pvid_weak_f32;

/* The init below, for an application with this word (layout.h). */
pvid_status pvid_weak_init_layout_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config, uint32_t layout);

/* Initialises `self`. *config is copied; design, range, drive_min and refine must outlive the identifier. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - library and application were compiled with different sizes (PVID_BAD_LAYOUT; *self is unchanged),
 *   - a field of config, design or model is out of its range (the status names it),
 *   - a table is NULL or contains a number that is not finite (PVID_BAD_DESIGN),
 *   - a window cannot be processed before the next one is complete (PVID_BAD_ITERATIONS), or
 *   - the init of config.refine fails, with its status. */
static inline pvid_status pvid_weak_init_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config)
{
    return pvid_weak_init_layout_f32(self, config, PVID_LAYOUT);
}

/* One tick: the samples [samples], taken at the same time, in the units of the model. Returns
 *   - PVID_WARMING_UP until the first window is complete,
 *   - PVID_REJECTED_NOT_FINITE if a sample is not finite, PVID_REJECTED_SATURATED if a row of the window exceeds
 *     its limit,
 *   - PVID_HELD_NOT_EXCITED or PVID_HELD_OUT_OF_RANGE when a window is dropped by drive_min or range,
 *     PVID_REJECTED_OUTLIER when the gate rejects its rows, PVID_HELD_FROZEN while frozen,
 *   - the reason of trust.h at the tick that completes a window's processing,
 *   - PVID_ACCUMULATED at all other ticks.
 * The work of a window is spread over the ticks of half a window; the work of a tick does not depend on the data. */
pvid_reason pvid_weak_step_f32(pvid_weak_f32 *self, const float sample[]);

/* So many ticks at once, of a buffer in the units of the model: samples [count][samples], tick by tick. The state is
 * then the same in every bit as behind as many calls of step. The first stage takes fewer instructions where the
 * samples are its signals (the pendulum on a Cortex-M4F a sixth); elsewhere it is the same work with one call. Returns
 * the reason of the last tick with a new estimate (PVID_UPDATED, PVID_MISFIT); if there is none, of the last one with a
 * reason other than PVID_ACCUMULATED and PVID_WARMING_UP; else of the last: a candidate of an earlier tick may be
 * hidden. count 0: nothing is done; PVID_ACCUMULATED or PVID_WARMING_UP. */
pvid_reason pvid_weak_step_block_f32(pvid_weak_f32 *self, const float samples[], uint32_t count);

/* The published estimate, for the context that calls step; the start before the first one. */
const pvid_estimate_f32 *pvid_weak_estimate_f32(const pvid_weak_f32 *self);

/* The estimate of the last window with its standard errors, published or not. It is new at the ticks that return
 * PVID_UPDATED, PVID_MISFIT or PVID_HELD_UNCERTAIN. All zeros before the first one; NULL if `self` is NULL. */
const pvid_estimate_f32 *pvid_weak_candidate_f32(const pvid_weak_f32 *self);

/* Copies the published estimate from any context, also while another one calls step (publication.h). *number:
 * estimates published so far, 0: *estimate is the start; may be NULL. Fails iff
 *   - an estimate was published during each of PVID_READ_ATTEMPTS attempts, or
 *   - `self` is not initialised.
 * On failure *estimate is undefined. */
bool pvid_weak_read_f32(const pvid_weak_f32 *self, pvid_estimate_f32 *estimate, uint32_t *number);

/* Call this when samples are missing: the windows restart, all other state is kept. */
void pvid_weak_gap_f32(pvid_weak_f32 *self);

/* Freezes the identifier (true) or resumes it (false). While frozen, whole windows are dropped with PVID_HELD_FROZEN; p
 * and the sums are kept without forgetting. Windows continue to fill, so that resuming is bumpless: the next window may
 * contain samples from before the resumption. */
void pvid_weak_freeze_f32(pvid_weak_f32 *self, bool frozen);

/* From now on `sample` is given less `shift` [its unit]: an angle that turns without end is given as counts about a
 * reference that follows it, and float32 keeps its resolution. Nothing is lost: whatever is stored of the sample moves,
 * and the sums of a window contain no constant. channel: that of the model which is the sample itself
 * (`pvid model build` prints it). Call it between two steps. Returns false and changes nothing iff
 *   - `self` is not initialised, has a second stage, or shift is not finite, or
 *   - the model has no such sample or channel, or a signal of the sample is not PVID_SIGNAL_SAMPLED, or
 *   - the channel has an integral or no gain, or occurs without a derivative.
 *
 * Not checked: `channel` must be the sample itself, and where the sample also occurs inside a gain, an integrand or a
 * sign, `shift` must leave that unchanged (2 pi in a sine).
 *
 * Cost: 30 operations a harmonic. Source: src/weak/rebase_f32.c. */
bool pvid_weak_rebase_f32(pvid_weak_f32 *self, uint8_t sample, uint8_t channel, float shift);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/weak_state.h"

#endif
