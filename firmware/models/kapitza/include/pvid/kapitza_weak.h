/* pvid/kapitza_weak.h - Kapitza's pendulum in the weak form: five or eight entries of theta.
 *
 * The weak form (theory.md 5) multiplies the equation of motion by test functions and integrates by
 * parts, so that no derivative of the angle is left. It is still linear, Y = N^T theta, with
 *
 *   theta = (d1, d1 w, d2, d2 w, d2 w^2, d2 c, d2 c w, d2 c w^2),   p = (w, d1, d2, c)
 *
 * where c [rad] is what the encoder reads at the equilibrium. For an encoder known to read 0 there,
 * the first five entries and p = (w, d1, d2) suffice. w, d1, d2 and their physical parameters are
 * those of kapitza.h.
 */
#ifndef PVID_KAPITZA_WEAK_H
#define PVID_KAPITZA_WEAK_H

#include "pvid/kapitza_parameters.h"
#include "pvid/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The weak form with the encoder's zero unknown: 8 entries of theta, 4 free parameters, 36 moments. */
extern const pvid_model_f32 pvid_kapitza_weak_f32;

#if PVID_KAPITZA_HAS_FRICTION
/* With two viscous frictions c1, c2 over the mass of body 2, that only absorb what damps the motion (c1 is biased by
 * what the full-angle correction leaves: no measurement): 10 entries of theta, 6 free parameters, 55 moments. */
extern const pvid_model_f32 pvid_kapitza_friction_f32;
#endif

/* The weak form of a zeroed encoder: 5 entries of theta, 3 free parameters, 15 moments. */
extern const pvid_model_f32 pvid_kapitza_weak_zeroed_f32;

#ifdef __cplusplus
}
#endif

#endif
