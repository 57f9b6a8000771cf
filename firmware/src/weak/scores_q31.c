/* The rule of scores_f32.c. The unit of a parameter's scores follows them, so that a typical one has 10 bits or more,
 * and the means with it. */
#include "weak/scores_q31.h"

#include <string.h>

#include "number/count.h"
#include "number/scaled_q31.h"
#include "solve/assess_q31.h"
#include "solve/state_q31.h"

#define DIGITS 14                       /* of the largest score */
#define FIRST_DIGITS 11                 /* of the first one: others may be larger */
#define LEAST_SQUARE ((int32_t)1 << 20) /* of scores that need no smaller unit */
#define SCORE_MAX ((int64_t)1 << DIGITS)
#define MEAN_MAX (2 * SCORE_MAX * SCORE_MAX)

/* Far below: this part of the mean, 0.05. */
static const pvid_scaled_q31 far_below = {858993459, -34};

/* The unit of p[a] becomes 2^up times what it was. */
static void change_unit(pvid_weak_scores_q31 *self, size_t n_p, size_t a, int32_t up)
{
    self->unit[a] = (int16_t)(self->unit[a] + up);
    self->before[a] = (int16_t)pvid_clamp_q31(pvid_scale_q31(self->before[a], up), SCORE_MAX);
    size_t pair = 0;
    for (size_t b = 0; b < n_p; b++) {
        for (size_t c = b; c < n_p; c++) {
            const int32_t shift = ((b == a) ? up : 0) + ((c == a) ? up : 0);
            self->same[pair] = (int32_t)pvid_clamp_q31(pvid_scale_q31(self->same[pair], shift), MEAN_MAX);
            self->neighbour[pair] = (int32_t)pvid_clamp_q31(pvid_scale_q31(self->neighbour[pair], shift), MEAN_MAX);
            pair++;
        }
    }
}

/* A score in its unit, which fits it. */
static int32_t own_of(pvid_weak_scores_q31 *self, size_t n_p, size_t a, pvid_scaled_q31 score)
{
    if (score.m == 0) {
        return 0;
    }
    const int32_t length = score.e + 30;
    const int32_t up = (length - DIGITS) - self->unit[a];
    const int32_t square = self->same[pvid_moment_q31(n_p, a, a)];
    if (square == 0) {
        self->unit[a] = (int16_t)(length - FIRST_DIGITS);
    } else if ((up > 0) || ((up < 0) && (square < LEAST_SQUARE))) {
        change_unit(self, n_p, a, (up > 0) ? up : -1);
    } else {
        /* it fits */
    }
    return (int32_t)pvid_clamp_q31(pvid_scaled_fixed_q31(score, -self->unit[a]), SCORE_MAX);
}

/* A mean with a new value, Q31. */
static int32_t mean_with(int32_t mean, int32_t x, int32_t weight)
{
    return mean + (int32_t)pvid_times_q31((int64_t)x - mean, weight);
}

/* Weight of the newest window, Q31: not less than forgetting between two solves. */
static int32_t weight_of(const pvid_weak_scores_q31 *self, const pvid_estimator_q31 *estimator)
{
    const pvid_information_q31 *information = &estimator->information;
    const uint64_t fading = (((uint64_t)1 << 31) - (uint64_t)information->retention) * estimator->divider;
    const uint64_t least = pvid_quotient_q31(fading, information->block);
    const uint64_t newest = UINT32_MAX / ((uint32_t)self->windows + 2u);
    const uint64_t weight = (newest > least) ? newest : least;
    return (int32_t)((weight < (uint64_t)INT32_MAX) ? weight : (uint64_t)INT32_MAX);
}

void pvid_weak_scores_add_q31(pvid_weak_scores_q31 *self, const pvid_estimator_q31 *estimator,
                              const int32_t score[PVID_MAX_P], pvid_scaled_q31 residual)
{
    const size_t n_p = estimator->model->n_p;
    const pvid_scaled_q31 little = pvid_scaled_times_q31(pvid_scaled_unpacked_q31(self->residual), far_below);
    if (pvid_scaled_exceeds_q31(little, residual)) {
        memset(self, 0, sizeof *self);
    }
    const int32_t weight = weight_of(self, estimator);
    const pvid_scaled_q31 mean = pvid_scaled_unpacked_q31(self->residual);
    const pvid_scaled_q31 change =
        pvid_scaled_times_q31(pvid_scaled_of_q31(weight, -31), pvid_scaled_minus_q31(residual, mean));
    self->residual = pvid_scaled_packed_q31(pvid_scaled_plus_q31(mean, change));
    int32_t own[PVID_MAX_P];
    for (size_t a = 0; a < n_p; a++) {
        own[a] = own_of(self, n_p, a, pvid_scaled_unpacked_q31(score[a]));
    }
    size_t pair = 0;
    for (size_t a = 0; a < n_p; a++) {
        for (size_t b = a; b < n_p; b++) {
            self->same[pair] = mean_with(self->same[pair], own[a] * own[b], weight);
            if (self->known) {
                const int32_t both = (own[a] * self->before[b]) + (self->before[a] * own[b]);
                self->neighbour[pair] = mean_with(self->neighbour[pair], both, weight);
            }
            pair++;
        }
    }
    for (size_t a = 0; a < n_p; a++) {
        self->before[a] = (int16_t)own[a];
    }
    self->known = true;
    pvid_count_up_16(&self->windows);
}

/* The variance of a row that would give p[a] the standard error of the scatter: windows z^T G z, z = L_b correlation_ab
 * with L_b^2 the diagonal of (S + H)^-1. z has 14 bits and the unit of the scores, 2^-32 of its products with G. */
int32_t pvid_weak_scores_error_q31(const pvid_weak_scores_q31 *self, const pvid_estimator_q31 *estimator,
                                   const pvid_estimator_solve_q31 *solve, size_t a, const int32_t correlation[],
                                   pvid_scaled_q31 windows)
{
    const size_t n_p = estimator->model->n_p;
    const pvid_system_q31 *system = &solve->now.system;
    const pvid_root_q31 *root = solve->part.inverse.root;
    int32_t z[PVID_MAX_P];
    int32_t exponent[PVID_MAX_P];
    int32_t largest = INT32_MIN;
    for (size_t b = 0; b < n_p; b++) {
        z[b] = pvid_upper_product_q31(correlation[b], root[b].r);
        exponent[b] = (root[b].e - (system->f[b] + system->g[b])) + self->unit[b];
        const int32_t length = pvid_length_q31(z[b]) + exponent[b];
        largest = (length > largest) ? length : largest;
    }
    largest -= DIGITS;
    for (size_t b = 0; b < n_p; b++) {
        z[b] = (int32_t)pvid_scale_q31(z[b], largest - exponent[b]);
    }
    int64_t same = 0;
    int64_t neighbour = 0;
    size_t pair = 0;
    for (size_t b = 0; b < n_p; b++) {
        for (size_t c = b; c < n_p; c++) {
            const int32_t both = ((b == c) ? 1 : 2) * (z[b] * z[c]);
            same += pvid_upper_product_q31(both, self->same[pair]);
            neighbour += pvid_upper_product_q31(both, self->neighbour[pair]);
            pair++;
        }
    }
    const int64_t sum = (neighbour > 0) ? (same + neighbour) : same;
    const int32_t of_z = (largest + 2) - (31 + PVID_UNIT_BITS); /* of L_b above, and of a correlation in Q30 */
    const int32_t of_sum = (2 * of_z) + 32 - (4 * (int32_t)estimator->information.exponent);
    const pvid_scaled_q31 square = pvid_scaled_times_q31(windows, pvid_scaled_of_q31((sum > 0) ? sum : 0, of_sum));
    return pvid_assess_error_q31(system, root[a], a, pvid_root_of_q31(square.m, square.e));
}
