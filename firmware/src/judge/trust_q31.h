/* The verdict of trust_q31.h in three parts, as those of trust_f32.h. Private to the core. */
#ifndef PVID_JUDGE_TRUST_Q31_H
#define PVID_JUDGE_TRUST_Q31_H

#include "pvid/trust_q31.h"

pvid_reason pvid_trust_decide_q31(pvid_trust_q31 *self, const pvid_estimator_q31 *estimator, pvid_reason reason,
                                  int64_t size, bool above_noise, int64_t variance_ratio,
                                  const pvid_estimate_q31 *candidate);
pvid_reason pvid_trust_publish_q31(pvid_trust_q31 *self, pvid_estimator_q31 *estimator, pvid_reason judged,
                                   pvid_reason reason, pvid_estimate_q31 *candidate);
void pvid_trust_stand_q31(pvid_trust_q31 *self, pvid_reason judged, pvid_reason reason, int64_t variance_ratio,
                          uint16_t freedom, bool errs, uint32_t own, const pvid_estimate_q31 *candidate);

/* Whether these are shared errors of n_p parameters, as of trust_q31.h; NULL: none. */
bool pvid_trust_shared_are_valid_q31(const int32_t shared[], size_t n_p);

/* Adds them to the standard errors and correlations. Cost: n_p square roots, n_p divisions. */
void pvid_trust_add_shared_q31(const int32_t shared[], const pvid_model_q31 *model, pvid_estimate_q31 *candidate);

/* The hash of the conditions, continued from `hash`. */
uint32_t pvid_fingerprint_trust_q31(uint32_t hash, const pvid_trust_config_q31 *config, size_t n_p);

#endif
