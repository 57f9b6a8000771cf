/* pvid/estimator.h - estimates few parameters p from rows Y = N^T theta(p) + noise.
 *
 * Adds rows (Y, N) of a model to sums and takes damped Gauss-Newton steps on them (theory.md 4, (5)
 * and (6)):
 *
 *   M = sum N N^T,   B = sum N Y,   S = C^T M C,   F = C^T (B - M theta),   C = d theta / d p
 *   (S + H0) dp = (1 - gamma) sum C^T N e + gamma F,   p += dp,   e = Y - N^T theta
 *
 * gamma = 0 is the paper's law; gamma = 1 is a Gauss-Newton step on the sums. H0 = (row_sd / start_sd)^2 is then
 * damping alone, with gamma = 0 the information of the start. A Cholesky factorisation of order n_p solves the system.
 *
 *   static pvid_estimator_f32 estimator;
 *   pvid_estimator_config_f32 config = pvid_estimator_defaults_f32;   (then model, start, ...)
 *   if (pvid_estimator_init_f32(&estimator, &config) != PVID_OK) ...
 *   each tick:  reason = pvid_estimator_step_f32(&estimator, n, y);
 *   to publish: pvid_estimator_assess_f32(&estimator, &estimate);
 *
 * Never allocates. For every input p stays finite and within its bounds. An unusable row or step is counted and
 * changes nothing else. Not thread-safe.
 *
 * Dead zone (off by default). No step is taken while p is within `dead_zone` standard errors of the solution of
 * all data:
 *
 *   F^T (S + H0)^-1 F <= dead_zone^2 correlation s^2,   s^2 = min(residual variance, row_sd^2)
 *
 * This is the relative dead zone of adaptive control, applied to the normalised residual of the sums instead of
 * the last innovation: B and M are sufficient statistics, and a zone on single innovations would stop p one row's
 * noise away from the solution. Rows are added in any case; F keeps their effect for a later step, but (1 - gamma) sum
 * C^T N e is dropped. Standard errors do not include the zone. With gamma = 0 F does not decay, and p may never enter
 * the zone.
 *
 * Storage of B. In its place b = B - M theta, and rr = sum (Y - N^T theta)^2, are stored and updated by b -= M dtheta
 * at every step. This avoids cancellation: the residual variance is accurate in float32 even if the residual is 1e-4 of
 * Y.
 */
#ifndef PVID_ESTIMATOR_H
#define PVID_ESTIMATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/information.h"
#include "pvid/layout.h"
#include "pvid/model.h"
#include "pvid/standing.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    const pvid_model_f32 *model;
    float start[PVID_MAX_P];    /* initial p [units of p], within the bounds */
    float start_sd[PVID_MAX_P]; /* standard deviation of start [units of p], > 0; H0 = (row_sd / start_sd)^2 */
    float lower[PVID_MAX_P];    /* bounds of p [units of p]; > 0 for positive parameters */
    float upper[PVID_MAX_P];
    float row_sd;         /* expected standard deviation of Y - N^T theta [units of Y], > 0 */
    float update_rate_hz; /* groups of rows per second [Hz], 1e-6..1e6 */
    float forgetting_s;   /* time constant of forgetting [s], at least 4 groups; 0: no forgetting */
    float feedback_hz;    /* stationary law: gamma = feedback_hz * time between solves, at most 1 [Hz]; 0: gamma = 1 */
    float correlation;    /* rows per independent row, >= 1: widens the standard errors where filters overlap */
    float row_weight;     /* independent rows per row, 0 < . <= 1: (K - 2)/K for K rows without 2 degrees of freedom */
    float step_limit;     /* largest |dp/p| of a step (|dp|/start_sd for parameters that may be zero), 0 < . <= 0.9 */
    float kappa_min; /* no step while kappa of S + H0 is smaller, or p[0] has less information from the data than from
                        the start, 0..1; 0: always step */
    float noise_margin; /* no step while S contains less than this many times the information of noise of row_sd alone,
                           0..1e6; in the weak form alone (weak.h); 0: no check */
    float dead_zone;    /* no step within this many standard errors of the solution, 0..100; 0: no dead zone */
    pvid_law law;
    uint16_t divider; /* groups of rows per solve, 1..65535 */
} pvid_estimator_config_f32;

/* Defaults: stationary law, gamma = 1, solve after every group, no forgetting, correlation 1, row_weight 1, step_limit
 * 0.3, kappa_min 1e-5, noise_margin 16, no dead zone. Copy, then set model, start, start_sd, lower, upper, row_sd
 * and update_rate_hz. */
extern const pvid_estimator_config_f32 pvid_estimator_defaults_f32;

/* State: detail/estimator_state.h, not API. Only the functions below write to it. */
typedef struct pvid_estimator_f32 pvid_estimator_f32;
typedef struct pvid_estimator_solve_f32 pvid_estimator_solve_f32;

/* An estimate; all numbers are finite. */
typedef struct {
    float p[PVID_MAX_P];
    float se[PVID_MAX_P];                     /* standard errors [units of p]; start_sd without information */
    float covariance[PVID_MAX_P][PVID_MAX_P]; /* of p, symmetric */
    float kappa;       /* 1 - R^2 of p[0]: share of its information that the other parameters cannot explain, 0..1 */
    float least_pivot; /* smallest such share of any parameter, given those after it, 0..1; near 1e-6 it is rounding */
    float residual_sd; /* of Y - N^T theta [units of Y], not below the sensors' noise; basis of the standard errors */
    float weight;      /* rows in the sums, after forgetting */
    float misfit;      /* residual variance of all rows in the sums over its expectation; 0: unknown */
    pvid_standing standing; /* of the published one */
} pvid_estimate_f32;

/* The init below, for an application with this word (layout.h). */
pvid_status pvid_estimator_init_layout_f32(pvid_estimator_f32 *self, const pvid_estimator_config_f32 *config,
                                           uint32_t layout);

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - library and application were compiled with different sizes (PVID_BAD_LAYOUT; *self is unchanged), or
 *   - a field of config is out of its range (the status names the field). */
static inline pvid_status pvid_estimator_init_f32(pvid_estimator_f32 *self, const pvid_estimator_config_f32 *config)
{
    return pvid_estimator_init_layout_f32(self, config, PVID_LAYOUT);
}

/* Adds a row, ends its group and solves: add and update in one call, for one row per tick. Returns their reason. */
pvid_reason pvid_estimator_step_f32(pvid_estimator_f32 *self, const float n[], float y);

/* Adds a row to the current group. Returns PVID_ACCUMULATED. Fails iff
 *   - n or y is not finite: PVID_REJECTED_NOT_FINITE, or
 *   - the row exceeds PVID_ROW_LIMIT: PVID_REJECTED_SATURATED.
 * A failure changes nothing but the counter. Cost: n_theta^2 / 2 multiplications. A model of several kinds takes it as
 * a row of kind 0. */
pvid_reason pvid_estimator_add_f32(pvid_estimator_f32 *self, const float n[], float y);

/* The same for a row of this kind (model.h): n contains the entries of this kind alone. Fails also iff the model has no
 * such kind: PVID_NOT_READY. */
pvid_reason pvid_estimator_add_kind_f32(pvid_estimator_f32 *self, uint8_t kind, const float n[], float y);

/* Adds g[n_theta] to b, the theta of all kinds at once: compensates the error that noise in N causes in sum N e. While
 * gamma < 1 the step takes it as it takes the rows of the group. Returns PVID_ACCUMULATED. Fails iff
 *   - g is not finite: PVID_REJECTED_NOT_FINITE, or
 *   - |g_i| exceeds PVID_ROW_LIMIT^2: PVID_REJECTED_SATURATED.
 * A failure changes nothing but the counter. */
pvid_reason pvid_estimator_add_to_b_f32(pvid_estimator_f32 *self, const float g[]);

/* Ends a group of rows; every `divider` groups it solves and moves p. Returns PVID_UPDATED, PVID_ACCUMULATED (no
 * solve due), PVID_HELD_NOT_EXCITED or PVID_HELD_SINGULAR; the last two leave p unchanged. */
pvid_reason pvid_estimator_update_f32(pvid_estimator_f32 *self);

/* One more Gauss-Newton step on the same sums; does not end a group. Returns as update does. */
pvid_reason pvid_estimator_iterate_f32(pvid_estimator_f32 *self);

/* The same solve in stages of about the cost of a row each, for loops with a deadline. `self` must be initialised.
 *
 *   pvid_estimator_begin_f32(&estimator, &solve, true);        true: as update, false: as iterate
 *   each tick:  if (pvid_estimator_advance_f32(&estimator, &solve)) use solve.reason
 *
 * advance returns true when the solve is complete. The bits equal those of update if no row is added in between.
 * Number and cost of the stages do not depend on the data. One stage moves p, theta, b and rr; the last folds the
 * sums. */
void pvid_estimator_begin_f32(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve, bool ends_group);
bool pvid_estimator_advance_f32(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve);

/* Number of stages of a solve that is due. */
uint16_t pvid_estimator_stages_f32(const pvid_estimator_f32 *self, bool ends_group);

/* Sets p before the first row, clamped to its bounds; an entry that is NaN is ignored. */
void pvid_estimator_place_f32(pvid_estimator_f32 *self, const float p[]);

/* Standard errors, kappa and residual of the present p from (S / s^2 + 1 / start_sd^2)^-1, s^2 = correlation *
 * residual sum / (weight - n_p). Changes nothing. Cost: about two solves. */
void pvid_estimator_assess_f32(const pvid_estimator_f32 *self, pvid_estimate_f32 *estimate);

/* The same in stages: begin_assessment, then assess_advance until it returns true. `estimate` must stay valid until
 * then. */
void pvid_estimator_begin_assessment_f32(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve,
                                         pvid_estimate_f32 *estimate);
bool pvid_estimator_assess_advance_f32(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve);
uint16_t pvid_estimator_assessment_stages_f32(const pvid_estimator_f32 *self);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/estimator_state.h"

#endif
