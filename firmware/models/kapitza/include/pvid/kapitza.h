/* pvid/kapitza.h - the two-link pendulum on a vibrating pivot: its parameters, and the strong form.
 *
 * Massless rod 1 of known length l1 hangs from the pivot A, body 2 from its end (centre of mass at l2, radius of
 * gyration rho2). The pivot's motion y_A(t) along Oy and the relative angle phi are measured. Free parameters
 * (theory.md 1):
 *
 *   p = (w, d1, d2),  w = g/l1 [1/s^2],  d1 = 1 + L2 (1 + L1),  d2 = L1 L2,  L1 = l1/l2,  L2 = (l2/rho2)^2
 *
 * Physical region: w > 0, d2 > 0, d1 - d2 - 1 > 0.
 */
#ifndef PVID_KAPITZA_H
#define PVID_KAPITZA_H

#include <stdbool.h>

#include "pvid/estimator.h"
#include "pvid/kapitza_parameters.h"
#include "pvid/model.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float g;    /* component of gravity in the plane of motion [m/s^2] */
    float l2;   /* distance of joint B to the centre of mass of body 2 [m] */
    float rho2; /* radius of gyration of body 2 about its centre of mass [m] */
} pvid_kapitza_f32;

/* p[3] of a pendulum with rod l1 [m]. Lengths and g: positive and finite. */
void pvid_kapitza_linear_f32(const pvid_kapitza_f32 *physical, float l1, float p[PVID_KAPITZA_P]);

/* Physical parameters of an estimate and their standard errors by the delta method. Fails (returns false, writes
 * nothing) iff p is outside the physical region or a result is not finite. */
bool pvid_kapitza_physical_f32(const pvid_estimate_f32 *estimate, float l1, pvid_kapitza_f32 *value,
                               pvid_kapitza_f32 *se);

/* One row of the strong form (theory.md 2) from phi[k] = d^k phi / dt^k, k = 0..4, and u = y_A''/l1, u',
 * u'' [1/s^2 ..]. Writes Y and N[11] in the order of the theory page; the binomial coefficients 3, 3 and 4, 6, 4
 * are in theta instead of N,
 *
 *   theta = (w, w^2, d1, 3 d1 w, 3 d1 w^2, d1 w^3, d2, 4 d2 w, 6 d2 w^2, 4 d2 w^3, d2 w^4),
 *
 * so that 21 of the 66 products N_i N_j are bit-identical to others and need no sum of their own. */
void pvid_kapitza_strong_row_f32(const float phi[5], const float u[3], float *y, float n[PVID_KAPITZA_STRONG_THETA]);

#ifdef __cplusplus
}
#endif

#endif
