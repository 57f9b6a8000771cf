/* The spectrum of the noise of a kind's sums in fixed point, and the scatter of scores, against their definitions. */
#include "test.h"

#include "number/scaled_q31.h"
#include "weak/scores_q31.h"
#include "weak/white_q31.h"

enum { HOP = 40, FUNCTIONS = 9, POWER = 4, HIGHEST = (FUNCTIONS / 2) + (POWER / 2), WEIGHTS = 3 };

static double value_of(pvid_scaled_q31 a)
{
    return ldexp((double)a.m, a.e);
}

static const double weights[WEIGHTS] = {3.5, 0.25, 0.0125};
static const uint8_t order[2] = {0, 2};
static const pvid_weak_design_q31 design = {
    .functions = FUNCTIONS, .power = POWER, .decimation = 1, .hop = HOP, .error_order = order};

/* W_h (sum c_j h^(2 j) + v h^(2 order)), with W_0 = 2 hop and W_h = hop. */
static double variance_at(int h, double v, int of_error)
{
    double sum = v * pow(h, 2 * of_error);
    for (int j = 0; j < WEIGHTS; j++) {
        sum += weights[j] * pow(h, 2 * j);
    }
    return sum * ((h == 0) ? (2 * HOP) : HOP);
}

static void the_spectrum_is_that_of_its_definition(void **state)
{
    for (uint8_t kind = 0; kind < 2u; kind++) {
        pvid_weak_white_q31 self = {.powers = WEIGHTS};
        pvid_scaled_q31 weight[WEIGHTS];
        for (int j = 0; j < WEIGHTS; j++) {
            weight[j] = pvid_scaled_of_q31((int64_t)(weights[j] * 1048576.0), -20);
        }
        const pvid_scaled_q31 error = pvid_scaled_of_q31(7, -3);
        pvid_weak_white_spectrum_q31(&self, &design, kind, error, weight, 0, 2);
        pvid_weak_white_spectrum_q31(&self, &design, kind, error, weight, 2, HIGHEST + 1);
        double sum = 0.0;
        for (int h = 0; h <= HIGHEST; h++) {
            const double expected = variance_at(h, 0.875, order[kind]);
            sum += expected;
            assert_true(fabs((value_of(self.scale[h]) / expected) - 1.0) < 1e-5); /* weights of 20 bits */
        }
        const pvid_scaled_q31 least = pvid_weak_white_floor_q31(&self, &design);
        const double part = value_of(least) * (HIGHEST + 1) / sum;
        assert_true(fabs(ldexp(part, 33) - 1.0) < 1e-5);
        self.scale[1] = pvid_scaled_of_q31(0, 0); /* below the floor */
        pvid_weak_white_invert_q31(&self, least, 0, HIGHEST + 1);
        for (int h = 0; h <= HIGHEST; h++) {
            const double expected = (h == 1) ? value_of(least) : variance_at(h, 0.875, order[kind]);
            assert_true(fabs((value_of(self.scale[h]) * sqrt(expected)) - 1.0) < 1e-5);
        }
    }
}

/* Means of products of scores, a window with the weight 2/(k + 2) behind k windows; neighbours count both ways. */
static void means_of_scores_are_those_of_their_windows(void **state)
{
    enum { N_P = 2, PAIRS = 3, WINDOWS = 9 };
    static const int32_t score[WINDOWS][N_P] = {{700000, -400000},  {-300000, 900000}, {650000, 250000},
                                                {-800000, 100000},  {500000, 500000},  {350000, -900000},
                                                {-600000, -300000}, {200000, 750000},  {900000, -150000}};
    static const pvid_model_q31 model = {.n_theta = N_P, .n_p = N_P};
    static pvid_estimator_q31 estimator;
    static pvid_estimator_solve_q31 solve;
    static pvid_weak_scores_q31 self;
    estimator.model = &model;
    estimator.divider = 1;
    estimator.information.block = 64;
    estimator.information.retention = INT32_MAX;
    double same[PAIRS] = {0.0};
    double neighbour[PAIRS] = {0.0};
    for (int k = 0; k < WINDOWS; k++) {
        memcpy(solve.score, score[k], sizeof score[k]);
        pvid_weak_scores_add_q31(&self, &estimator, &solve, (int64_t)1 << 24);
        const double weight = 2.0 / (k + 2.0);
        int pair = 0;
        for (int a = 0; a < N_P; a++) {
            for (int b = a; b < N_P; b++) {
                const double own = (double)score[k][a] * score[k][b];
                same[pair] += weight * (own - same[pair]);
                if (k > 0) {
                    const double both =
                        ((double)score[k][a] * score[k - 1][b]) + ((double)score[k - 1][a] * score[k][b]);
                    neighbour[pair] += weight * (both - neighbour[pair]);
                }
                pair++;
            }
        }
        for (int i = 0; i < PAIRS; i++) { /* in the unit of both scores; they have some twelve digits */
            const int a = (i == 2) ? 1 : 0;
            const int b = (i == 0) ? 0 : 1;
            const double unit = ldexp(1.0, self.unit[a] + self.unit[b]);
            const double size = sqrt(same[0] * same[2]);
            assert_true(fabs((self.pair[i].same * unit) - same[i]) < 3e-3 * size);
            assert_true(fabs((self.pair[i].neighbour * unit) - neighbour[i]) < 3e-3 * size);
        }
    }
    pvid_weak_scores_skip_q31(&self);
    assert_false(self.known);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(the_spectrum_is_that_of_its_definition),
    cmocka_unit_test(means_of_scores_are_those_of_their_windows),
};
RUN(tests)
