/* pvid/trust.h - which estimates are published.
 *
 * The estimator always has a p; this module decides whether it is accurate enough. After every group of rows it
 * checks the present estimate, publishes it or not, and returns the reason:
 *
 *   PVID_UPDATED            it is published
 *   PVID_MISFIT             it is published, but the residuals are larger than the sensors' noise explains
 *   PVID_HELD_NOT_EXCITED   the data contain too little information on p[0], or no more than noise would
 *   PVID_HELD_PIVOT         the system could not be solved
 *   PVID_HELD_UNCERTAIN     the standard errors are too large, or p has not converged yet
 *
 * Until the first estimate is trusted, the published one is the start with the start's standard deviations.
 * A trusted estimate is held until a later one is trusted.
 *
 * The alarm compares residuals with what the sensors' noise explains, from the first judgement on: the variance of all
 * rows in the sums at the present p, and the windows lately, at the p that they met.
 *
 * Rows that came in at a poor start may weigh far too much, and float32 sums with which p has come a long way have lost
 * digits. Once p has settled, such a past is renewed: it fades before each of the next groups.
 *
 * Defined for every input; O(n_p^2).
 */
#ifndef PVID_TRUST_H
#define PVID_TRUST_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/estimator.h"
#include "pvid/publication.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float kappa_min;     /* least kappa and least pivot, 0 <= . < 1: what one mode of motion alone says of d1 and d2
                            is rounding, and stays below 2e-5 */
    float se_max;        /* largest standard error of the positive parameters, relative to them, > 0 */
    float misfit_max;    /* alarm when the residuals' variance exceeds what is expected of it so many times: that of all
                            rows remembered, 1 + 3 sqrt(2 / degrees of freedom) times as much; on the mean over
                            PVID_TRUST_LONG groups and more; half as much again on the mean over the last
                            PVID_TRUST_SHORT ones. At least 1; 0: no alarm */
    uint16_t groups_min; /* groups before the first publication */
    uint16_t revert_after; /* consecutive groups with too little information for a step, after which p is reset to the
                          published one, so that it does not stay where noise moved it; 0: never */
    float renewal;         /* the past is renewed once p has settled so far from where its rows came in, in one of its
                              positive parameters and relative to it, while the residuals of all rows are beyond the
                              alarm's limit; 0.01..1e3; 0: never */
} pvid_trust_config_f32;

/* kappa_min 3e-5, se_max 5 %, misfit_max 4, groups_min 3, revert_after 16, renewal 20 %. */
extern const pvid_trust_config_f32 pvid_trust_defaults_f32;

#define PVID_TRUST_SHORT 8
#define PVID_TRUST_LONG 16

/* State; only the functions below write to it. */
typedef struct {
    pvid_trust_config_f32 config;
    uint16_t groups;        /* taken in; stops at its end */
    uint16_t uninformative; /* groups in a row that said too little */
    uint16_t judged;        /* residuals in long_mean; stops at long_memory; none before p is near */
    uint16_t long_memory;
    uint8_t next;      /* place of the next residual in recent */
    bool errors_small; /* whether p's standard errors are small at present: while they are not nothing fades */
    bool converged;    /* whether p has settled with small standard errors yet */
    bool published;    /* whether an estimate has been trusted yet */
    bool misfit;
    uint8_t groups_to_fade;   /* groups before which the past is still to fade */
    float anchor[PVID_MAX_P]; /* where p stood when the rows in the sums came in, or when they last agreed with it */
    float long_mean;          /* of residual variances relative to what is expected */
    float recent[PVID_TRUST_SHORT];
    pvid_publication_mark mark;
    pvid_estimate_f32 estimate; /* the published one, for the context that calls step */
    pvid_estimate_f32 copy;     /* its second copy, for other contexts: see publication.h */
} pvid_trust_f32;

/* Prepares `self`; the published estimate is the estimator's start. Fails iff a field of config is not as
 * described there; the status names it. */
pvid_status pvid_trust_init_f32(pvid_trust_f32 *self, const pvid_trust_config_f32 *config,
                                const pvid_estimator_f32 *estimator);

/* Publishes the start again, where p was placed elsewhere before the first row. */
void pvid_trust_place_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator);

/* Renews the past, and the alarm with it: the rows are made in another way from now on. */
void pvid_trust_renew_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator);

/* Factor on the sums of the past before the coming group's rows are added; 1 where nothing is renewed, or too little
 * would be left. Call it once a group. */
float pvid_trust_fade_factor_f32(pvid_trust_f32 *self);

/* Largest standard error of the positive parameters, relative to them. */
float pvid_trust_largest_error_f32(const pvid_estimator_f32 *estimator, const pvid_estimate_f32 *candidate);

/* Where p is to go if the coming group does not let it step; NULL: nowhere. */
const float *pvid_trust_fallback_f32(const pvid_trust_f32 *self);

/* Judges a group whose last solve and whose assessment of `candidate` are complete.
 *   reason, size: of that solve;  informed: of the assessment;
 *   variance_ratio: variance of the group's residuals over what was expected.
 * Returns what is to be told; counts it. */
pvid_reason pvid_trust_judge_f32(pvid_trust_f32 *self, pvid_estimator_f32 *estimator, pvid_reason reason, float size,
                                 bool above_noise, float variance_ratio, const pvid_estimate_f32 *candidate);

#ifdef __cplusplus
}
#endif

#endif
