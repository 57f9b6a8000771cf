/* pvid/estimator_q31.h - the estimator of estimator.h in integers alone.
 *
 * The same law, the same stages, the same reasons: see there. B and rr = sum (Y - N^T theta)^2 are always kept relative
 * to the estimate, b = B - M theta, and moved along by b -= M dtheta at every step.
 *
 * Formats. Rows (N, Y) are int32 within +-PVID_ROW_LIMIT_Q31 in formats of the configuration; sums are exact int64.
 * When one comes near 2^60, all of M, b and rr are divided by 4 (and rows, from then on, by 2): `exponent` counts how
 * often, and forgetting brings it back. A solve works on 30-bit mantissas: M, C and S are scaled by powers of two such
 * that their diagonals (columns) lie near 2^30, so that no format has to be right for every drive.
 *
 * Total and bounded: whatever the rows, no sum wraps, nothing is divided by 0, p stays inside its bounds. Not
 * thread-safe.
 */
#ifndef PVID_ESTIMATOR_Q31_H
#define PVID_ESTIMATOR_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/model_q31.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Largest |N_i|, |Y| and |Y - N^T theta| of a row that is taken in. */
#define PVID_ROW_LIMIT_Q31 INT32_C(268435456) /* 2^28 */

/* State: detail/estimator_state_q31.h. Only the functions below write to it. */
typedef struct pvid_estimator_q31 pvid_estimator_q31;
typedef struct pvid_estimator_solve_q31 pvid_estimator_solve_q31;

/* Settings; pvid.setup.q31 derives them from a rig file. */
typedef struct {
    const pvid_model_q31 *model;
    int32_t start[PVID_MAX_P];    /* where p starts, within the bounds; p[i] in format p_bits[i] */
    int32_t start_sd[PVID_MAX_P]; /* its standard deviation, > 0, in the format of p */
    int32_t lower[PVID_MAX_P];    /* bounds of p; > 0 where the model says positive */
    int32_t upper[PVID_MAX_P];
    int8_t p_bits[PVID_MAX_P];         /* -64..64 */
    int8_t n_bits[PVID_MAX_THETA_Q31]; /* formats of N, -64..64 */
    int8_t y_bits;                     /* format of Y, -64..64 */
    int32_t row_sd;             /* expected standard deviation of Y - N^T theta, > 0 [2^-8 units of Y's integer] */
    uint32_t forgetting_groups; /* time constant of forgetting in groups of rows, 0: none, else 4..2^24 */
    int32_t gain;               /* g in Q30: 2^30 a Gauss-Newton step at every solve, 0 the paper's law */
    uint32_t correlation;       /* Q16, 2^16..2^31: see estimator.h */
    uint32_t row_weight;        /* Q16, 1..2^16 */
    uint32_t step_limit;        /* Q16, 1..0.9: largest |dp/p| (|dp|/start_sd where p may be zero) */
    int32_t kappa_min;          /* Q30, 0..0.999 */
    uint32_t noise_margin;      /* Q16: no step while the data say less than so many times what noise of row_sd
                                   would; 0: not asked. For models that know what noise makes */
    uint32_t dead_zone;         /* Q16, 0..100: no step while p is within so many standard errors of where the data
                                   want it, see estimator.h; 0: no dead zone */
    uint16_t divider;           /* groups of rows a solve, 1.. */
} pvid_estimator_config_q31;

/* m 2^e: 2^29 <= |m| <= 2^30, or 0. */
typedef struct {
    int32_t m;
    int32_t e;
} pvid_scaled_q31;

/* What is published. */
typedef struct {
    int32_t p[PVID_MAX_P];  /* in the formats p_bits */
    int32_t se[PVID_MAX_P]; /* standard errors in the same formats; start_sd where data say nothing */
    int32_t correlation[PVID_MAX_P][PVID_MAX_P]; /* of the errors, Q30: covariance_ab = se_a se_b correlation_ab */
    int32_t kappa;                               /* Q30, 0..1: see estimator.h */
    int32_t least_pivot;                         /* likewise */
    int32_t residual_sd; /* of Y - N^T theta [2^-8 units of Y's integer], at most 2^31 - 1: see estimator.h */
    uint32_t weight;     /* rows remembered */
    int32_t misfit;      /* Q16, at most 2^31 - 1: see estimator.h; 0: not known */
} pvid_estimate_q31;

/* Prepares `self`. Fails iff a field of config is not as described there; the status names it:
 * PVID_BAD_FORMAT for p_bits, n_bits and y_bits. */
pvid_status pvid_estimator_init_q31(pvid_estimator_q31 *self, const pvid_estimator_config_q31 *config);

/* Moves p[index] to `value`, within its bounds, before the first row is taken in: a better start. */
void pvid_estimator_place_q31(pvid_estimator_q31 *self, uint8_t index, int64_t value);

/* Takes one row of a group in. Returns PVID_ACCUMULATED, or PVID_REJECTED_SATURATED with the state untouched but for
 * the counter. */
pvid_reason pvid_estimator_add_q31(pvid_estimator_q31 *self, const int32_t n[], int32_t y);

/* Ends a group of rows and, when the divider says so, solves and moves p. Returns PVID_UPDATED, PVID_ACCUMULATED (not
 * due), PVID_HELD_NOT_EXCITED or PVID_HELD_PIVOT. */
pvid_reason pvid_estimator_update_q31(pvid_estimator_q31 *self);

/* One more Gauss-Newton step on the same sums, without ending a group. Same answers. */
pvid_reason pvid_estimator_iterate_q31(pvid_estimator_q31 *self);

/* The same solve in stages, as in estimator.h. */
void pvid_estimator_begin_q31(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve, bool ends_group);
bool pvid_estimator_advance_q31(pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve);

/* Number of stages of a solve that is due. */
uint16_t pvid_estimator_stages_q31(const pvid_estimator_q31 *self, bool ends_group);

/* Standard errors, kappa and residual of the present estimate, as pvid_estimator_assess_f32. Changes nothing. */
void pvid_estimator_assess_q31(const pvid_estimator_q31 *self, pvid_estimate_q31 *estimate);

/* The same in stages: begin, then assess_on until it returns true. */
void pvid_estimator_begin_assessment_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve,
                                         pvid_estimate_q31 *estimate);
bool pvid_estimator_assess_advance_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve,
                                       pvid_estimate_q31 *estimate);
uint16_t pvid_estimator_assessment_stages_q31(const pvid_estimator_q31 *self);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/estimator_state_q31.h"

#endif
