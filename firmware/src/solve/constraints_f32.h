/* Constraints between parameters, h(p) = 0, that nobody has solved for some of them: each step keeps A dp = -h with
 * A = dh/dp. Elimination with complete pivoting makes of it
 *
 *   dp[place] = rest - slope dp        for each independent constraint,
 *
 * whose other parameters are the pseudo-velocities z: a base T of the null space of A, chosen anew for each solve, as
 * the optimum does not depend on the choice. Pivots are the largest entries in units of a large step; of parameters at
 * a bound only where there are no others. Private to the core. Source: theory.md 4, (6b), (6c).
 *
 *   if (!pvid_constraints_return_f32(model, settings, p, RETURNS)) ...       p to h(p) = 0
 *   pvid_constraints_reduce_f32(&system, model, settings, p);                T^T S T, T^T (F - S back)
 *   ... a solve ...
 *   pvid_constraints_complete_f32(&ties, n, dp);                             back + T z
 *   if (!pvid_constraints_end_f32(model, settings, before, p)) ...           and back to h(p) = 0
 *   pvid_constraints_spread_f32(&ties, n, covariance);                       T V T^T
 */
#ifndef PVID_CONSTRAINTS_F32_H
#define PVID_CONSTRAINTS_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/detail/estimator_state.h"
#include "pvid/estimator.h"

#if PVID_MAX_CONSTRAINTS > 0

#define PVID_RETURNS_AT_INIT 20u
#define PVID_RETURNS_OF_STEP 2u

/* Writes all of `self` for this p. Redundant constraints are left out. Cost: h and A, and n_p m^2 multiplications. */
void pvid_constraints_at_f32(pvid_constraints_f32 *self, const pvid_model_f32 *model,
                             const pvid_solve_settings_f32 *settings, const float p[]);

/* F -= S back: what the return to the constraints changes of F. s: upper triangle. */
void pvid_constraints_shift_f32(const pvid_constraints_f32 *self, size_t n, const float s[][PVID_MAX_P], float force[]);

/* S and F at p become those of the independent parameters; the others have S as with four times their prior
 * information. Writes system->ties. Cost: those of `at` and `project`. */
void pvid_constraints_reduce_f32(pvid_system_f32 *system, const pvid_model_f32 *model,
                                 const pvid_solve_settings_f32 *settings, const float p[]);

/* S <- T^T S T, and F <- T^T F unless it is NULL; rows and columns of dependent parameters are 0, their diagonal too.
 * Cost: n_p^2 m multiplications. */
void pvid_constraints_project_f32(const pvid_constraints_f32 *self, size_t n, float s[][PVID_MAX_P], float force[]);

/* dp of the dependent parameters from that of the others. */
void pvid_constraints_complete_f32(const pvid_constraints_f32 *self, size_t n, float dp[]);

/* Covariance of all parameters from that of the independent ones. */
void pvid_constraints_spread_f32(const pvid_constraints_f32 *self, size_t n, float covariance[][PVID_MAX_P]);

/* Moves p within its bounds to h(p) = 0 by at most so many Newton steps of the dependent parameters. Returns whether it
 * is met: to 1e-4 of a large step. */
bool pvid_constraints_return_f32(const pvid_model_f32 *model, const pvid_solve_settings_f32 *settings, float p[],
                                 size_t steps);

/* The same for p after a step: shortened to half until Newton's steps lead there. Fails (returns false, p = before) iff
 * four halvings do not. */
bool pvid_constraints_end_f32(const pvid_model_f32 *model, const pvid_solve_settings_f32 *settings,
                              const float before[], float p[]);

#endif

#endif
