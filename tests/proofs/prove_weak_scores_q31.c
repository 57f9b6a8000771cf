/* A score of any size on top of any means of scores within 2^13, and the standard errors of any parameter from such
 * means. That the means stay within 2^27, as they are between themselves and products within 2^27, intervals do not
 * see. */
#include "prove.h"

#include "contracts.h"
#include "pvid/weak_q31.h"
#include "weak/scores_q31.h"

#define EXPONENT_BOUND 5000
#define MEAN_BOUND ((int32_t)1 << 27)

static pvid_weak_scores_q31 scores;
static pvid_estimator_q31 estimator;
static pvid_estimator_solve_q31 solve;
static pvid_estimate_q31 estimate;

static void any_scores(size_t n_p)
{
    scores.windows = (uint16_t)any_u32(0, UINT16_MAX);
    scores.known = any_bool();
    scores.residual = any_i32(0, INT32_MAX);
    for (size_t a = 0; a < n_p; a++) {
        scores.unit[a] = (int16_t)any_i32(-EXPONENT_BOUND, EXPONENT_BOUND);
        scores.before[a] = (int16_t)any_i32(-8192, 8192);
    }
    for (size_t i = 0; i < (n_p * (n_p + 1u)) / 2u; i++) {
        scores.pair[i].same = any_i32(-MEAN_BOUND, MEAN_BOUND);
        scores.pair[i].neighbour = any_i32(-MEAN_BOUND, MEAN_BOUND);
    }
}

static void any_solve(size_t n_p)
{
    for (size_t a = 0; a < n_p; a++) {
        solve.score[a] = any_i32(-INT32_MAX, INT32_MAX);
        solve.score_exponent[a] = any_i32(-EXPONENT_BOUND, EXPONENT_BOUND);
        solve.part.inverse.root[a].r = any_i32((int32_t)1 << 29, INT32_MAX);
        solve.part.inverse.root[a].e = any_i32(-100, 100);
    }
}

static void any_assessment(size_t n_p)
{
    for (size_t a = 0; a < n_p; a++) {
        solve.now.system.f[a] = (int16_t)any_i32(-EXPONENT_BOUND, EXPONENT_BOUND);
        solve.now.system.g[a] = (int16_t)any_i32(-100, 100);
        estimate.se[a] = any_i32(0, INT32_MAX);
        for (size_t b = 0; b < n_p; b++) {
            estimate.correlation[a][b] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
        }
    }
    estimate.weight = any_u32(0, UINT32_MAX);
}

static void any_number(uint8_t n_p)
{
    pvid_model_q31 model = {.n_theta = n_p, .n_p = n_p};
    estimator.model = &model;
    estimator.divider = (uint16_t)any_u32(1, UINT16_MAX);
    estimator.information.retention = any_i32(1, INT32_MAX);
    estimator.information.block = (uint16_t)any_u32(1, 64);
    estimator.information.exponent = (uint8_t)any_u32(0, 100);
    any_scores(n_p);
    any_solve(n_p);
    pvid_weak_scores_add_q31(&scores, &estimator, &solve, any_i64(0, PVID_WIDE));
    any_scores(n_p);
    any_assessment(n_p);
    pvid_weak_scores_widen_q31(&scores, &estimator, &solve, any_u32(1, UINT32_MAX), 0, n_p, &estimate);
    for (size_t a = 0; a < n_p; a++) {
        /*@ assert 0 <= estimate.se[a]; */
    }
}

void main(void)
{
    any_number(1);
    any_number(4);
}
