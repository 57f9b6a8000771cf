/* pvid/estimator_q31.h - the estimator of estimator.h with integers only.
 *
 * The same law, stages and reasons. b = B - M theta and rr = sum (Y - N^T theta)^2 are stored relative to the
 * estimate and updated by b -= M dtheta at every step.
 *
 * Formats. Rows (N, Y) are int32 within +-PVID_ROW_LIMIT_Q31 in formats of the configuration; sums are exact
 * int64. When a sum approaches 2^60, all of M, b and rr are divided by 4 (and later rows by 2): `exponent` counts
 * this, and forgetting reverses it. A solve uses 30-bit mantissas: powers of two scale M, C and S such that their
 * diagonals are near 2^30; no format depends on the drive.
 *
 * For every row no sum wraps, no division is by 0, and p stays within its bounds. Not thread-safe.
 */
#ifndef PVID_ESTIMATOR_Q31_H
#define PVID_ESTIMATOR_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/layout.h"
#include "pvid/model_q31.h"
#include "pvid/standing.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Largest |N_i|, |Y| and |Y - N^T theta| of an accepted row. */
#define PVID_ROW_LIMIT_Q31 INT32_C(268435456) /* 2^28 */

/* State: detail/estimator_state_q31.h, not API. Only the functions below write to it. */
typedef struct pvid_estimator_q31 pvid_estimator_q31;
typedef struct pvid_estimator_solve_q31 pvid_estimator_solve_q31;

/* Settings; `pvid model build` computes them for a rig. */
typedef struct {
    const pvid_model_q31 *model;
    int32_t start[PVID_MAX_P];    /* initial p, within the bounds; p[i] in format p_bits[i] */
    int32_t start_sd[PVID_MAX_P]; /* its standard deviation, > 0, in the format of p */
    int32_t lower[PVID_MAX_P];    /* bounds of p; > 0 for positive parameters */
    int32_t upper[PVID_MAX_P];
    int8_t p_bits[PVID_MAX_P];         /* -64..64 */
    int8_t n_bits[PVID_MAX_THETA_Q31]; /* formats of N, -64..64 */
    int8_t y_bits;                     /* format of Y, -64..64 */
    int32_t row_sd;             /* expected standard deviation of Y - N^T theta, > 0 [2^-8 units of Y's integer] */
    uint32_t forgetting_groups; /* time constant of forgetting [groups of rows], 4..2^24; 0: no forgetting */
    int32_t gain;               /* g in Q30: 2^30 is a Gauss-Newton step, 0 the paper's law */
    uint32_t correlation;       /* Q16, 2^16..2^31: see estimator.h */
    uint32_t row_weight;        /* Q16, 1..2^16 */
    uint32_t step_limit;        /* Q16, 1..0.9: largest |dp/p| (|dp|/start_sd where p may be zero) */
    int32_t kappa_min;          /* Q30, 0..0.999 */
    uint32_t noise_margin;      /* Q16, see estimator.h; 0: no check */
    uint32_t dead_zone;         /* Q16, 0..100 standard errors, see estimator.h; 0: no dead zone */
    uint16_t divider;           /* groups of rows per solve, 1..65535 */
} pvid_estimator_config_q31;

/* Those of estimator.h, without a noise margin. */
extern const pvid_estimator_config_q31 pvid_estimator_defaults_q31;

/* An estimate. */
typedef struct {
    int32_t p[PVID_MAX_P];                       /* in the formats p_bits */
    int32_t se[PVID_MAX_P];                      /* standard errors in the same formats; start_sd without information */
    int32_t correlation[PVID_MAX_P][PVID_MAX_P]; /* of the errors, Q30: covariance_ab = se_a se_b correlation_ab */
    int32_t kappa;                               /* Q30, 0..1: see estimator.h */
    int32_t least_pivot;                         /* likewise */
    int32_t residual_sd;    /* of Y - N^T theta [2^-8 units of Y's integer], at most 2^31 - 1: see estimator.h */
    uint32_t weight;        /* rows in the sums, after forgetting */
    int32_t misfit;         /* Q16, at most 2^31 - 1: see estimator.h; 0: unknown */
    pvid_standing standing; /* of the published one */
} pvid_estimate_q31;

/* The init below, for an application with this word (layout.h). */
pvid_status pvid_estimator_init_layout_q31(pvid_estimator_q31 *self, const pvid_estimator_config_q31 *config,
                                           uint32_t layout);

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - library and application were compiled with different sizes (PVID_BAD_LAYOUT; *self is unchanged), or
 *   - a field of config is out of its range (the status names it; PVID_BAD_FORMAT: p_bits, n_bits or y_bits). */
static inline pvid_status pvid_estimator_init_q31(pvid_estimator_q31 *self, const pvid_estimator_config_q31 *config)
{
    return pvid_estimator_init_layout_q31(self, config, PVID_LAYOUT);
}

/* Sets p[index] to `value` before the first row, clamped to its bounds. */
void pvid_estimator_place_q31(pvid_estimator_q31 *self, uint8_t index, int64_t value);

/* Adds a row to the current group. Returns PVID_ACCUMULATED. Fails iff the row does not fit its limit:
 * PVID_REJECTED_SATURATED; then only the counter changes. */
pvid_reason pvid_estimator_add_q31(pvid_estimator_q31 *self, const int32_t n[], int32_t y);

/* The same for a row of this kind (model.h): n contains the entries of this kind alone, in their formats; y has the
 * format of all kinds. Fails also iff the model has no such kind: PVID_NOT_READY. (pvid_estimator_add_q31 adds a row of
 * kind 0.) */
pvid_reason pvid_estimator_add_kind_q31(pvid_estimator_q31 *self, uint8_t kind, const int32_t n[], int32_t y);

/* Adds g[n_theta] to b, as pvid_estimator_add_to_b_f32. g_i is in units of N_i's integer times Y's, exponents
 * within +-1000. Returns PVID_ACCUMULATED. Fails iff an entry of b would exceed 2^61 after the division by 4^exponent:
 * PVID_REJECTED_SATURATED; then only the counter changes. */
pvid_reason pvid_estimator_add_to_b_q31(pvid_estimator_q31 *self, const pvid_scaled_q31 g[]);

/* Ends a group of rows; every `divider` groups it solves and moves p. Returns PVID_UPDATED, PVID_ACCUMULATED (no
 * solve due), PVID_HELD_NOT_EXCITED or PVID_HELD_SINGULAR. */
pvid_reason pvid_estimator_update_q31(pvid_estimator_q31 *self);

/* One more Gauss-Newton step on the same sums; does not end a group. Returns as update does. */
pvid_reason pvid_estimator_iterate_q31(pvid_estimator_q31 *self);

/* The same solve in stages, as in estimator.h. */
void pvid_estimator_begin_q31(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, bool ends_group);
bool pvid_estimator_advance_q31(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve);

/* Number of stages of a solve that is due. */
uint16_t pvid_estimator_stages_q31(const pvid_estimator_q31 *self, bool ends_group);

/* Standard errors, kappa and residual of the present p, as pvid_estimator_assess_f32. Changes nothing. */
void pvid_estimator_assess_q31(const pvid_estimator_q31 *self, pvid_estimate_q31 *estimate);

/* The same in stages: begin_assessment, then assess_advance until it returns true. `estimate` may be
 * &solve->matrix.estimate. */
void pvid_estimator_begin_assessment_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve);
bool pvid_estimator_assess_advance_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve,
                                       pvid_estimate_q31 *estimate);
uint16_t pvid_estimator_assessment_stages_q31(const pvid_estimator_q31 *self);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/estimator_state_q31.h"

#endif
