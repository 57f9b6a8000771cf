/* The rule of scores_f32.c; a score is that of all windows since the last solve. The unit of a parameter's scores
 * follows them, so that a typical one has 9 bits or more, and the means follow the unit. */
#include "weak/scores_q31.h"

#include <string.h>

#include "number/count.h"
#include "number/unroll.h"
#include "solve/assess_q31.h"
#include "solve/state_q31.h"

#define DIGITS 13                       /* of the largest score */
#define FIRST_DIGITS 10                 /* of the first one: others may be larger */
#define LEAST_SQUARE ((int32_t)1 << 18) /* of scores that need no smaller unit */
#define SCORE_MAX ((int32_t)1 << DIGITS)
#define MEAN_MAX (2 * SCORE_MAX * SCORE_MAX)
#define Z_DOWN 15u /* from a product of 29 bits to 14, of more than 8 unknowns to 13: sums of all pairs have 31 */

/* Far below: one part in so many of the mean. */
#define FAR_BELOW 20

#define WINDOWS_BITS 8 /* of the number of windows in the sums, which need not be whole */
#define RATIO_DOWN (PVID_VARIANCE_RATIO_BITS - 12)

/* x 2^-down within +-most. */
PVID_COLD static int32_t shifted(int32_t x, int32_t down, int32_t most)
{
    return (int32_t)pvid_clamp_q31(pvid_scale_q31(x, down), most);
}

/* The unit of p[a] becomes 2^up times what it was. */
PVID_COLD static void change_unit(pvid_weak_scores_q31 *self, size_t n_p, size_t a, int32_t up)
{
    self->unit[a] = (int16_t)(self->unit[a] + up);
    self->before[a] = (int16_t)shifted(self->before[a], up, SCORE_MAX);
    pvid_weak_pair_q31 *pair = self->pair;
    for (size_t b = 0; b < n_p; b++) {
        for (size_t c = b; c < n_p; c++) {
            const int32_t shift = ((b == a) ? up : 0) + ((c == a) ? up : 0);
            if (shift != 0) {
                pair->same = shifted(pair->same, shift, MEAN_MAX);
                pair->neighbour = shifted(pair->neighbour, shift, MEAN_MAX);
            }
            pair++;
        }
    }
}

/* A score in its unit, which fits it. */
static int32_t own_of(pvid_weak_scores_q31 *self, size_t n_p, size_t a, int32_t score, int32_t exponent)
{
    if (score == 0) {
        return 0;
    }
    const int32_t length = pvid_length_q31(score) + exponent;
    const int32_t up = (length - DIGITS) - self->unit[a];
    const int32_t square = self->pair[pvid_moment_q31(n_p, a, a)].same;
    if (square == 0) {
        self->unit[a] = (int16_t)(length - FIRST_DIGITS);
    } else if ((up > 0) || ((up < 0) && (square < LEAST_SQUARE))) {
        change_unit(self, n_p, a, (up > 0) ? up : -1);
    } else {
        /* it fits */
    }
    return shifted(score, self->unit[a] - exponent, SCORE_MAX);
}

/* A mean with a new value, rounded; |mean| and |x| <= MEAN_MAX, weight in Q31. */
static inline int32_t mean_with(int32_t mean, int32_t x, int32_t weight)
{
    return mean + pvid_floor_shift_32_q31(pvid_upper_product_q31(4 * (x - mean), weight) + 1, 1);
}

/* Weight of the newest window, Q31: not less than forgetting between two solves. */
static int32_t weight_of(const pvid_weak_scores_q31 *self, const pvid_estimator_q31 *estimator)
{
    const pvid_information_q31 *information = &estimator->information;
    const uint32_t fading = (((uint32_t)1 << 31) - (uint32_t)information->retention) / information->block;
    const uint64_t least = (uint64_t)fading * estimator->divider;
    const uint32_t newest = UINT32_MAX / ((uint32_t)self->windows + 2u);
    return (int32_t)pvid_clamp_q31((int64_t)(((uint64_t)newest > least) ? (uint64_t)newest : least), INT32_MAX);
}

PVID_COLD void pvid_weak_scores_add_q31(pvid_weak_scores_q31 *self, const pvid_estimator_q31 *estimator,
                                        const pvid_estimator_solve_q31 *solve, int64_t variance_ratio)
{
    const size_t n_p = estimator->model->n_p;
    const int64_t residual = pvid_clamp_q31(pvid_round_shift_q31(variance_ratio, RATIO_DOWN), INT32_MAX);
    if ((residual * FAR_BELOW) < self->residual) {
        memset(self, 0, sizeof *self);
    }
    const int32_t weight = weight_of(self, estimator);
    const int64_t mean = self->residual + pvid_times_q31(residual - self->residual, weight);
    self->residual = (int32_t)pvid_clamp_q31(mean, INT32_MAX);
    int32_t own[PVID_MAX_P];
    for (size_t a = 0; a < n_p; a++) {
        own[a] = own_of(self, n_p, a, solve->score[a], solve->score_exponent[a]);
    }
    pvid_weak_pair_q31 *pair = self->pair;
    for (size_t a = 0; a < n_p; a++) {
        for (size_t b = a; b < n_p; b++) {
            pair->same = mean_with(pair->same, own[a] * own[b], weight);
            if (self->known) {
                const int32_t both = (own[a] * self->before[b]) + (self->before[a] * own[b]);
                pair->neighbour = mean_with(pair->neighbour, both, weight);
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

/* z^T G z, or less than 0 by rounding. */
static int32_t scatter_of(const pvid_weak_scores_q31 *self, size_t n_p, const int32_t z[])
{
    int32_t same = 0;
    int32_t neighbour = 0;
    const pvid_weak_pair_q31 *pair = self->pair;
    for (size_t b = 0; b < n_p; b++) {
        for (size_t c = b; c < n_p; c++) {
            const int32_t both = (z[b] * z[c]) * ((b == c) ? 1 : 2);
            same += pvid_upper_product_q31(both, pair->same);
            neighbour += pvid_upper_product_q31(both, pair->neighbour);
            pair++;
        }
    }
    return same + ((neighbour > 0) ? neighbour : 0);
}

/* windows z^T G z is the variance of a row that would give p[a] the error of the scatter: z_b = L_b correlation_ab,
 * L_b^2 the diagonal of (S + H)^-1, is an integer within 2^14 (of more than 8 unknowns 2^13) times 2^unit. */
PVID_COLD void pvid_weak_scores_widen_q31(const pvid_weak_scores_q31 *self, const pvid_estimator_q31 *estimator,
                                          const pvid_estimator_solve_q31 *assessment, uint32_t rows, size_t first,
                                          size_t last, pvid_estimate_q31 *estimate)
{
    const size_t n_p = estimator->model->n_p;
    const pvid_system_q31 *system = &assessment->now.system;
    const pvid_root_q31 *root = assessment->part.inverse.root;
    int32_t exponent[PVID_MAX_P];
    uint32_t down[PVID_MAX_P];
    int32_t largest = INT16_MIN;
    const uint32_t z_down = Z_DOWN + pvid_spare_bits_q31((uint32_t)n_p);
    for (size_t b = 0; b < n_p; b++) {
        exponent[b] = (root[b].e - (system->f[b] + system->g[b])) + self->unit[b];
        largest = (exponent[b] > largest) ? exponent[b] : largest;
    }
    for (size_t b = 0; b < n_p; b++) {
        const int64_t below = pvid_clamp_q31((int64_t)largest - exponent[b], 31 - (int32_t)z_down);
        down[b] = z_down + (uint32_t)((below > 0) ? below : 0);
    }
    const int32_t bits = 31 + pvid_unit_bits_q31((uint32_t)n_p);
    const int32_t unit = (largest + (int32_t)z_down + 2) - bits; /* 2: a correlation has 30 bits, not 32 */
    const int32_t of_square = ((2 * unit) + 32) - (4 * (int32_t)estimator->information.exponent) - WINDOWS_BITS;
    const uint64_t windows = pvid_quotient_q31((uint64_t)estimate->weight << WINDOWS_BITS, rows);
    const int32_t clamped = (int32_t)((windows < (uint64_t)INT32_MAX) ? windows : (uint64_t)INT32_MAX);
    for (size_t a = first; a < last; a++) {
        int32_t z[PVID_MAX_P];
        for (size_t b = 0; b < n_p; b++) {
            const int32_t product = pvid_upper_product_q31(estimate->correlation[a][b], root[b].r);
            z[b] = pvid_floor_shift_32_q31(product, down[b]);
        }
        const int32_t sum = scatter_of(self, n_p, z);
        if (sum > 0) {
            const pvid_root_q31 wide = pvid_root_of_q31(pvid_product_q31(sum, clamped), of_square);
            const int32_t se = pvid_assess_error_q31(system, root[a], a, wide);
            estimate->se[a] = (se > estimate->se[a]) ? se : estimate->se[a];
        }
    }
}
