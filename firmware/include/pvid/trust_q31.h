/* pvid/trust_q31.h - which estimate may be shown to others: trust.h in integers alone.
 *
 * The same questions, the same reasons, the same order: see there. Total; O(n_p^2). */
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

/* Settings; pvid.setup.q31 derives them from those of trust.h. */
typedef struct {
    int32_t kappa_min;     /* least kappa and least pivot, Q30, 0..0.999 */
    int32_t se_max;        /* largest standard error of the positive parameters, relative to them, Q24, > 0 */
    uint32_t misfit_max;   /* residual variance over what is expected of it that alarms, Q16, at least 1; 0: no alarm */
    uint16_t groups_min;   /* groups before the first publication */
    uint16_t revert_after; /* groups in a row that say too little for a step, after which p goes back to the published
                          one; 0: never */
    uint32_t renewal; /* the past is renewed once p has settled so far from where its rows came in, see trust.h; Q16,
                         0.01..1e3; 0: never */
} pvid_trust_config_q31;

/* State: detail/trust_state_q31.h. Only the functions below write to it. */
typedef struct pvid_trust_q31 pvid_trust_q31;

/* Prepares `self`; the published estimate is the estimator's start. Fails iff a field of config is not as described
 * there; the status names it. */
pvid_status pvid_trust_init_q31(pvid_trust_q31 *self, const pvid_trust_config_q31 *config,
                                const pvid_estimator_q31 *estimator);

/* Publishes the start again, where p was placed elsewhere before the first row. */
void pvid_trust_place_q31(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator);

/* Factor on the sums of the past before the coming group's rows are added, Q31; 0 where nothing is renewed, or too
 * little would be left. Call it once a group. */
int32_t pvid_trust_fade_factor_q31(pvid_trust_q31 *self);

/* Where p is to go if the coming group does not let it step; NULL: nowhere. */
const int32_t *pvid_trust_fallback_q31(const pvid_trust_q31 *self);

/* Judges a group whose last solve and whose assessment of `candidate` are complete.
 *   reason, size: of that solve;  informed: of the assessment;
 *   variance_ratio: variance of the group's residuals over what was expected, Q24, >= 0.
 * Returns what is to be told; counts it. */
pvid_reason pvid_trust_judge_q31(pvid_trust_q31 *self, pvid_estimator_q31 *estimator, pvid_reason reason, int64_t size,
                                 bool above_noise, int64_t variance_ratio, const pvid_estimate_q31 *candidate);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/trust_state_q31.h"

#endif
