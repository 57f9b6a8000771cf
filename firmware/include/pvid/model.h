/* pvid/model.h - what the estimator knows of a mechanism.
 *
 * A model is linear in theta, Y = N^T theta, and theta = f(p) depends on few free parameters p
 * (the parametric constraints of the paper). The estimator needs f, its Jacobian C = d theta/d p
 * with a fixed pattern of non-zero entries, and nothing else: write your own model by filling a
 * constant struct and leaving the optional functions NULL.
 *
 *   static const uint8_t row[] = {0, 1, 1}, column[] = {0, 0, 1};
 *   static const pvid_model_f32 mine = { .n_theta = 2, .n_p = 2, .n_moments = 3, .n_c = 3,
 *       .c_row = row, .c_column = column, .theta = my_theta, .jacobian = my_jacobian };
 *
 * The optional functions are for models whose M has structure: `accumulate` when entries of M
 * repeat (fewer sums than n_theta (n_theta + 1) / 2), the others when C^T M C, C^T N and
 * theta^T M theta are cheaper than by the pattern of C. Those three come together or not at all; `noise`
 * is for models that know what their rows make of the sensor's noise.
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
typedef struct pvid_estimator_f32 pvid_estimator_f32; /* estimator.h */

struct pvid_model_f32 {
    uint8_t n_theta;    /* entries of theta and N, 1..PVID_MAX_THETA */
    uint8_t n_p;        /* free parameters, 1..PVID_MAX_P; p[0] is the one kappa speaks of */
    uint8_t n_gated;    /* the first so many are what the gates look at, the others only absorb; 0: all */
    uint16_t n_moments; /* distinct entries of M kept, 1..PVID_MAX_MOMENTS */
    uint16_t n_c;       /* structural non-zeros of C */
    uint32_t positive;  /* bit i set: p[i] > 0 always, steps and start_sd are taken relative to it */

    const uint8_t *c_row;    /* [n_c] row in theta of each non-zero of C, ascending in a column */
    const uint8_t *c_column; /* [n_c] its column (index in p), ascending */

    /* theta[n_theta] = f(p) */
    void (*theta)(const float p[], float theta[]);
    /* c[n_c] = the non-zeros of d theta / d p at p, in the order of c_row */
    void (*jacobian)(const float p[], float c[]);

    /* Adds a row to the sums (layout of information.h: distinct products N_i N_j, then N_i y, y^2
     * and 1) at low[], and writes sums[k] = high[k] + low[k].
     * NULL: all products, packed upper triangle by rows. */
    void (*accumulate)(const float n[], float y, const float high[], float low[], float sums[]);
    /* At p, from moments m[n_moments] and b[n_theta] = sum N Y:
     * s[i][j] = (C^T M C)_ij for i <= j < n_p, f[n_p] = C^T (b - M theta(p)); returns
     * theta^T M theta - 2 theta^T b.
     * NULL: by the pattern of C, with b kept relative to theta(p); see estimator.h. */
    float (*project)(const float p[], const float m[], const float b[], float s[][PVID_MAX_P], float f[]);
    /* Information that the sensor's noise alone makes at p, as if it were signal: what noise of unit variance
     * adds to C^T M C for each unit of weight, s[i][j] for i <= j < n_p, from the traces that the estimator
     * was given. NULL: not known; then nobody asks. */
    void (*noise)(const float p[], const float traces[PVID_NOISE_TRACES], float s[][PVID_MAX_P]);
    /* Returns e = y - N^T theta(p) and writes gradient[n_p] = C^T N at p. */
    float (*innovate)(const float p[], const float n[], float y, float gradient[]);
    /* pvid_estimator_step_f32 in one go, or pvid_estimator_add_f32 where the row does not end a group, with the same
     * bits, given innovate's answers at p (needed while g < 1): saves writing sums and S out and reading them again
     * where a solve follows every row. NULL: one after the other. */
    pvid_reason (*take_row)(pvid_estimator_f32 *estimator, const float n[], float y, float e, const float gradient[],
                            bool ends_group);
};

#ifdef __cplusplus
}
#endif

#endif
