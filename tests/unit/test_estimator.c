/* The estimator: what it refuses, what it counts, what it never does, and a model of the user's own. */
#include "test.h"

#include "solve/staged_f32.h"
#include "solve/state_f32.h"
#include "pvid/pvid.h"

#define INFINITE (3.4e38f * 10.0f)
#define NOT_A_NUMBER (INFINITE - INFINITE)

static uint32_t generator;

static float noise(void)
{
    generator = (generator * 1664525u) + 1013904223u;
    return ((float)(generator >> 8) / 8388608.0f) - 1.0f;
}

/* ---- a model of the user's own: y = a x1 + a^2 x2 + b x3, through the generic path ---- */

static void own_theta(const float p[], float theta[])
{
    theta[0] = p[0];
    theta[1] = p[0] * p[0];
    theta[2] = p[1];
}

static void own_jacobian(const float p[], float c[])
{
    c[0] = 1.0f;
    c[1] = 2.0f * p[0];
    c[2] = 1.0f;
}

static const uint8_t own_row[3] = {0, 1, 2};
static const uint8_t own_column[3] = {0, 0, 1};

static const pvid_model_f32 own_model = {
    .n_theta = 3,
    .n_p = 2,
    .n_moments = 6,
    .n_c = 3,
    .positive = 1u, /* a is positive, b is not */
    .c_row = own_row,
    .c_column = own_column,
    .theta = own_theta,
    .jacobian = own_jacobian,
};

static const float own_truth[2] = {2.0f, -0.5f};

static float own_sample(float n[3])
{
    for (int i = 0; i < 3; i++) {
        n[i] = noise();
    }
    return (own_truth[0] * n[0]) + (own_truth[0] * own_truth[0] * n[1]) + (own_truth[1] * n[2]);
}

static pvid_estimator_config_f32 own_config(void)
{
    pvid_estimator_config_f32 config = pvid_estimator_defaults_f32;
    config.model = &own_model;
    config.start[0] = 1.2f;
    config.start[1] = 0.3f;
    config.start_sd[0] = 1.0f;
    config.start_sd[1] = 1.0f;
    config.lower[0] = 0.1f;
    config.lower[1] = -10.0f;
    config.upper[0] = 10.0f;
    config.upper[1] = 10.0f;
    config.row_sd = 0.1f;
    config.update_rate_hz = 100.0f;
    return config;
}

static pvid_estimator_f32 started(const pvid_estimator_config_f32 *config)
{
    pvid_estimator_f32 estimator;
    generator = 11u;
    assert_int_equal(pvid_estimator_init_f32(&estimator, config), PVID_OK);
    return estimator;
}

static void feed(pvid_estimator_f32 *estimator, int rows)
{
    for (int i = 0; i < rows; i++) {
        float n[3];
        const float y = own_sample(n);
        (void)pvid_estimator_step_f32(estimator, n, y);
    }
}

static void own_model_is_identified(void **state)
{
    const pvid_law laws[2] = {PVID_LAW_STATIONARY, PVID_LAW_PSEUDOVELOCITY};
    const float within[2] = {1.0e-5f, 0.05f}; /* float32's rounding; (5) alone keeps part of its first error */
    for (int i = 0; i < 2; i++) {
        pvid_estimator_config_f32 config = own_config();
        config.law = laws[i];
        pvid_estimator_f32 estimator = started(&config);
        feed(&estimator, 2000);
        assert_float_equal(estimator.p[0], own_truth[0], within[i]);
        assert_float_equal(estimator.p[1], own_truth[1], within[i]);
    }
}

static void standard_errors_of_own_model_match_the_noise(void **state)
{
    /* y with uniform noise of +-0.05: sd 0.05/sqrt(3). With rows uniform in +-1, M = rows/3 I, so
     * se(b) = sd sqrt(3/rows) and se(a) = that / sqrt(1 + 4 a^2) */
    pvid_estimator_config_f32 config = own_config();
    pvid_estimator_f32 estimator = started(&config);
    const int rows = 5000;
    for (int i = 0; i < rows; i++) {
        float n[3];
        const float y = own_sample(n);
        (void)pvid_estimator_step_f32(&estimator, n, y + (0.05f * noise()));
    }
    pvid_estimate_f32 estimate;
    pvid_estimator_assess_f32(&estimator, &estimate);
    assert_float_equal(estimate.residual_sd, 0.028868f, 0.0012f);        /* 4 %: four times 1/sqrt(2 rows) */
    assert_float_equal(estimate.se[1], 0.028868f * 0.024495f, 0.00004f); /* 6 %: M itself is random */
    assert_float_equal(estimate.se[0], 0.028868f * 0.024495f / 4.1231f, 0.00001f);
    assert_float_equal(estimate.p[1], own_truth[1], 4.0f * estimate.se[1]);
}

/* Rows that fit to the last digit: what is published is no surer than the sensors allow. */
static void no_standard_error_is_smaller_than_the_sensors_allow(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    pvid_estimator_f32 estimator = started(&config);
    pvid_estimate_f32 estimate;
    feed(&estimator, 2000);
    pvid_estimator_assess_f32(&estimator, &estimate);
    assert_true(estimate.residual_sd < 1.0e-3f); /* nobody has said what the sensors explain */
    assert_true(estimate.misfit <= 0.0f);
    for (int i = 0; i < 1000; i++) { /* half as many rows again, with half the variance */
        float n[3];
        const float y = own_sample(n);
        (void)pvid_estimator_add_f32(&estimator, n, y);
        pvid_estimator_set_expected_f32(&estimator, (i < 500) ? 4.0e-4f : 2.0e-4f);
        (void)pvid_estimator_update_f32(&estimator);
    }
    /* the first 2000 rows count with what was said of them: nothing, that is 0 */
    const float explained = ((500.0f * 4.0e-4f) + (500.0f * 2.0e-4f)) / 3000.0f;
    assert_float_equal(estimator.expected, explained, 0.001f * explained);
    pvid_estimator_assess_f32(&estimator, &estimate);
    assert_float_equal(estimate.residual_sd * estimate.residual_sd, explained, 0.001f * explained);
    assert_float_equal(estimate.se[1], sqrtf(explained * (3.0f / 3000.0f)), 0.06f * sqrtf(explained * 0.001f));
    assert_true((estimate.misfit >= 0.0f) && (estimate.misfit < 0.01f));
}

static void the_misfit_is_the_residual_variance_over_what_is_explained(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    pvid_estimator_f32 estimator = started(&config);
    pvid_estimate_f32 estimate;
    for (int i = 0; i < 5000; i++) {
        float n[3];
        const float y = own_sample(n);
        (void)pvid_estimator_add_f32(&estimator, n, y + (0.05f * noise()));
        pvid_estimator_set_expected_f32(&estimator, 0.0025f / 6.0f); /* half of the noise */
        (void)pvid_estimator_update_f32(&estimator);
    }
    pvid_estimator_assess_f32(&estimator, &estimate);
    assert_float_equal(estimate.misfit, 2.0f, 0.16f); /* 8 %: four times sqrt(2 / rows) */
    assert_float_equal(estimate.residual_sd, 0.028868f, 0.0012f);
    /* what is no number, or as large as can be, does not spoil what is published */
    pvid_estimator_set_expected_f32(&estimator, NOT_A_NUMBER);
    assert_float_equal(estimator.expected, 0.0025f / 6.0f, 1.0e-6f); /* no row was taken in since */
    (void)pvid_estimator_add_f32(&estimator, (const float[3]){1.0f, 0.0f, 0.0f}, own_truth[0]);
    pvid_estimator_set_expected_f32(&estimator, INFINITE);
    pvid_estimator_assess_f32(&estimator, &estimate);
    assert_true((estimate.residual_sd > 0.0f) && (estimate.residual_sd < INFINITE));
    assert_true(estimate.misfit >= 0.0f);
}

/* A long way with large sums costs the residual its digits: what may be lost is counted, and fades as the sums do. */
static void rounding_of_long_steps_widens_the_errors(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    config.divider = 1000;
    config.step_limit = 0.9f;
    pvid_estimator_f32 estimator = started(&config);
    pvid_estimate_f32 estimate;
    feed(&estimator, 999);
    assert_true(estimator.information.rounding <= 0.0f);
    feed(&estimator, 1); /* M of 333 a column; theta goes from (1.2, 1.44, 0.3) to (2, 4, -0.5), nearly */
    const float lost = estimator.information.rounding;
    const float way = 333.0f * (0.64f + (2.56f * 2.56f) + 0.64f);
    assert_true((lost > 0.5f * 2.4e-7f * way) && (lost < 2.0f * 2.4e-7f * way));
    (void)pvid_estimator_iterate_f32(&estimator);
    (void)pvid_estimator_iterate_f32(&estimator);
    pvid_estimator_assess_f32(&estimator, &estimate);
    assert_true(estimate.residual_sd * estimate.residual_sd > 0.2f * (lost / 1000.0f)); /* rr itself may be below 0 */
    pvid_information_fade_f32(&estimator.information, 0.5f);
    assert_float_equal(estimator.information.rounding, 0.5f * lost, 0.1f * lost);
}

static void b_follows_the_estimate(void **state)
{
    /* b = sum N (Y - N^T theta) at the present theta: kept by moving, checked by summing again in double */
    enum { ROWS = 500 };
    static float n[ROWS][3], y[ROWS];
    pvid_estimator_config_f32 config = own_config();
    pvid_estimator_f32 estimator = started(&config);
    for (int i = 0; i < ROWS; i++) {
        y[i] = own_sample(n[i]) + (0.3f * noise());
        (void)pvid_estimator_step_f32(&estimator, n[i], y[i]);
    }
    float theta[3];
    own_theta(estimator.p, theta);
    double b[3] = {0.0}, rr = 0.0;
    for (int i = 0; i < ROWS; i++) {
        double e = (double)y[i];
        for (int k = 0; k < 3; k++) {
            e -= (double)n[i][k] * (double)theta[k];
        }
        rr += e * e;
        for (int k = 0; k < 3; k++) {
            b[k] += (double)n[i][k] * e;
        }
    }
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&estimator.information, sums);
    for (int k = 0; k < 3; k++) {
        /* 500 rows of size 1 moved 500 times: 500 sqrt(500) 2^-24 at random, with a margin of 4 */
        assert_float_equal(sums[6 + k], (float)b[k], 0.003f);
    }
    assert_float_equal(sums[9], (float)rr, 0.003f);
}

static void unusable_row_changes_nothing_but_its_counter(void **state)
{
    const float bad[4] = {INFINITE, -INFINITE, NOT_A_NUMBER, 2.0e14f};
    pvid_estimator_config_f32 config = own_config();
    pvid_estimator_f32 estimator = started(&config);
    feed(&estimator, 100);
    for (int place = 0; place < 4; place++) {
        for (int k = 0; k < 4; k++) {
            float n[4] = {0.1f, 0.2f, 0.3f, 0.4f};
            n[place] = bad[k];
            pvid_estimator_f32 before = estimator;
            const pvid_reason reason = pvid_estimator_step_f32(&estimator, n, n[3]);
            if (k < 3) {
                assert_int_equal(reason, PVID_REJECTED_NOT_FINITE);
                before.counters.rejected_not_finite++;
            } else {
                assert_int_equal(reason, PVID_REJECTED_SATURATED);
                before.counters.rejected_saturated++;
            }
            assert_memory_equal(&before, &estimator, sizeof estimator);
        }
    }
}

/* ---- what it does ---- */

static void divider_solves_every_third_row(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    config.divider = 3;
    config.kappa_min = 0.0f;
    pvid_estimator_f32 estimator = started(&config);
    for (int i = 1; i <= 30; i++) {
        float n[3];
        const float y = own_sample(n);
        const pvid_reason reason = pvid_estimator_step_f32(&estimator, n, y);
        assert_int_equal(reason, ((i % 3) == 0) ? PVID_UPDATED : PVID_ACCUMULATED);
    }
    assert_int_equal(estimator.counters.updates, 10);
    assert_int_equal(estimator.counters.rows, 30);
}

static void add_and_update_have_the_bits_of_step(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    config.forgetting_s = 1.0f;
    pvid_estimator_f32 one = started(&config);
    pvid_estimator_f32 two = one;
    for (int i = 0; i < 500; i++) {
        float n[3];
        const float y = own_sample(n);
        (void)pvid_estimator_step_f32(&one, n, y);
        assert_int_equal(pvid_estimator_add_f32(&two, n, y), PVID_ACCUMULATED);
        (void)pvid_estimator_update_f32(&two);
    }
    assert_memory_equal(&one, &two, sizeof one);
}

static void iterating_goes_on_to_the_least_squares_solution(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    config.divider = 100; /* one solve at the end, then more on the same sums */
    pvid_estimator_f32 estimator = started(&config);
    feed(&estimator, 100);
    const float first = estimator.p[0];
    for (int i = 0; i < 20; i++) {
        assert_int_equal(pvid_estimator_iterate_f32(&estimator), PVID_UPDATED);
    }
    assert_true((first - own_truth[0] > 1.0e-3f) || (first - own_truth[0] < -1.0e-3f));
    assert_float_equal(estimator.p[0], own_truth[0], 1.0e-5f); /* float32's rounding */
    assert_int_equal(estimator.counters.rows, 100);
}

static void no_step_is_longer_than_its_limit_and_none_leaves_the_bounds(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    config.kappa_min = 0.0f;
    config.step_limit = 0.05f;
    config.upper[0] = 1.5f; /* the truth is out of reach */
    pvid_estimator_f32 estimator = started(&config);
    for (int i = 0; i < 200; i++) {
        const float before[2] = {estimator.p[0], estimator.p[1]};
        feed(&estimator, 1);
        const float a = (estimator.p[0] - before[0]) / before[0];
        const float b = estimator.p[1] - before[1]; /* start_sd[1] is 1 */
        assert_true((a <= 0.0501f) && (a >= -0.0501f) && (b <= 0.0501f) && (b >= -0.0501f));
        assert_true(estimator.p[0] <= 1.5f);
    }
    assert_true(estimator.counters.limited > 0);
    assert_true(estimator.counters.bounded > 0);
    assert_float_equal(estimator.p[0], 1.5f, 1.0e-6f);
}

static void without_excitation_the_start_is_held(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    pvid_estimator_f32 estimator = started(&config);
    const float zero[3] = {0.0f, 0.0f, 0.0f};
    const float only_b[3] = {0.0f, 0.0f, 1.0f};
    for (int i = 0; i < 1000; i++) {
        assert_int_equal(pvid_estimator_step_f32(&estimator, zero, 0.0f), PVID_HELD_NOT_EXCITED);
        assert_int_equal(pvid_estimator_step_f32(&estimator, only_b, 5.0f), PVID_HELD_NOT_EXCITED);
    }
    assert_memory_equal(estimator.p, config.start, 2 * sizeof(float));
    assert_int_equal(estimator.counters.held_not_excited, 2000);
    feed(&estimator, 50); /* and it resumes */
    assert_true(estimator.counters.updates > 0);
}

static void estimate_before_data_is_the_start(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    pvid_estimator_f32 estimator = started(&config);
    for (int rows = 0; rows < 8; rows++) {
        const pvid_estimator_f32 before = estimator;
        pvid_estimate_f32 estimate;
        pvid_estimator_assess_f32(&estimator, &estimate);
        assert_memory_equal(&before, &estimator, sizeof estimator);
        for (int a = 0; a < 2; a++) {
            assert_true((estimate.se[a] >= 0.0f) && (estimate.se[a] <= config.start_sd[a]));
        }
        if (rows == 0) {
            assert_memory_equal(estimate.se, config.start_sd, 2 * sizeof(float));
        }
        feed(&estimator, 1);
    }
}

static void counters_stop_at_their_end(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    pvid_estimator_f32 estimator = started(&config);
    memset(&estimator.counters, 0xFF, sizeof estimator.counters);
    const pvid_counters full = estimator.counters;
    const float bad[3] = {NOT_A_NUMBER, 0.0f, 0.0f};
    feed(&estimator, 100);
    (void)pvid_estimator_step_f32(&estimator, bad, 0.0f);
    assert_memory_equal(&estimator.counters, &full, sizeof full);
}

static void a_new_init_equals_a_fresh_object(void **state)
{
    pvid_estimator_config_f32 config = own_config();
    static pvid_estimator_f32 used;
    static pvid_estimator_f32 fresh;
    used = started(&config);
    feed(&used, 777);
    assert_int_equal(pvid_estimator_init_f32(&used, &config), PVID_OK);
    assert_int_equal(pvid_estimator_init_f32(&fresh, &config), PVID_OK);
    assert_memory_equal(&used, &fresh, sizeof used);
}

/* Both parameters and theta start at 1, between 0.5 and 3. */
static pvid_estimator_config_f32 config_at_one(void)
{
    pvid_estimator_config_f32 config = own_config();
    for (int a = 0; a < 2; a++) {
        config.start[a] = 1.0f;
        config.lower[a] = 0.5f;
        config.upper[a] = 3.0f;
    }
    return config;
}

static void a_place_is_within_the_bounds_and_moves_no_more_than_p(void **state)
{
    const pvid_estimator_config_f32 config = config_at_one();
    static pvid_estimator_f32 self;
    assert_int_equal(pvid_estimator_init_f32(&self, &config), PVID_OK);
    float p[PVID_MAX_P];
    for (int a = 0; a < PVID_MAX_P; a++) {
        p[a] = 9.0f;
        self.p[a] = (a < 2) ? self.p[a] : -7.0f;
    }
    p[1] = 0.1f;
    pvid_estimator_place_f32(&self, p);
    assert_true((self.p[0] == 3.0f) && (self.p[1] == 0.5f));
    assert_true((self.theta[0] == 3.0f) && (self.theta[1] == 9.0f) && (self.theta[2] == 0.5f));
    p[0] = 1.25f;
    p[1] = NOT_A_NUMBER;
    pvid_estimator_place_f32(&self, p);
    assert_true((self.p[0] == 1.25f) && (self.p[1] == 0.5f));
    for (int a = 2; a < PVID_MAX_P; a++) {
        assert_true(self.p[a] == -7.0f);
    }
}

static void rows_of_a_group_add_their_squares(void **state)
{
    pvid_estimator_config_f32 config = config_at_one();
    config.row_weight = 0.5f;
    static pvid_estimator_f32 self;
    assert_int_equal(pvid_estimator_init_f32(&self, &config), PVID_OK);
    const float n[3] = {1.0f, 2.0f, 4.0f}; /* theta is 1, 1, 1 */
    const float e[3] = {0.5f, -3.0f, 8.0f};
    for (int k = 0; k < 3; k++) {
        assert_int_equal(pvid_estimator_add_f32(&self, n, 7.0f + e[k]), PVID_ACCUMULATED);
    }
    assert_true((self.group_rss == 73.25f) && (self.group_weight == 1.5f));
    pvid_estimator_solve_f32 solve;
    pvid_estimator_begin_f32(&self, &solve, true);
    assert_true((solve.group_rss == 73.25f) && (self.group_rss == 0.0f) && (self.group_weight == 0.0f));
}

static void a_start_s_deviation_has_its_range(void **state)
{
    static const struct {
        float start_sd;
        pvid_status status;
    } cases[] = {{1.0e-12f, PVID_OK}, {0.9e-12f, PVID_BAD_START_SD}, {1.0e12f, PVID_OK}, {1.1e12f, PVID_BAD_START_SD}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        pvid_estimator_config_f32 config = config_at_one();
        config.start_sd[1] = cases[i].start_sd; /* of b, whose steps are relative to it */
        static pvid_estimator_f32 self;
        assert_int_equal(pvid_estimator_init_f32(&self, &config), cases[i].status);
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(own_model_is_identified),
    cmocka_unit_test(standard_errors_of_own_model_match_the_noise),
    cmocka_unit_test(no_standard_error_is_smaller_than_the_sensors_allow),
    cmocka_unit_test(the_misfit_is_the_residual_variance_over_what_is_explained),
    cmocka_unit_test(rounding_of_long_steps_widens_the_errors),
    cmocka_unit_test(b_follows_the_estimate),
    cmocka_unit_test(unusable_row_changes_nothing_but_its_counter),
    cmocka_unit_test(divider_solves_every_third_row),
    cmocka_unit_test(add_and_update_have_the_bits_of_step),
    cmocka_unit_test(iterating_goes_on_to_the_least_squares_solution),
    cmocka_unit_test(no_step_is_longer_than_its_limit_and_none_leaves_the_bounds),
    cmocka_unit_test(without_excitation_the_start_is_held),
    cmocka_unit_test(estimate_before_data_is_the_start),
    cmocka_unit_test(counters_stop_at_their_end),
    cmocka_unit_test(a_new_init_equals_a_fresh_object),
    cmocka_unit_test(a_place_is_within_the_bounds_and_moves_no_more_than_p),
    cmocka_unit_test(rows_of_a_group_add_their_squares),
    cmocka_unit_test(a_start_s_deviation_has_its_range),
};
RUN(tests)
