/* pvid/model.h - a mechanism's model for the estimator.
 *
 * A model is linear in theta, Y = N^T theta, and theta = f(p) depends on few free parameters p. The estimator
 * needs f, its Jacobian C = d theta / d p with a fixed pattern of non-zeros, and nothing else: fill a constant
 * struct.
 *
 *   static const uint8_t row[] = {0, 1, 1}, column[] = {0, 0, 1};
 *   static const pvid_model_f32 mine = { .n_theta = 2, .n_p = 2, .n_moments = 3, .n_c = 3,
 *       .c_row = row, .c_column = column, .theta = my_theta, .jacobian = my_jacobian };
 *
 * Kinds of rows. A mechanism with several equations has a kind of rows for each; their theta follow each other:
 *
 *   static const uint8_t end[] = {5, 11};         the rows of kind 0 have theta[0..4], those of kind 1 theta[5..10]
 *   ... .n_theta = 11, .n_kinds = 2, .kind_end = end, .n_moments = 15 + 21
 *
 * M then has a block for each kind and no entries between them. C has all theta: a parameter may occur in several
 * kinds. Every row has the same variance, so rows of different units are divided by their standard deviations.
 *
 * Constraints. h(p) = 0 of parameters that nobody has solved for some of them (PVID_MAX_CONSTRAINTS > 0): a function
 * writes h and its gradient of each. init moves the start to h = 0, and every step stays there: theory.md 4, (6b).
 *
 * Drifts. Directions in which alone parameters change in time, as with a temperature (PVID_MAX_DRIFTS > 0): what older
 * rows of each kind tell along them is forgotten: theory.md 4, (6d).
 */
#ifndef PVID_MODEL_H
#define PVID_MODEL_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct pvid_model_f32 pvid_model_f32;

struct pvid_model_f32 {
    uint8_t n_theta; /* entries of theta and N, 1..PVID_MAX_THETA */
    uint8_t n_p;     /* free parameters, 1..PVID_MAX_P; kappa refers to p[0] */
    uint8_t n_kinds; /* kinds of rows; 0 or 1: all rows have all theta */
    uint16_t
        n_moments;     /* entries of M, 1..PVID_MAX_MOMENTS: the sum of n (n + 1) / 2 over the kinds, of n theta each */
    uint16_t n_c;      /* structural non-zeros of C */
    uint32_t positive; /* bit i set: p[i] > 0; steps and start_sd are relative to p[i] */

    const uint8_t
        *kind_end;        /* [n_kinds] one past the last theta of each kind, ascending, at last n_theta; NULL for one */
    const uint8_t *c_row; /* [n_c] row in theta of each non-zero of C, ascending in a column */
    const uint8_t *c_column; /* [n_c] its column (index in p), ascending */

    /* theta[n_theta] = f(p) */
    void (*theta)(const float p[], float theta[]);
    /* c[n_c] = the non-zeros of d theta / d p at p, in the order of c_row */
    void (*jacobian)(const float p[], float c[]);
#if PVID_MAX_CONSTRAINTS > 0
    uint8_t n_constraints; /* 0..PVID_MAX_CONSTRAINTS, fewer than n_p; n_p <= n_theta + n_constraints */
    /* h[n_constraints][1 + n_p] = each constraint at p, then d / dp of it; NULL without constraints */
    void (*constraints)(const float p[], float h[]);
#endif
#if PVID_MAX_DRIFTS > 0
    uint8_t n_drifts;       /* 0..PVID_MAX_DRIFTS; without forgetting along them all parameters are constant */
    float drift_s;          /* time constant of what the rows tell along a drift [s], at least 4 groups */
    const float *anchor_sd; /* [n_p] of a parameter in no row, which drifts and is a theta: standard deviation of its
                               start; else 0. NULL: there is none */
    /* d[n_drifts][n_p] = directions dp/dt at p, of any length; NULL without drifts */
    void (*drifts)(const float p[], float d[]);
#endif
};

#ifdef __cplusplus
}
#endif

#endif
