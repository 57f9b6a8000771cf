/* pvid/estimator.h - parameters with constraints, driven by pseudo-velocities.
 *
 * Takes rows (Y, N) of a model and moves its few free parameters p (MATH.md 4, equation (5)):
 *
 *   S = C^T M C,   F = C^T (B - M theta),   (S + H0) dp = (1 - g) sum C^T N e + g F,   p += dp
 *
 * with e = Y - N^T theta. g = 0 is the paper's law, literally; g = 1 is one Gauss-Newton step on
 * the sums (they do not depend on p, so re-linearising loses nothing). H0 is the information the
 * start brings along. Solved by an equilibrated Cholesky factorisation of order n_p.
 *
 *   static pvid_estimator_f32 estimator;
 *   pvid_estimator_config_f32 config = pvid_estimator_defaults_f32;   (then model, start, ...)
 *   if (pvid_estimator_init_f32(&estimator, &config) != PVID_OK) ...
 *   each tick:  reason = pvid_estimator_step_f32(&estimator, n, y);
 *   to publish: pvid_estimator_assess_f32(&estimator, &estimate);
 *
 * Total and bounded: whatever the rows, p stays finite and inside its bounds. A row or a step that
 * cannot be used is counted and leaves the state as it was. Not thread-safe.
 *
 * The dead zone (off by default) holds p while the data require no more change than noise explains: no step is taken
 * while p is within `dead_zone` standard errors of the solution of all data,
 *
 *   F^T (S + H0)^-1 F <= dead_zone^2 correlation s^2,   s^2 the lesser of the residual variance and row_sd^2.
 *
 * It is the relative dead zone of adaptive control (the error is measured by what noise makes of it), but on the
 * normalised residual of the sums, not of the last row: B and M are sufficient, so a dead zone on single innovations
 * would stop p a single row's noise short of the answer, and leaving rows out by their size would bias the sums. Rows
 * are always taken in; what a step that is not taken would have done is in F and comes with a later one (not so what
 * (1 - g) sum C^T N e would have added: that is dropped, as in the literature). Standard errors do not count the zone.
 * With g = 0 F does not decay, and p may never come to rest.
 *
 * How B is kept. A model with a `project` of its own gets B = sum N Y. Without one, B and yy are
 * kept relative to the estimate, b = B - M theta and rr = sum (Y - N^T theta)^2, moved along by
 * b -= M dtheta at every step: the same quantities without the cancellation, so that the residual
 * variance stays honest in float32 even when the residual is 1e-4 of Y.
 */
#ifndef PVID_ESTIMATOR_H
#define PVID_ESTIMATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/information.h"
#include "pvid/model.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    const pvid_model_f32 *model;
    float start[PVID_MAX_P];    /* where p starts [units of p], within the bounds */
    float start_sd[PVID_MAX_P]; /* its standard deviation [units of p], > 0: H0 = (row_sd / start_sd)^2 */
    float lower[PVID_MAX_P];    /* bounds of p [units of p]; > 0 where the model says positive */
    float upper[PVID_MAX_P];
    float row_sd;         /* expected standard deviation of Y - N^T theta [units of Y], > 0 */
    float update_rate_hz; /* groups of rows a second, 1e-6..1e6 */
    float forgetting_s;   /* time constant of forgetting; 0: none; else at least 4 groups */
    float feedback_hz;    /* stationary law: g = feedback_hz * time between solves, at most 1;
                             0: g = 1, a Gauss-Newton step at every solve */
    float correlation;    /* rows that carry the information of one independent row, >= 1:
                             widens the standard errors when filters overlap */
    float row_weight;     /* independent rows that a row counts for, 0 < . <= 1: (K - 2)/K where K rows
                             lost 2 degrees of freedom; 1 where the model accumulates by itself */
    float step_limit;     /* largest |dp/p| (|dp|/start_sd where p may be zero), 0 < . <= 0.9 */
    float kappa_min;      /* no step while kappa of S + H0 is below this, or while the data say
                             less of p[0] than the start does, 0..1; 0: always step */
    float noise_margin;   /* no step while the data say less than so many times what noise of row_sd
                             alone would (for models that know it), 0..1e6; 0: do not ask */
    float dead_zone;      /* no step while p is within so many standard errors of the data's solution,
                             0..100; 0: no dead zone */
    pvid_law law;
    uint16_t divider; /* groups of rows a solve, 1.. */
} pvid_estimator_config_f32;

/* Defaults: stationary law, Gauss-Newton at every tick, no forgetting, row_weight 1, step_limit 0.3,
 * kappa_min 1e-5, noise_margin 16, no dead zone. Copy, then set model, start, start_sd, bounds, row_sd and
 * update_rate_hz. */
extern const pvid_estimator_config_f32 pvid_estimator_defaults_f32;

/* State: detail/estimator_state.h. Only the functions below write to it. */
typedef struct pvid_estimator_solve_f32 pvid_estimator_solve_f32;

/* What is published. Always finite. */
typedef struct {
    float p[PVID_MAX_P];
    float se[PVID_MAX_P];                     /* standard errors; start_sd where data say nothing */
    float covariance[PVID_MAX_P][PVID_MAX_P]; /* of p, symmetric */
    float kappa;       /* part of p[0]'s information that the other parameters cannot imitate, 0..1 */
    float least_pivot; /* least part of any parameter's information that those after it cannot imitate, 0..1: near
                          1e-6 it is made by the rounding of float32 */
    float residual_sd; /* of Y - N^T theta [units of Y]: what the standard errors are made of, and so no less than the
                          sensors' noise explains */
    float weight;      /* rows remembered */
    float misfit;      /* variance of the residuals of all rows remembered over what the sensors' noise explains of it;
                          0: not known */
} pvid_estimate_f32;

/* Prepares `self`. Fails iff a field of config is not as described there; the status names it. */
pvid_status pvid_estimator_init_f32(pvid_estimator_f32 *self, const pvid_estimator_config_f32 *config);

/* Takes one row in, ends the group and solves: add and update in one, for one row a tick. Returns
 * what they return. */
pvid_reason pvid_estimator_step_f32(pvid_estimator_f32 *self, const float n[], float y);

/* Takes one row of a group in. Returns PVID_ACCUMULATED, or PVID_REJECTED_NOT_FINITE or
 * PVID_REJECTED_SATURATED with the state untouched but for the counter. */
pvid_reason pvid_estimator_add_f32(pvid_estimator_f32 *self, const float n[], float y);

/* Ends a group of rows and, when the divider says so, solves and moves p. Returns PVID_UPDATED,
 * PVID_ACCUMULATED (not due), PVID_HELD_NOT_EXCITED or PVID_HELD_PIVOT. */
pvid_reason pvid_estimator_update_f32(pvid_estimator_f32 *self);

/* One more Gauss-Newton step on the same sums, without ending a group. Same answers. */
pvid_reason pvid_estimator_iterate_f32(pvid_estimator_f32 *self);

/* The same solve in stages that cost about as much as a row each, for a loop that cannot wait (of an initialised
 * estimator: only the functions above check this):
 *
 *   pvid_estimator_begin_f32(&estimator, &solve, true);        true: as update, false: as iterate
 *   each tick:  if (pvid_estimator_advance_f32(&estimator, &solve)) use solve.reason
 *
 * advance returns whether the solve is complete. The same bits as in one go, provided that no row is
 * added in between. What a stage costs and how many there are does not depend on the data; all of p,
 * theta, b and rr move in one stage, the sums are folded in the last. A model with a `project` of its
 * own is solved in one stage. */
void pvid_estimator_begin_f32(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve, bool ends_group);
bool pvid_estimator_advance_f32(pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve);

/* Number of stages of a solve that is due. */
uint16_t pvid_estimator_stages_f32(const pvid_estimator_f32 *self, bool ends_group);

/* Sets p before the first row, within its bounds; what is no number leaves its entry as it was. */
void pvid_estimator_place_f32(pvid_estimator_f32 *self, const float p[]);

/* Standard errors, kappa and residual of the present estimate, from (S / s^2 + 1 / start_sd^2)^-1
 * with s^2 = correlation * residual sum / (weight - n_p). Costs about two solves; changes nothing. */
void pvid_estimator_assess_f32(const pvid_estimator_f32 *self, pvid_estimate_f32 *estimate);

/* The same in stages, for a model without a `project` of its own: begin, then assess_on until it returns
 * true. `estimate` must stay where it is meanwhile. */
void pvid_estimator_begin_assessment_f32(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve,
                                         pvid_estimate_f32 *estimate);
bool pvid_estimator_assess_advance_f32(const pvid_estimator_f32 *self, pvid_estimator_solve_f32 *solve);
uint16_t pvid_estimator_assessment_stages_f32(const pvid_estimator_f32 *self);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/estimator_state.h"

#endif
