/* The fixed-point estimator where its sums no longer fit, at its limits, and with as many entries as there is room for:
 * the same parameters as from rows that are small. */
#include "test.h"

#include <stdlib.h>

#include "identity_q31.h"
#include "number/count.h"
#include "solve/assess_q31.h"
#include "solve/row_q31.h"
#include "solve/state_q31.h"
#include "pvid/pvid.h"
#include "number/scaled_q31.h"

/* ---- y = N^T p with as many entries as there may be parameters ---- */

static const pvid_model_q31 model = IDENTITY_Q31(PVID_MAX_P);
static const double truth[PVID_MAX_P] = {0.75, -0.5, 0.25, 0.6};
#define P_ONE (1 << 24)

static pvid_estimator_config_q31 config;
static uint32_t generator;

static int start_again(void **state)
{
    config = usual_config_q31(&model);
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        config.start[i] = P_ONE / 2;
        config.start_sd[i] = 4 * P_ONE;
        config.lower[i] = -16 * P_ONE;
        config.upper[i] = 16 * P_ONE;
        config.p_bits[i] = 24;
        config.n_bits[i] = 20;
    }
    config.y_bits = 20;
    config.row_sd = 256 * 64; /* 64 of Y's integer */
    config.step_limit = 58982;
    generator = 9u;
    return 0;
}

static int32_t random_within(int32_t limit)
{
    generator = (generator * 1664525u) + 1013904223u;
    return (int32_t)((generator >> 4) % (2u * (uint32_t)limit + 1u)) - limit;
}

/* A row of entries within 2^16 with noise of +-100 in Y, all of it 2^up times larger. */
static void add_row(pvid_estimator_q31 *estimator, int32_t up)
{
    int32_t n[PVID_MAX_P];
    double y = random_within(100);
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        n[i] = random_within(1 << 16);
        y += truth[i] * n[i];
        n[i] *= 1 << up;
    }
    assert_int_equal(pvid_estimator_add_q31(estimator, n, (int32_t)floor(y + 0.5) * (1 << up)), PVID_ACCUMULATED);
}

static double p_of(const pvid_estimator_q31 *estimator, size_t i)
{
    return (double)estimator->p[i] / P_ONE;
}

/* The same data in other units: p and what is known of it are the same, though the sums of one are 4^exponent times
 * smaller than they would be. */
static void result_is_invariant_to_row_scale(void **state)
{
    static pvid_estimator_q31 small;
    static pvid_estimator_q31 large;
    static pvid_estimate_q31 estimate[2];
    const int32_t gains[3] = {1 << 30, 1 << 29, 1 << 28};
    for (int k = 0; k < 3; k++) {
        start_again(NULL);
        config.gain = gains[k];
        assert_int_equal(pvid_estimator_init_q31(&small, &config), PVID_OK);
        config.row_sd <<= 10;
        assert_int_equal(pvid_estimator_init_q31(&large, &config), PVID_OK);
        for (int i = 0; i < 1000; i++) {
            const uint32_t seed = generator;
            add_row(&small, 0);
            generator = seed;
            add_row(&large, 10);
            const pvid_reason reason = pvid_estimator_update_q31(&small);
            assert_int_equal(pvid_estimator_update_q31(&large), reason);
            assert_true((reason == PVID_UPDATED) || ((reason == PVID_HELD_SINGULAR) && (i < 20)));
            for (size_t a = 0; a < PVID_MAX_P; a++) {
                /* the smaller rows' innovations are rounded: 0.3 of some 40 000, over the root of so many rows; the
                 * rates keep something of their first steps */
                assert_true((i < 20) || (fabs(p_of(&small, a) - p_of(&large, a)) < ((k == 0) ? 5.0e-6 : 2.0e-3)));
            }
        }
        assert_int_equal(small.information.exponent, 0);
        assert_true(large.information.exponent >= 1);
        pvid_estimator_assess_q31(&small, &estimate[0]);
        pvid_estimator_assess_q31(&large, &estimate[1]);
        for (size_t a = 0; a < PVID_MAX_P; a++) {
            assert_true(fabs(p_of(&small, a) - truth[a]) < 2.0e-4);
            assert_true(fabs(p_of(&small, a) - p_of(&large, a)) < 5.0e-6);
            assert_true(fabs((double)estimate[0].se[a] - (double)estimate[1].se[a]) <=
                        2.0 + 1.0e-3 * estimate[0].se[a]);
            assert_int_equal(estimate[0].correlation[a][a], 1 << 30);
            for (size_t b = 0; b < a; b++) {
                assert_true(abs(estimate[0].correlation[a][b] - estimate[1].correlation[a][b]) < (1 << 12));
                assert_int_equal(estimate[0].correlation[a][b], estimate[0].correlation[b][a]);
            }
        }
        assert_true(abs(estimate[0].kappa - estimate[1].kappa) < (1 << 8));
        assert_true(abs(estimate[0].least_pivot - estimate[1].least_pivot) < (1 << 8));
        assert_int_equal(estimate[0].weight, 1000);
        assert_int_equal(estimate[1].weight, 1000);
        const double ratio = (double)estimate[1].residual_sd / (double)estimate[0].residual_sd;
        assert_true(fabs((ratio / 1024.0) - 1.0) < 1.0e-3);
        /* uniform noise of +-100 has a standard deviation of 58, in 2^-8 of Y's integer */
        assert_true(fabs(((double)estimate[0].residual_sd / 256.0) - 58.0) < 6.0);
    }
}

/* A start that is worth as much as 1500 rows takes half of a step away, also where the sums were divided by four. */
static void the_start_weighs_the_same_beside_sums_of_any_size(void **state)
{
    static pvid_estimator_q31 small;
    static pvid_estimator_q31 large;
    pvid_model_q31 measured = model;
    measured.positive = 13u; /* steps are measured by p, not by the narrow start; p[1] starts where it belongs */
    config.model = &measured;
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        config.start_sd[i] = P_ONE / 1000;
        config.lower[i] = (i == 1u) ? config.lower[i] : 1;
    }
    config.start[1] = -P_ONE / 2;
    config.divider = 1500;
    config.row_sd = 256 * 1460; /* 37800 of an entry, 0.001, and the root of 1500 */
    assert_int_equal(pvid_estimator_init_q31(&small, &config), PVID_OK);
    config.row_sd <<= 10;
    assert_int_equal(pvid_estimator_init_q31(&large, &config), PVID_OK);
    for (int i = 0; i < 1500; i++) {
        const uint32_t seed = generator;
        add_row(&small, 0);
        generator = seed;
        add_row(&large, 10);
        const pvid_reason reason = (i < 1499) ? PVID_ACCUMULATED : PVID_UPDATED;
        assert_int_equal(pvid_estimator_update_q31(&small), reason);
        assert_int_equal(pvid_estimator_update_q31(&large), reason);
    }
    assert_true(large.information.exponent >= 1);
    for (size_t a = 0; a < PVID_MAX_P; a++) {
        const double way = (a == 1u) ? 0.5 : ((p_of(&small, a) - 0.5) / (truth[a] - 0.5));
        assert_true((way > 0.45) && (way < 0.55));
        assert_true(fabs(p_of(&small, a) - p_of(&large, a)) < 1.0e-5);
    }
}

static pvid_scaled_q31 variance_of(const pvid_estimator_q31 *estimator)
{
    const pvid_residual_q31 residual = pvid_residual_of_q31(&estimator->information);
    return pvid_assess_variance_q31(&residual, &estimator->settings, estimator->expected);
}

/* What is expected of the noise, before there are rows to tell, is in the sums' unit as well. */
static void the_expected_noise_is_in_the_unit_of_the_sums(void **state)
{
    static pvid_estimator_q31 estimator;
    assert_int_equal(pvid_estimator_init_q31(&estimator, &config), PVID_OK);
    for (uint8_t exponent = 0; exponent < 4u; exponent++) {
        estimator.information.exponent = exponent;
        const pvid_scaled_q31 expected = pvid_assess_row_variance_q31(&estimator.settings, exponent);
        assert_true(ldexp((double)expected.m, expected.e) == ldexp(4096.0, -2 * exponent));
        const pvid_scaled_q31 without_rows = variance_of(&estimator);
        assert_memory_equal(&expected, &without_rows, sizeof expected);
    }
    /* one degree of freedom is enough, less is not: five rows of weight one for four parameters */
    estimator.information.exponent = 0;
    int64_t *tail = &estimator.information.sums[estimator.information.n_sums - 2u];
    tail[0] = 1000000;
    tail[1] = (int64_t)(PVID_MAX_P + 1) << 16;
    const pvid_scaled_q31 found = variance_of(&estimator);
    assert_true(ldexp((double)found.m, found.e) == 1000000.0);
    tail[1]--;
    const pvid_scaled_q31 not_found = variance_of(&estimator);
    assert_true(ldexp((double)not_found.m, not_found.e) == 4096.0);
}

/* Of rows with noise of +-100, uniform, twice, exactly and half as much as the sensors explain, in sums of any unit. */
static void the_residuals_are_weighed_against_what_the_sensors_explain(void **state)
{
    static pvid_estimator_q31 estimator;
    pvid_estimate_q31 estimate;
    const double noise = 100.0 * 101.0 / 3.0;
    for (int k = 0; k < 6; k++) {
        start_again(NULL);
        const int32_t up = (k < 3) ? 0 : 10;
        config.row_sd <<= up;
        assert_int_equal(pvid_estimator_init_q31(&estimator, &config), PVID_OK);
        const double misfit = ldexp(1.0, 1 - (k % 3));
        const pvid_scaled_q31 expected = pvid_scaled_of_q31((int64_t)floor(ldexp(noise / misfit, (2 * up) + 8)), -8);
        for (int i = 0; i < 2000; i++) {
            add_row(&estimator, up);
            pvid_estimator_set_expected_q31(&estimator, expected);
            (void)pvid_estimator_update_q31(&estimator);
        }
        assert_true((up == 0) || (estimator.information.exponent > 0u));
        pvid_estimator_assess_q31(&estimator, &estimate);
        assert_true(fabs((estimate.misfit / 65536.0 / misfit) - 1.0) < 0.13); /* four times sqrt(2 / rows) */
        const double sd = ldexp((double)estimate.residual_sd / 256.0, -up);
        const double least = sqrt(noise / misfit);
        assert_true((sd > 0.999 * least) && (sd < 1.07 * ((misfit > 1.0) ? sqrt(noise) : least)));
    }
    const pvid_scaled_q31 before = estimator.expected;
    pvid_estimator_set_expected_q31(&estimator, pvid_scaled_of_q31(1, 60)); /* no row was taken in since */
    assert_memory_equal(&before, &estimator.expected, sizeof before);
}

/* What is expected of all rows is a mean over them that fades as they do. */
static void expected_variance_is_a_mean_over_remaining_rows(void **state)
{
    static pvid_estimator_q31 estimator;
    assert_int_equal(pvid_estimator_init_q31(&estimator, &config), PVID_OK);
    for (int i = 0; i < 100; i++) {
        add_row(&estimator, 0);
    }
    pvid_estimator_set_expected_q31(&estimator, pvid_scaled_of_q31(4000, 0));
    (void)pvid_estimator_update_q31(&estimator);
    for (size_t part = 0; part < PVID_INFORMATION_END_PARTS; part++) {
        pvid_information_fade_q31(&estimator.information, part, 1 << 30); /* a half */
    }
    assert_int_equal(estimator.information.sums[estimator.information.n_sums - 1u], (int64_t)50 << 16);
    for (int i = 0; i < 150; i++) {
        add_row(&estimator, 0);
    }
    pvid_estimator_set_expected_q31(&estimator, pvid_scaled_of_q31(2000, 0));
    assert_true(fabs(ldexp((double)estimator.expected.m, estimator.expected.e) - 2500.0) < 1.0e-3);
}

/* ---- limits ---- */

static void a_row_at_its_limit_fits(void **state)
{
    static pvid_estimator_q31 estimator;
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        config.start[i] = 0;
    }
    assert_int_equal(pvid_estimator_init_q31(&estimator, &config), PVID_OK);
    for (int sign = -1; sign <= 1; sign += 2) {
        const int32_t limit = sign * PVID_ROW_LIMIT_Q31;
        int32_t n[PVID_MAX_P] = {limit, limit, limit, limit};
        assert_int_equal(pvid_estimator_add_q31(&estimator, n, limit), PVID_ACCUMULATED);
        assert_int_equal(pvid_estimator_add_q31(&estimator, n, limit + sign), PVID_REJECTED_SATURATED);
        n[PVID_MAX_P - 1] = limit + sign;
        assert_int_equal(pvid_estimator_add_q31(&estimator, n, limit), PVID_REJECTED_SATURATED);
    }
    assert_int_equal(estimator.counters.rows, 2);
    assert_int_equal(estimator.counters.rejected_saturated, 4);
    assert_int_equal(estimator.group_rss, (int64_t)2 << 56);
    /* what a row says that is already known may be as large, and one more */
    config.start[0] = P_ONE;
    assert_int_equal(pvid_estimator_init_q31(&estimator, &config), PVID_OK);
    int32_t n[PVID_MAX_P] = {-1, 0, 0, 0};
    assert_int_equal(pvid_estimator_add_q31(&estimator, n, PVID_ROW_LIMIT_Q31), PVID_REJECTED_SATURATED);
    n[0] = 1;
    assert_int_equal(pvid_estimator_add_q31(&estimator, n, -PVID_ROW_LIMIT_Q31), PVID_REJECTED_SATURATED);
    assert_int_equal(pvid_estimator_add_q31(&estimator, n, PVID_ROW_LIMIT_Q31), PVID_ACCUMULATED);
    assert_int_equal(estimator.group_rss, ((int64_t)PVID_ROW_LIMIT_Q31 - 1) * (PVID_ROW_LIMIT_Q31 - 1));
}

static void a_place_is_held_within_the_bounds(void **state)
{
    static pvid_estimator_q31 estimator;
    assert_int_equal(pvid_estimator_init_q31(&estimator, &config), PVID_OK);
    const int64_t values[5] = {5, -5, ((int64_t)1 << 40), -((int64_t)1 << 40), 16 * P_ONE};
    const int32_t placed[5] = {5, -5, 16 * P_ONE, -16 * P_ONE, 16 * P_ONE};
    for (int i = 0; i < 5; i++) {
        pvid_estimator_place_q31(&estimator, 3, values[i]);
        assert_int_equal(estimator.p[3], placed[i]);
        assert_int_equal(estimator.theta[3], placed[i]);
        assert_int_equal(estimator.p[2], config.start[2]);
    }
}

/* The last parameter runs into its bound, and every longer step is cut short. */
static void steps_are_limited_and_bounded(void **state)
{
    static pvid_estimator_q31 estimator;
    config.upper[3] = 36 * (P_ONE / 64); /* the truth is 0.6, 38.4 of these */
    config.lower[1] = -P_ONE / 4;        /* -0.5 */
    config.step_limit = 1311;            /* a fiftieth of the start's standard deviation, 0.08 */
    assert_int_equal(pvid_estimator_init_q31(&estimator, &config), PVID_OK);
    for (int i = 0; i < 30; i++) {
        add_row(&estimator, 0);
    }
    int32_t before[PVID_MAX_P];
    uint32_t cut = 0;
    for (int i = 0; i < 30; i++) {
        memcpy(before, estimator.p, sizeof before);
        assert_int_equal(pvid_estimator_update_q31(&estimator), PVID_UPDATED);
        int32_t largest = 0;
        for (size_t a = 0; a < PVID_MAX_P; a++) {
            const int32_t step = abs(estimator.p[a] - before[a]);
            largest = (step > largest) ? step : largest;
            assert_true((estimator.p[a] >= config.lower[a]) && (estimator.p[a] <= config.upper[a]));
        }
        assert_true(largest <= 1342464 + 4); /* 0.08 in 2^-24 and Q16, and its rounding */
        cut += (largest > 1342464 - 64) ? 1u : 0u;
    }
    assert_true(cut >= 2u);
    assert_true(estimator.counters.limited >= cut);
    assert_int_equal(estimator.p[3], config.upper[3]);
    assert_int_equal(estimator.p[1], config.lower[1]);
    assert_true(estimator.counters.bounded >= 20u);
}

/* Rows whose entries resemble each other, one parameter with a bound at each side of its unconstrained value: p is the
 * minimum within the bounds, found here by projected coordinate steps in double. */
static void the_others_are_solved_beside_bounds_that_act(void **state)
{
    static pvid_estimator_q31 estimator;
    config.upper[0] = P_ONE / 2;  /* the truth is 0.75 */
    config.lower[1] = -P_ONE / 4; /* -0.5 */
    assert_int_equal(pvid_estimator_init_q31(&estimator, &config), PVID_OK);
    double m[PVID_MAX_P][PVID_MAX_P] = {{0.0}};
    double b[PVID_MAX_P] = {0.0};
    for (int row = 0; row < 60; row++) {
        int32_t n[PVID_MAX_P];
        const int32_t shared = random_within(1 << 15);
        double y = random_within(100);
        for (size_t i = 0; i < PVID_MAX_P; i++) {
            n[i] = shared + random_within(1 << 14);
            y += truth[i] * n[i];
        }
        const int32_t rounded = (int32_t)floor(y + 0.5);
        assert_int_equal(pvid_estimator_add_q31(&estimator, n, rounded), PVID_ACCUMULATED);
        for (size_t i = 0; i < PVID_MAX_P; i++) {
            b[i] += (double)n[i] * rounded;
            for (size_t j = 0; j < PVID_MAX_P; j++) {
                m[i][j] += (double)n[i] * n[j];
            }
        }
    }
    for (int i = 0; i < 40; i++) {
        assert_int_equal(pvid_estimator_update_q31(&estimator), PVID_UPDATED);
    }
    double p[PVID_MAX_P] = {0.0};
    for (int sweep = 0; sweep < 4000; sweep++) {
        for (size_t i = 0; i < PVID_MAX_P; i++) {
            double rest = b[i];
            for (size_t j = 0; j < PVID_MAX_P; j++) {
                rest -= m[i][j] * p[j];
            }
            p[i] =
                fmin(fmax(p[i] + (rest / m[i][i]), (double)config.lower[i] / P_ONE), (double)config.upper[i] / P_ONE);
        }
    }
    assert_int_equal(estimator.p[0], config.upper[0]);
    assert_int_equal(estimator.p[1], config.lower[1]);
    assert_true(fabs(p[3] - truth[3]) > 0.01); /* the bounds move it: 64 of Y over 60 rows of 2^14 are 0.0005 */
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        assert_true(fabs(p_of(&estimator, i) - p[i]) < 1.0e-4); /* an eighth of a standard error */
    }
}

static void counters_stop_at_their_end(void **state)
{
    uint32_t wide = UINT32_MAX - 2u;
    uint16_t narrow = UINT16_MAX - 2u;
    for (uint32_t i = 0; i < 4u; i++) {
        assert_int_equal(wide, (i < 2u) ? (UINT32_MAX - 2u + i) : UINT32_MAX);
        assert_int_equal(narrow, (i < 2u) ? (UINT16_MAX - 2u + i) : UINT16_MAX);
        pvid_count_up(&wide);
        pvid_count_up_16(&narrow);
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(result_is_invariant_to_row_scale),
    cmocka_unit_test_setup(the_start_weighs_the_same_beside_sums_of_any_size, start_again),
    cmocka_unit_test_setup(the_expected_noise_is_in_the_unit_of_the_sums, start_again),
    cmocka_unit_test_setup(the_residuals_are_weighed_against_what_the_sensors_explain, start_again),
    cmocka_unit_test_setup(expected_variance_is_a_mean_over_remaining_rows, start_again),
    cmocka_unit_test_setup(a_row_at_its_limit_fits, start_again),
    cmocka_unit_test_setup(a_place_is_held_within_the_bounds, start_again),
    cmocka_unit_test_setup(steps_are_limited_and_bounded, start_again),
    cmocka_unit_test_setup(the_others_are_solved_beside_bounds_that_act, start_again),
    cmocka_unit_test(counters_stop_at_their_end),
};
RUN(tests)
