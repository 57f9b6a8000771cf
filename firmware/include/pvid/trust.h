/* pvid/trust.h - decides which estimates are published.
 *
 * The estimator always has a p; this module decides whether it is accurate enough. After every group of rows it
 * checks the present estimate, publishes it or not, and returns the reason:
 *
 *   PVID_UPDATED           published
 *   PVID_MISFIT            published, but the residuals exceed the sensors' noise: the model does not fit
 *   PVID_HELD_NOT_EXCITED  held: too little information on a parameter, or no more than noise alone gives
 *   PVID_HELD_SINGULAR     held: the system could not be solved
 *   PVID_HELD_UNCERTAIN    held: standard errors above se_max, fewer windows than groups_min, p still moving, or the
 *                          gate has just opened
 *
 * Until the first estimate is trusted, the published one is the start with start_sd. A published estimate is held until
 * the next one.
 *
 * Misfit alarm. Residual variances are compared with their expectation from the sensors' noise: that of all rows
 * in the sums at the present p, and those of the latest windows at the p before each window.
 *
 * Renewal. Rows that were added while p was far from the solution may have too much weight, and float32 sums lose
 * digits when p moves far. When p has converged far from its value at those rows, the old sums are faded over the next
 * groups.
 *
 * Beginning anew. When an equation's own error turns out to be larger, almost nothing of the old sums remains. p stays.
 * The published estimate is held until p passes the checks of a first publication.
 *
 * Shared errors. A gain, a delay or an offset of a signal, a constant, the clock and a term that the equations neglect
 * move p by the same in all windows: residuals hardly show it, and more data do not reduce it. The host computes what
 * they do for the motion that the design is for; `shared` is that, and is added to the published standard errors.
 * Whether an estimate is published, and its comparison with later windows (standing.h), does not depend on it.
 *
 * Standing. Behind every window the published estimate is compared with the candidate, and may be doubted or withdrawn:
 * standing.h. When the gate opens, or when several windows lead to no publication although p does not fit them, p
 * starts again: from the last trusted p, then from points about it, with sums of zero.
 *
 * Every input is allowed. Cost: O(n_p^2).
 */
#ifndef PVID_TRUST_H
#define PVID_TRUST_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/estimator.h"
#include "pvid/detail/publication_mark.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float kappa_min;  /* least kappa and least pivot of a published estimate, 0 <= . < 1. A single mode of motion gives
                         below 2e-5, by rounding */
    float se_max;     /* largest relative standard error of the positive parameters, without the shared errors, > 0 */
    float misfit_max; /* alarm when the residual variance exceeds its expectation by this factor, >= 1; 0: no alarm. The
                         factor is multiplied by 1 + 3 sqrt(2 / degrees of freedom) for all rows in the sums, by 1 for
                         the mean of PVID_TRUST_LONG groups or more, by 1.5 for the last PVID_TRUST_SHORT groups */
    uint16_t groups_min; /* groups before the first publication */
    uint16_t
        revert_after; /* consecutive uninformative groups after which p reverts to the published estimate; 0: never */
    uint16_t age_max; /* groups without a publication, used or not, behind which the published estimate is doubted; 0:
                         no limit */
    float renewal;    /* relative change, 0.01..1e3; 0: never. The old sums are renewed when a positive parameter has
                         converged this far from its value at their rows, and the residual variance of all rows is above
                         the alarm's limit */
    const float *shared; /* [n_p (n_p + 1) / 2] shared errors, the upper triangle by rows. On the diagonal standard
                            deviations, 0..1e9: of a positive parameter relative to p, else in the unit of p; beside it
                            their correlations, -1..1. NULL: none. Must outlive the identifier */
} pvid_trust_config_f32;

/* Defaults: kappa_min 3e-5, se_max 5 %, misfit_max 4, groups_min 3, revert_after 16, age_max 1000, renewal 20 %, no
 * shared errors. */
extern const pvid_trust_config_f32 pvid_trust_defaults_f32;

/* State: detail/trust_state.h, not API. Only the functions below write to it. */
typedef struct pvid_trust_f32 pvid_trust_f32;

/* Initialises `self`; the published estimate is the estimator's start. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER), or
 *   - a field of config is out of its range (the status names it). */
pvid_status pvid_trust_init_f32(pvid_trust_f32 *self, const pvid_trust_config_f32 *config,
                                const pvid_estimator_f32 *estimator);

/* Publishes the start again after pvid_estimator_place_f32. */
void pvid_trust_place_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator);

/* Renews the sums and restarts the alarm; call it when the rows change their meaning. */
void pvid_trust_renew_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator);

/* The sums and the alarm begin anew with the next group, and the estimate must pass the checks again. */
void pvid_trust_begin_anew_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator);

/* The gate opens to a changed mechanism in this group. */
void pvid_trust_open_f32(pvid_trust_f32 *self);

/* A group without rows: all of them were rejected by the gate, or the group was dropped. */
void pvid_trust_skip_f32(pvid_trust_f32 *self, bool rejected);

/* Behind a group: writes p [n_p] of the next start and returns true if p has to start again. */
bool pvid_trust_start_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator, pvid_reason reason,
                          float p[PVID_MAX_P]);

/* Factor on the sums before the rows of the next group are added; 1: no renewal, or too little would remain. Call
 * it once per group. */
float pvid_trust_fade_factor_f32(pvid_trust_f32 *self);

/* Largest relative standard error of the positive parameters. */
float pvid_trust_largest_error_f32(const pvid_estimator_f32 *estimator, const pvid_estimate_f32 *candidate);

/* p to revert to if the next group allows no step; NULL: none. */
const float *pvid_trust_fallback_f32(const pvid_trust_f32 *self);

/* Judges a group after its last solve and its assessment.
 *   reason, size:    of that solve
 *   above_noise:     of the assessment
 *   variance_ratio:  residual variance of the group over its expectation
 *   freedom:         rows of the group less nuisances
 *   candidate:       the assessed estimate; the published copy also contains the shared errors
 * Returns a reason of the table above and counts it. */
pvid_reason pvid_trust_judge_f32(pvid_trust_f32 *self, pvid_estimator_f32 *estimator, pvid_reason reason, float size,
                                 bool above_noise, float variance_ratio, uint16_t freedom,
                                 pvid_estimate_f32 *candidate);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/trust_state.h"

#endif
