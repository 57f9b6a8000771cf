/* pvid/refine.h - refines an estimate of the weak form to the statistical limit: the full equations, any angle.
 *
 * The weak form converges from any start, but its equation is approximate: it has no large angles, no friction, no skew
 * of the sensors. This stage starts at its estimate and fits the full equations of the model to blocks of samples, each
 * about two slow periods long:
 *
 *   - A block is integrated from a start of its own, with the derivatives of the motion with respect to start and
 *     parameters.
 *   - Cholesky eliminates the start. The information on the parameters is added to a square-root triangle, which is
 *     kept from block to block and forgets (forgetting_s).
 *   - Search: short blocks that grow, with the weak form's estimate as prior, until one fits. Then track.
 *   - A single wild sample (interference, a flipped bit) is left out of the block before (outlier_gate).
 *   - A block is accepted if its residuals, its clash with the past and its last step are small enough, relative to the
 *     best of the last blocks. After two refused blocks in a row the search begins again.
 *   - After an accepted block the past is given up if the information of both depends on the point of linearisation:
 *     if the square root of its determinant after the block's last pass is more than 2 times, or less than half, of
 *     that after its first pass. Which combination of parameters a short block hardly determines depends on that
 *     point; the information of two such blocks appears to determine all of them, and the estimate may stay wrong with
 *     small standard errors. The triangle, with the block, is then multiplied by 1/16, and the estimate is withdrawn.
 *     (Without this check: longer blocks that begin with samples already used; models with dry friction, whose prior
 *     is at most 10 standard errors of the weak form wide.)
 *
 *   static pvid_refine_f32 refinement;
 *   static const pvid_weak_refine_f32 second = {&pvid_refiner_f32, &refinement, &refine_config};
 *   config.refine = &second;
 *   if (pvid_weak_init_f32(&identifier, &config) != PVID_OK) ...
 *   each tick:     reason = pvid_weak_step_f32(&identifier, sample);          both stages
 *   same context:  stage = pvid_refine_best_f32(&refinement, pvid_weak_estimate_f32(&identifier), &estimate);
 *   other context: pvid_publication_put_f32 of that estimate (publication.h), or
 *                  if (pvid_refine_read_f32(&refinement, &copy, &number) && (number > 0)) ...
 *
 * With dry friction sgn(x) is replaced by x / (x^4 + width^4)^(1/4). Steps in which x may change its sign are divided
 * more finely. The widths are the first entries of r; each block has its own, and an estimate is published however
 * uncertain they are.
 *
 * Where an input is measured (PVID_REFINE_OBSERVER), its noise moves the model. An observer follows the outputs within
 * a block, so that the errors of blocks are those of the noise.
 *
 * The model is refine_shape.h of the mechanism, chosen at build time. Never allocates. The work is divided into jobs; a
 * tick does a few of them, so its time is bounded. A tick in which the weak form is busy does none, but no more than
 * `rests` ticks in a row do none.
 */
#ifndef PVID_REFINE_H
#define PVID_REFINE_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/estimator.h"
#include "pvid/refine_shape.h"
#include "pvid/weak.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The filter of second derivatives: steps on each side. RAM: 16 bytes each. */
#ifndef PVID_REFINE_HALF
#define PVID_REFINE_HALF 12
#endif
#define PVID_REFINE_STATES (PVID_REFINE_ORDER * PVID_REFINE_COORDINATES)
#define PVID_REFINE_LATE 3 /* steps until the gate of wild samples has judged one */
#define PVID_REFINE_LINE (2 * ((2 * PVID_REFINE_HALF) + 1 + PVID_REFINE_LATE))

/* An input or an output of the model. */
typedef struct {
    uint8_t sample; /* entry of the argument of step */
    int8_t order;   /* 0: the sample; of an input also 2: its second derivative, -1: its integral since init */
    uint8_t source; /* PVID_SIGNAL_SAMPLED, or of an input PVID_SIGNAL_HELD (weak_parts.h) */
    float scale;    /* factor to the model's unit */
    float range; /* largest absolute value [model's unit], > 0: it is kept in 16 bits. An output beyond it is missing;
                    after an input beyond it a new block begins, as after a gap. Of an output that turns
                    (pvid_refine_turning) half of the interval modulo which it is kept */
} pvid_refine_signal_f32;

typedef struct pvid_refine_config_f32 {
    float sample_rate_hz; /* ticks per second [Hz], 1e-3..1e6 */
    uint8_t ratio;        /* ticks a step of the motion, 1..255; the design takes at most 1/48 of the fastest period
                             (with PVID_REFINE_RUNGE_KUTTA a part of a step at most 1/25); init does not check it */
    const float *second;  /* [PVID_REFINE_HALF + 1] weights of second derivatives, centre first [1/s^2]; NULL: no
                             signal has order 2. Must outlive the object */
    const pvid_refine_signal_f32 *signal; /* [inputs + outputs]; must outlive the object */
    uint16_t block;                       /* big steps (4 steps) of a full block, about two slow periods, 8..ring / 6 */
    uint16_t first_block;                 /* of the first block of a search, 8..block; recommended: block / 4 */
    uint8_t passes;      /* least passes over a block, 1..most_passes; in the track one pass suffices if its step is
                            below step_max / 4; recommended: 2 */
    uint8_t most_passes; /* most passes over a block, 1..16, if its steps do not become small; recommended: 8 */
    uint8_t jobs;  /* jobs of a pass in one tick, 1..128; recommended: 3 with a floating-point unit, 1 without; with
                      Runge-Kutta those of the design: with fewer, blocks are lost before they are fitted */
    uint8_t rests; /* most ticks in a row without jobs because the weak form is busy, 0..255. 255 makes the
                      longest tick short where the weak form is seldom busy, as the pendulum's is; otherwise 1 */
    float sd[PVID_REFINE_OUTPUTS];          /* of the noise of a row, at low frequencies [unit of the output], > 0 */
    float prior_sd[PVID_REFINE_PARAMETERS]; /* of the weak form's estimate, in the search; relative if logarithmic;
                                               with signs 10 of its standard errors at most */
#if PVID_REFINE_RUNGE_KUTTA
    uint8_t parts;      /* equal parts of a step, each of two jobs, 1..64 */
    uint8_t fine_parts; /* of a step in which a sign may change, parts..64 */
#endif
#if PVID_REFINE_OBSERVER
    float observer[PVID_REFINE_OUTPUTS * PVID_REFINE_STATES]; /* correction of the states at the end of a big step by a
                                                                 row of each output, -1e9..1e9 [state / first output];
                                                                 0: none */
#endif
#if PVID_REFINE_WIDTHS > 0
    float width[PVID_REFINE_WIDTHS]; /* where the widths of the signs start [unit of the sign's argument],
                                        1e-9..1e9; they do not fall below a quarter of this */
#endif
    float state_limit[PVID_REFINE_STATES]; /* largest |start| of a block: coordinates, then their rates, > 0 */
    float forgetting_s;                    /* time constant of the triangle [s], > 0; 0: it does not forget */
    float outlier_gate; /* means of `ratio` samples of an output, or of an input of order 2, that stand out by more than
                           this multiple of the usual are replaced, 2..1e3; 0: no gate; recommended: 4 */
    float gate;         /* in the track, rows with a larger residual are left out [standard deviations], as a rule
                           not in the first two passes after a single block; 0: no gate */
    float chi_max;      /* limit of a block's mean square of residuals, relative to the level, > 1; recommended: 3 */
    float clash_max;    /* limit of its clash with the past, relative to the level, > 1; recommended: 25 */
    float step_max;     /* limit of its last step [prior_sd], > 0; recommended: 0.02 */
#if PVID_REFINE_SIGNS > 0
    float step_fine; /* the same behind the second block, > 0; recommended: a twentieth of step_max, or step_max where
                        coordinates are hidden and no observer follows them */
#endif
    float step_limit; /* longest step of a pass [prior_sd], > 0; prior_sd of a logarithm times it is 1.8 at most;
                         recommended: 2 */
    float se_max;     /* largest relative standard error of a published estimate, without the shared errors, > 0 */
    float distance;   /* relative distance from the weak form's estimate that the bias of its equations explains, >= 0.
                         0: the weak form has the same equations; an estimate is then published only if the geometric
                         mean of its standard errors is below that of the weak form */
} pvid_refine_config_f32;

/* An estimate; all numbers are finite. */
typedef struct {
    float r[PVID_REFINE_PARAMETERS];
    float se[PVID_REFINE_PARAMETERS];                                 /* standard errors [units of r] */
    float covariance[PVID_REFINE_PARAMETERS][PVID_REFINE_PARAMETERS]; /* of the steps of r: relative if logarithmic */
    float level; /* residual variance over its expectation from the sensors' noise */
    float clash; /* squared difference of the blocks from their past, over its expectation from that noise: of the last
                    blocks, or of all weighted by what they add to the information, whichever is larger. The standard
                    errors contain the root of the larger one of level and clash. Well above 1: the equations lack
                    something. A block that is refused in the track counts as clash_max times the level */
} pvid_refine_estimate_f32;

/* Whose estimate is published. */
typedef enum { PVID_STAGE_WEAK, PVID_STAGE_REFINED } pvid_stage;

/* State: detail/refine_state.h, not API. Only the functions below write to it. */
typedef struct pvid_refine_f32 pvid_refine_f32;

/* Table of init, step, gap and freeze for the configuration of the weak form, which then calls them. The application
 * calls only best, latest, read and reason. Its linker symbol contains the mechanism (refine_shape.h): an application
 * with the refinement of another one does not link. Sizes: layout.h. */
#define PVID_REFINED_AS(name, id) name##_model##id
#define PVID_REFINED(name, id) PVID_REFINED_AS(name, id)
#define pvid_refiner_f32 PVID_REFINED(pvid_refiner_f32, PVID_REFINE_MODEL_ID)
extern const pvid_weak_refiner_f32 pvid_refiner_f32;

/* Initialises `self`. samples: in the argument of step. shared: errors that all windows share, of trust.h, which are
 * added to those of published estimates; must outlive `self`; NULL: none. Fails iff
 *   - `self` or `config` is NULL (PVID_BAD_POINTER),
 *   - a field of config is out of its range (the status names it), or
 *   - a number of `shared` is out of its range, or the library is compiled with PVID_SHARED = 0 (PVID_BAD_SHARED). */
pvid_status pvid_refine_init_f32(pvid_refine_f32 *self, const pvid_refine_config_f32 *config, size_t samples,
                                 const float shared[]);

/* One tick.
 *   sample:  the samples of signal[].sample, taken at the same time
 *   weak:    the estimate of the weak form, its standard errors without the shared ones, published or not, if it is
 *            new at this tick; else NULL
 *   busy:    the weak form's tick was long
 * Returns
 *   - PVID_WARMING_UP until there is an estimate of the weak form,
 *   - PVID_REJECTED_NOT_FINITE if a sample of an input is not finite, at the end of its step: the block restarts.
 *     (An output that is not finite is a missing row.)
 *   - PVID_HELD_FROZEN while frozen,
 *   - at the end of a block PVID_UPDATED if an estimate was published, else PVID_HELD_SEARCHING (no block fits yet),
 *     PVID_HELD_BLOCK (the block does not fit its past), PVID_HELD_UNCERTAIN (standard errors too large, one block
 *     alone, or the past was given up), or PVID_HELD_DISAGREES (the estimate differs from the weak form's by more than
 *     the errors of both),
 *   - PVID_ACCUMULATED at all other ticks. */
pvid_reason pvid_refine_step_f32(pvid_refine_f32 *self, const float sample[], const pvid_estimate_f32 *weak, bool busy);

/* The published estimate, for the context that calls step; NULL: there is none. It stands until the next one, unless it
 * is withdrawn: when the track is lost (two blocks in a row do not fit their past), when a block's estimate is too
 * uncertain or disagrees with the weak form's, or when the past is given up. The next one may be published many blocks
 * later. */
const pvid_refine_estimate_f32 *pvid_refine_latest_f32(const pvid_refine_f32 *self);

/* The outcome of the last block: the reason that step returned at its end. PVID_WARMING_UP before the first one,
 * PVID_NOT_READY without init. */
pvid_reason pvid_refine_reason_f32(const pvid_refine_f32 *self);

/* The better one of the two published estimates, for the context that calls step. *estimate is a copy of `weak`, the
 * published estimate of the weak form; while an estimate of the refinement stands (see latest), p, standard errors and
 * covariance are those of the refinement. Returns the stage that they are from. pvid_refine_reason_f32 returns
 * PVID_UPDATED, or why the last block gave no new estimate. Without init it is the weak form's. Nothing is copied iff
 * `weak` or `estimate` is NULL. Cost: a copy of *weak and O(p^2). */
pvid_stage pvid_refine_best_f32(const pvid_refine_f32 *self, const pvid_estimate_f32 *weak,
                                pvid_estimate_f32 *estimate);

/* Copies the published estimate from any context (publication.h). *number: estimates published so far, 0: there is
 * none, or it was withdrawn; may be NULL. Fails iff
 *   - an estimate was published during each of PVID_READ_ATTEMPTS attempts, or
 *   - `self` is not initialised. */
bool pvid_refine_read_f32(const pvid_refine_f32 *self, pvid_refine_estimate_f32 *estimate, uint32_t *number);

/* Call this when samples are missing: the block restarts, the information on r is kept. */
void pvid_refine_gap_f32(pvid_refine_f32 *self);

/* Freezes the refinement (true) or resumes it (false). */
void pvid_refine_freeze_f32(pvid_refine_f32 *self, bool frozen);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/refine_state.h"

#endif
