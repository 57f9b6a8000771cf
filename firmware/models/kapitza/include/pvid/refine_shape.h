/* pvid/refine_shape.h - numbers of the refinement's model: Kapitza's pendulum.
 *
 * q = (a1, a2), absolute angles [rad] of the two bodies; r = (w, d1, d2, k1, k2, tau, c): those of the weak form,
 * viscous friction at the pivot and at the joint over l1^2 [1/s], the time by which phi is sampled after y [s], and the
 * encoder's reading at the equilibrium [rad]. Input: y''/l1 [1/s^2]. Output: phi [rad]. */
#ifndef PVID_REFINE_SHAPE_H
#define PVID_REFINE_SHAPE_H

#define PVID_REFINE_ORDER 2         /* q'' = a(q, v, u, r) */
#define PVID_REFINE_COORDINATES 2   /* entries of q, hidden ones included */
#define PVID_REFINE_INPUTS 1        /* entries of u */
#define PVID_REFINE_OUTPUTS 1       /* entries of z, which are measured */
#define PVID_REFINE_OUTPUT_RATES 0  /* 1: an output depends on v */
#define PVID_REFINE_OUTPUT_LINEAR 1 /* 1: the derivatives of the outputs are constants */
#define PVID_REFINE_MOVING 6        /* first entries of r: they change the motion */
#define PVID_REFINE_PARAMETERS 7    /* entries of r */
#define PVID_REFINE_CONSTANTS 8     /* that the equations need of r */
#define PVID_REFINE_SKEW 1          /* 1: the last moving entry is the skew of the sensors */
#define PVID_REFINE_P 4             /* entries of the weak form's p that r needs */

#endif
