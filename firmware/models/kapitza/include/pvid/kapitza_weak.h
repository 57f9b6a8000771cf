/* pvid/kapitza_weak.h - Kapitza's pendulum in the weak form: five, eight or ten entries of theta.
 *
 * The weak form (theory.md 5) multiplies the equation of motion by test functions and integrates by
 * parts; no derivative of the angle remains. It is linear, Y = N^T theta, with
 *
 *   theta = (d1, d1 w, d2, d2 w, d2 w^2, d2 c, d2 c w, d2 c w^2),   p = (w, d1, d2, c)
 *
 * c [rad] is the encoder's reading at the equilibrium. For an encoder that reads 0 there, the first five entries
 * and p = (w, d1, d2) suffice. w, d1, d2 and their physical parameters: kapitza.h.
 */
#ifndef PVID_KAPITZA_WEAK_H
#define PVID_KAPITZA_WEAK_H

#include "pvid/kapitza_parameters.h"
#include "pvid/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The weak form with unknown offset: 8 entries of theta, 4 free parameters, 36 moments. */
extern const pvid_model_f32 pvid_kapitza_weak_f32;

#if PVID_KAPITZA_HAS_FRICTION
/* With two viscous friction coefficients c1, c2 over the mass of body 2: nuisance parameters, biased by the
 * residual of the full-angle correction and not published. 10 entries of theta, 6 free parameters, 55 moments. */
extern const pvid_model_f32 pvid_kapitza_friction_f32;
#endif

/* The weak form without offset: 5 entries of theta, 3 free parameters, 15 moments. */
extern const pvid_model_f32 pvid_kapitza_weak_zeroed_f32;

#ifdef __cplusplus
}
#endif

#endif
