/* The verdict of trust.h in four parts, each for a tick of its own. Private to the core. */
#ifndef PVID_TRUST_F32_H
#define PVID_TRUST_F32_H

#include "pvid/trust.h"

/* Notes whether a candidate [n_p] that was solved for differs from the published estimate, and whether its standard
 * errors have grown. */
void pvid_trust_compare_f32(pvid_trust_f32 *self, size_t n_p, const pvid_estimate_f32 *candidate);

/* The verdict on a candidate; arguments as of pvid_trust_judge_f32. */
pvid_reason pvid_trust_decide_f32(pvid_trust_f32 *self, const pvid_estimator_f32 *estimator, pvid_reason reason,
                                  float size, bool above_noise, float variance_ratio,
                                  const pvid_estimate_f32 *candidate);

/* Publishes the candidate, with the shared errors, if the verdict is PVID_UPDATED; counts the verdict. `reason` is
 * that of the solve. Returns the reason to report. */
pvid_reason pvid_trust_publish_f32(pvid_trust_f32 *self, pvid_estimator_f32 *estimator, pvid_reason verdict,
                                   pvid_reason reason, pvid_estimate_f32 *candidate);

/* The standing of the published estimate, behind that. freedom: rows of the group less nuisances. errs: the
 * residuals were taken for a larger error of an equation than the design's; own: part of the expectation that is the
 * design's, Q16. */
void pvid_trust_stand_f32(pvid_trust_f32 *self, pvid_reason verdict, pvid_reason reason, float variance_ratio,
                          uint16_t freedom, bool errs, uint32_t own, const pvid_estimate_f32 *candidate);

/* Whether these are shared errors of n_p parameters, as of trust.h; NULL: none. */
bool pvid_trust_shared_are_valid_f32(const float shared[], size_t n_p);

/* Adds them to the standard errors, and to the covariance what they have in common; bit a of `positive`: that of p[a]
 * is relative. Cost: n_p square roots. */
void pvid_trust_add_shared_f32(const float shared[], size_t n_p, uint32_t positive, pvid_estimate_f32 *candidate);

/* The hash of the conditions for n_p parameters, continued from `hash`. */
uint32_t pvid_fingerprint_trust_f32(uint32_t hash, const pvid_trust_config_f32 *config, size_t n_p);

#endif
