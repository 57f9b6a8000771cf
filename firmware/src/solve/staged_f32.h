/* Solves in stages; pvid/estimator.h declares the stages. Private to the core. */
#ifndef PVID_STAGED_F32_H
#define PVID_STAGED_F32_H

#include "solve/state_f32.h"

/* pvid_estimator_add_kind_f32 for b = B - M theta and rr, of a kind that the model has. */
pvid_reason pvid_staged_add_f32(pvid_estimator_f32 *self, uint8_t kind, const float n[], float y);

/* Sets the variance of the current group's rows by the sensors' noise. Call it when the group is complete, before its
 * solve begins. */
void pvid_estimator_set_expected_f32(pvid_estimator_f32 *self, float variance);

/* Begins the assessment behind a complete solve, from its normal equations: S at the p before its step, the residuals
 * behind it. pvid_estimator_assess_advance_f32 continues it; number of its stages. */
void pvid_estimator_assess_solved_f32(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve,
                                      pvid_estimate_f32 *estimate);
uint16_t pvid_estimator_assess_solved_stages_f32(const pvid_estimator_f32 *self);

/* Returns whether rounding may dominate rr, because p has moved far since the rows were added. */
bool pvid_estimator_is_rounded_f32(const pvid_estimator_f32 *self);

#endif
