/* pvid/trust_q31.h - decides which estimates are published: trust.h with integers only. The same conditions,
 * reasons and order. Every input is allowed. Cost: O(n_p^2). */
#ifndef PVID_TRUST_Q31_H
#define PVID_TRUST_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/estimator_q31.h"
#include "pvid/detail/publication_mark.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PVID_VARIANCE_RATIO_BITS 24

/* Settings; `pvid model build` computes them for a rig. See trust.h. */
typedef struct {
    int32_t kappa_min;   /* least kappa and least pivot, Q30, 0..0.999 */
    int32_t se_max;      /* largest relative standard error of a positive parameter, without the shared, Q24, > 0 */
    uint32_t misfit_max; /* alarm when the residual variance exceeds its expectation by this factor, Q16, >= 1; 0: no
                            alarm */
    uint16_t groups_min; /* groups before the first publication */
    uint16_t
        revert_after; /* consecutive uninformative groups after which p reverts to the published estimate; 0: never */
    uint16_t age_max; /* groups without a publication, used or not, behind which the published estimate is doubted; 0:
                         no limit */
    uint32_t renewal; /* relative change of p after which the old sums are renewed, Q16, 0.01..1e3; 0: never */
    const int32_t *shared; /* [n_p (n_p + 1) / 2] shared errors: standard deviations >= 0, of a positive parameter
                              relative to p in Q24, else as p; correlations in Q30. NULL: none */
} pvid_trust_config_q31;

/* Those of trust.h. */
extern const pvid_trust_config_q31 pvid_trust_defaults_q31;

/* State: detail/trust_state_q31.h, not API. Only the functions below write to it. */
typedef struct pvid_trust_q31 pvid_trust_q31;

/* Initialises `self`; the published estimate is the estimator's start. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER), or
 *   - a field of config is out of its range (the status names it). */
pvid_status pvid_trust_init_q31(pvid_trust_q31 *self, const pvid_trust_config_q31 *config,
                                const pvid_estimator_q31 *estimator);

/* Publishes the start again after pvid_estimator_place_q31. */
void pvid_trust_place_q31(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator);

/* pvid_trust_begin_anew_f32. */
void pvid_trust_begin_anew_q31(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator);

/* As those of trust.h. */
void pvid_trust_open_q31(pvid_trust_q31 *self);
void pvid_trust_skip_q31(pvid_trust_q31 *self, bool rejected);
bool pvid_trust_start_q31(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator, pvid_reason reason,
                          int32_t p[PVID_MAX_P]);

/* Factor on the sums before the rows of the next group are added, Q31; 0: no renewal, or too little would remain.
 * Call it once per group. */
int32_t pvid_trust_fade_factor_q31(pvid_trust_q31 *self);

/* p to revert to if the next group allows no step; NULL: none. */
const int32_t *pvid_trust_fallback_q31(const pvid_trust_q31 *self);

/* Judges a group after its last solve and its assessment.
 *   reason, size:    of that solve
 *   above_noise:     of the assessment
 *   variance_ratio:  residual variance of the group over its expectation, Q24, >= 0
 *   freedom:         rows of the group less nuisances
 *   candidate:       the assessed estimate; what is published has the shared errors
 *
 * Returns and counts the reason of trust.h. */
pvid_reason pvid_trust_judge_q31(pvid_trust_q31 *self, pvid_estimator_q31 *estimator, pvid_reason reason, int64_t size,
                                 bool above_noise, int64_t variance_ratio, uint16_t freedom,
                                 pvid_estimate_q31 *candidate);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/trust_state_q31.h"

#endif
