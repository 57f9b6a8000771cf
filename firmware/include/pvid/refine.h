/* pvid/refine.h - refines an estimate of the weak form to the statistical limit: the full equations, any angle.
 *
 * The weak form converges from anywhere, but neglects what its equation does not contain (large angles, friction, a
 * skew of the sensors). Behind it this stage fits the full equations of the model to blocks of about two slow periods:
 *
 *   - a block is integrated from a start of its own, with the derivatives of the motion by start and parameters;
 *   - Cholesky eliminates the start; what remains joins a square-root triangle, which is carried and forgets in
 * seconds;
 *   - search: short blocks that grow, with the weak form's estimate as prior, until one fits; then track;
 *   - a block is taken if its residuals, its clash with the past and its last step are small enough, relative to the
 *     best of the last blocks; after two refusals in a row the search begins again.
 *
 *   static pvid_refine_f32 refinement;
 *   static const pvid_weak_refine_f32 second = {&pvid_refine_stage_f32, &refinement, &refine_config};
 *   config.refine = &second;
 *   if (pvid_weak_init_f32(&identifier, &config) != PVID_OK) ...
 *   each tick:     reason = pvid_weak_step_f32(&identifier, sample);          both stages
 *   same context:  estimate = pvid_refine_latest_f32(&refinement);               NULL: the weak form's stands
 *   other context: if (pvid_refine_read_f32(&refinement, &copy, &number) && (number > 0)) ...
 *
 * The model: refine_shape.h of the mechanism, chosen at build time. Never allocates. The work is spread over the ticks,
 * one job each; that of a tick is bounded (with the weak form 1 500 instructions on a Cortex-M4F for the pendulum). A
 * tick with a new estimate of the weak form has none, unless the tick before had such an estimate too.
 */
#ifndef PVID_REFINE_H
#define PVID_REFINE_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/estimator.h"
#include "pvid/weak.h"
#include "pvid/refine_shape.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Steps that the ring of signals holds, a power of two: at least 1.5 blocks. RAM: 2 bytes for each signal. */
#ifndef PVID_REFINE_RING
#define PVID_REFINE_RING 512
#endif

/* The filter of second derivatives: steps on each side. RAM: 16 bytes each. */
#ifndef PVID_REFINE_HALF
#define PVID_REFINE_HALF 12
#endif
#define PVID_REFINE_LINE (2 * ((2 * PVID_REFINE_HALF) + 1))

/* An input or an output of the model. */
typedef struct {
    uint8_t sample; /* entry of the argument of step */
    uint8_t order;  /* 0: the sample, 2: its second derivative (inputs alone) */
    uint8_t source; /* PVID_SIGNAL_SAMPLED, or of an input PVID_SIGNAL_HELD (weak_parts.h) */
    float scale;    /* factor to the model's unit */
    float range;    /* largest absolute value [model's unit], > 0: it is kept in 16 bits */
} pvid_refine_signal_f32;

typedef struct pvid_refine_config_f32 {
    float sample_rate_hz; /* ticks per second [Hz], 1e-3..1e6 */
    uint8_t ratio;        /* ticks of a step of the motion, 1..255. A step of 1/40 of the fastest period or less */
    const float *second;  /* [PVID_REFINE_HALF + 1] weights of second derivatives, centre first [1/s^2]; NULL: no
                             signal has order 2. Must outlive the object */
    const pvid_refine_signal_f32 *signal; /* [inputs + outputs]; must outlive the object */
    uint16_t block;                       /* big steps (4 steps) of a full block, about two slow periods, 8..ring / 6 */
    uint16_t first_block;                 /* of the first block of a search, 8..block; recommended: block / 4 */
    uint8_t passes;                       /* of a block, at least, 1..most_passes; recommended: 2 */
    uint8_t most_passes;                  /* of a block whose steps do not become small, 1..16; recommended: 8 */
    float sd[PVID_REFINE_OUTPUTS];        /* of the noise of a row, at low frequencies [unit of the output], > 0 */
    float prior_sd[PVID_REFINE_PARAMETERS]; /* of the weak form's estimate, in the search; relative if logarithmic */
    float gain_sd[PVID_REFINE_PARAMETERS];  /* errors of the steps by one error of a sensor's gain, with their signs */
    float state_limit[PVID_REFINE_ORDER *
                      PVID_REFINE_COORDINATES]; /* largest |start| of a block: coordinates, then their rates, > 0 */
    float forgetting_s;                         /* time constant of the triangle [s], > 0; 0: it does not forget */
    float gate;       /* rows with a larger residual are left out in track [standard deviations], 0: none */
    float chi_max;    /* limit of a block's mean square of residuals, relative to the level, > 1; recommended: 3 */
    float clash_max;  /* limit of its clash with the past, relative to the level, > 1; recommended: 25 */
    float step_max;   /* limit of its last step [prior_sd], > 0; recommended: 0.02 */
    float step_limit; /* longest step of a pass [prior_sd], > 0; prior_sd of a logarithm times it is 0.9 at most;
                         recommended: 2 */
    float se_max;     /* largest relative standard error of a published estimate, > 0 */
    float distance;   /* relative distance from the weak form's estimate that the bias of its equations allows, >= 0. 0:
                         they are the refinement's, and the geometric mean of the standard errors must be below its */
} pvid_refine_config_f32;

/* An estimate; all numbers are finite. */
typedef struct {
    float r[PVID_REFINE_PARAMETERS];
    float se[PVID_REFINE_PARAMETERS];                                 /* standard errors [units of r] */
    float covariance[PVID_REFINE_PARAMETERS][PVID_REFINE_PARAMETERS]; /* of the steps of r: relative if logarithmic */
    float level; /* residual variance over its expectation from the sensors' noise */
    float clash; /* square by which blocks differ from their past, over its expectation from that noise. The standard
                    errors contain the root of the larger one of the two; well above 1 the equations lack something. A
                    block that is refused in the track counts with clash_max times the level */
} pvid_refine_estimate_f32;

/* State: detail/refine_state.h, not API. Only the functions below write to it. */
typedef struct pvid_refine_f32 pvid_refine_f32;

/* The functions below, for the configuration of the weak form, which then calls them: only latest, read and
 * reason are left to the application. */
extern const pvid_weak_stage_f32 pvid_refine_stage_f32;

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER), or
 *   - a field of config is out of its range (the status names it). */
pvid_status pvid_refine_init_f32(pvid_refine_f32 *self, const pvid_refine_config_f32 *config);

/* One tick: the samples of signal[].sample, taken at the same time, and an estimate of the weak form that is new at
 * this tick, with its standard errors, whether the weak form trusts it already or not (NULL: none). Returns
 *   - PVID_WARMING_UP until there is an estimate of the weak form,
 *   - PVID_REJECTED_NOT_FINITE if a sample of an input is not finite, at the end of its step: the block restarts.
 *     (An output that is not finite is a missing row.)
 *   - PVID_HELD_FROZEN while frozen,
 *   - at the end of a block PVID_UPDATED if an estimate was published, else PVID_HELD_SEARCHING (no block fits yet),
 *     PVID_HELD_BLOCK (the block does not fit to its past), PVID_HELD_UNCERTAIN (standard errors, or one block alone)
 * or PVID_HELD_DISAGREES (the estimate differs from the weak form's beyond the errors of both),
 *   - PVID_ACCUMULATED at all other ticks. */
pvid_reason pvid_refine_step_f32(pvid_refine_f32 *self, const float sample[], const pvid_estimate_f32 *weak);

/* The published estimate, for the context that calls step; NULL before the first one. */
const pvid_refine_estimate_f32 *pvid_refine_latest_f32(const pvid_refine_f32 *self);

/* What the last block told: as step, at the end of a block. PVID_WARMING_UP before the first one, PVID_NOT_READY
 * without init. */
pvid_reason pvid_refine_reason_f32(const pvid_refine_f32 *self);

/* Copies the published estimate from any context (publication.h). *number: estimates published so far, 0: none; may be
 * NULL. Fails iff
 *   - an estimate was published during each of PVID_READ_ATTEMPTS attempts, or
 *   - `self` is not initialised. */
bool pvid_refine_read_f32(const pvid_refine_f32 *self, pvid_refine_estimate_f32 *estimate, uint32_t *number);

/* Call this when samples are missing: the block restarts, what is known of r is kept. */
void pvid_refine_gap_f32(pvid_refine_f32 *self);

/* Freezes the refinement (true) or resumes it (false). */
void pvid_refine_freeze_f32(pvid_refine_f32 *self, bool frozen);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/refine_state.h"

#endif
