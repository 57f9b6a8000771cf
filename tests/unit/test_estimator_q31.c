/* The fixed-point estimator: what init refuses, rows that do not fit, a solve in stages and at once, the way back. */
#include "test.h"

#include "number/scaled_q31.h"
#include "identity_q31.h"
#include "pendulum_model_q31.h"
#include "solve/system_q31.h"

#define ONE_Q20 (1 << 20) /* of rows */
#define ONE_Q26 (1 << 26) /* of p, whose bounds end at 2^30 then */

static pvid_estimator_config_q31 config;
static pvid_estimator_q31 estimator;
static pvid_estimator_solve_q31 solve;

/* w, d1, d2 of 2, 3, 1 and c of 0. */
static int start_again(void **state)
{
    config = usual_config_q31(&pendulum_model_q31);
    for (int i = 0; i < 4; i++) {
        config.start[i] = (i < 3) ? ((i == 2) ? ONE_Q26 : ((2 + i) * ONE_Q26)) : 0;
        config.start_sd[i] = ONE_Q26;
        config.lower[i] = (i < 3) ? (ONE_Q26 / 16) : -ONE_Q26;
        config.upper[i] = 16 * ONE_Q26;
        config.p_bits[i] = 26;
    }
    for (int i = 0; i < 8; i++) {
        config.n_bits[i] = 20;
    }
    config.y_bits = 20;
    config.step_limit = 58982;
    return 0;
}

static void begin(void)
{
    assert_int_equal(pvid_estimator_init_q31(&estimator, &config), PVID_OK);
}

/* Row k of a motion that tells all parameters apart, for p = (2.2, 2.8, 1.1, 0.05) without noise. */
static void row_of(uint32_t k, int32_t n[8], int32_t *y)
{
    static const double theta[8] = {
        2.8, 2.8 * 2.2, 1.1, 1.1 * 2.2, 1.1 * 2.2 * 2.2, 1.1 * 0.05, 1.1 * 0.05 * 2.2, 1.1 * 0.05 * 2.2 * 2.2};
    double sum = 0.0;
    for (uint32_t i = 0; i < 8u; i++) {
        n[i] = (int32_t)((((k * 7u) + (i * 13u) + (k * i * i * 5u)) % 41u)) * (ONE_Q20 / 40) - (ONE_Q20 / 2);
        sum += theta[i] * n[i];
    }
    *y = (int32_t)sum;
}

static void add_rows(uint32_t first, uint32_t last)
{
    for (uint32_t k = first; k < last; k++) {
        int32_t n[8];
        int32_t y;
        row_of(k, n, &y);
        assert_int_equal(pvid_estimator_add_q31(&estimator, n, y), PVID_ACCUMULATED);
    }
}

/* Rows without noise ask for nothing once p is there: every further solve is at rest, with p and the sums as they are;
 * a zone wider than the way is not left at all. */
static void within_the_dead_zone_p_stays(void **state)
{
    config.dead_zone = 1u << 16;
    begin();
    add_rows(0, 60);
    assert_int_equal(pvid_estimator_update_q31(&estimator), PVID_UPDATED);
    assert_int_equal(estimator.counters.updates, 1);
    while (estimator.counters.in_dead_zone == 0u) {
        assert_in_range(estimator.counters.updates, 1, 20);
        assert_int_equal(pvid_estimator_iterate_q31(&estimator), PVID_UPDATED);
    }
    const pvid_estimator_q31 before = estimator;
    assert_int_equal(pvid_estimator_iterate_q31(&estimator), PVID_UPDATED);
    assert_int_equal(estimator.counters.in_dead_zone, 2);
    assert_memory_equal(estimator.p, before.p, sizeof before.p);
    assert_memory_equal(&estimator.information, &before.information, sizeof before.information);
    assert_int_equal(estimator.counters.updates, before.counters.updates);
    config.dead_zone = 100u << 16;
    config.row_sd = INT32_MAX; /* the noise that is told; what is found is less, and counts */
    begin();
    add_rows(0, 60);
    assert_int_equal(pvid_estimator_update_q31(&estimator), PVID_UPDATED);
    assert_int_equal(estimator.counters.in_dead_zone + estimator.counters.updates, 1);
}

/* With noise in the rows: wider zones are left less often. (With the paper's law F does not decay, and p may never come
 * to rest.) */
static void a_wider_dead_zone_is_left_less_often(void **state)
{
    const int32_t gains[2] = {1 << 30, 1 << 29};
    for (int i = 0; i < 2; i++) {
        uint32_t steps[3];
        for (uint32_t zone = 0; zone < 3u; zone++) {
            start_again(NULL);
            config.gain = gains[i];
            config.row_sd = 512 * 256;
            config.dead_zone = zone << 16;
            begin();
            uint32_t generator = 7u;
            for (uint32_t k = 0; k < 400u; k++) {
                int32_t n[8];
                int32_t y;
                row_of(k, n, &y);
                generator = (generator * 1664525u) + 1013904223u;
                y += (int32_t)(generator >> 21) - 1024; /* of 591 rms */
                assert_int_equal(pvid_estimator_add_q31(&estimator, n, y), PVID_ACCUMULATED);
                (void)pvid_estimator_update_q31(&estimator);
            }
            steps[zone] = estimator.counters.updates;
            assert_true((estimator.counters.in_dead_zone > 0u) == (zone > 0u));
        }
        assert_true(steps[0] > steps[1]);
        assert_true(steps[1] > steps[2]);
    }
}

static void gauss_newton_steps_end_at_the_parameters_that_made_the_rows(void **state)
{
    begin();
    add_rows(0, 100);
    assert_int_equal(pvid_estimator_update_q31(&estimator), PVID_UPDATED);
    for (int i = 0; i < 6; i++) {
        assert_int_equal(pvid_estimator_iterate_q31(&estimator), PVID_UPDATED);
    }
    static const double truth[4] = {2.2, 2.8, 1.1, 0.05};
    for (int i = 0; i < 4; i++) {
        /* float64's least squares ends 3e-7 away: Y is truncated to 2^-20 */
        const double error = ((double)estimator.p[i] / ONE_Q26) - truth[i];
        assert_true((error < 6.0e-7) && (error > -6.0e-7));
    }
}

static void a_row_beyond_its_format_changes_nothing_but_the_counter(void **state)
{
    begin();
    add_rows(0, 5);
    const pvid_estimator_q31 before = estimator;
    int32_t n[8] = {0};
    assert_int_equal(pvid_estimator_add_q31(&estimator, n, PVID_ROW_LIMIT_Q31 + 1), PVID_REJECTED_SATURATED);
    n[7] = INT32_MIN;
    assert_int_equal(pvid_estimator_add_q31(&estimator, n, 0), PVID_REJECTED_SATURATED);
    n[7] = 0;
    n[0] = PVID_ROW_LIMIT_Q31; /* fits, but not its residual of three times as much */
    assert_int_equal(pvid_estimator_add_q31(&estimator, n, 0), PVID_REJECTED_SATURATED);
    assert_int_equal(estimator.counters.rejected_saturated, 3);
    estimator.counters.rejected_saturated = 0;
    assert_memory_equal(&before, &estimator, sizeof before);
}

static void a_solve_in_stages_is_the_solve_at_once(void **state)
{
    begin();
    add_rows(0, 60);
    static pvid_estimator_q31 other;
    other = estimator;
    uint32_t stages = 0;
    pvid_estimator_begin_q31(&other, &solve, true);
    do {
        stages++;
    } while (!pvid_estimator_advance_q31(&other, &solve));
    assert_int_equal(stages, pvid_estimator_stages_q31(&other, true));
    assert_int_equal(solve.reason, pvid_estimator_update_q31(&estimator));
    assert_memory_equal(&other, &estimator, sizeof other);
    stages = 0;
    static pvid_estimate_q31 in_stages;
    static pvid_estimate_q31 at_once;
    pvid_estimator_begin_assessment_q31(&other, &solve);
    do {
        stages++;
    } while (!pvid_estimator_assess_advance_q31(&other, &solve, &in_stages));
    assert_int_equal(stages, pvid_estimator_assessment_stages_q31(&other));
    pvid_estimator_assess_q31(&estimator, &at_once);
    assert_memory_equal(&in_stages, &at_once, sizeof at_once);
    assert_memory_equal(&other, &estimator, sizeof other); /* an assessment changes nothing */
}

/* Held for want of information, p goes to its fallback, and b with it: as if the rows had been met there. */
static void p_goes_to_the_fallback_if_it_may_not_step(void **state)
{
    config.kappa_min = (1 << 30) - (1 << 21); /* no data are that good */
    begin();
    add_rows(0, 60);
    pvid_estimator_begin_q31(&estimator, &solve, true);
    const int32_t there[4] = {3 * ONE_Q26, 2 * ONE_Q26, 2 * ONE_Q26, ONE_Q26 / 8};
    solve.has_fallback = true;
    memcpy(solve.fallback, there, sizeof there);
    while (!pvid_estimator_advance_q31(&estimator, &solve)) {
    }
    assert_int_equal(solve.reason, PVID_HELD_NOT_EXCITED);
    assert_int_equal(estimator.counters.updates, 0);
    assert_memory_equal(estimator.p, there, sizeof there);
    static pvid_estimator_q31 moved;
    moved = estimator;
    memcpy(config.start, there, sizeof there);
    begin();
    add_rows(0, 60);
    for (size_t i = 36; i < 45u; i++) { /* b and rr: M dtheta has 30 digits */
        const int64_t difference = moved.information.sums[i] - estimator.information.sums[i];
        const int64_t largest = estimator.information.sums[44];
        assert_true((difference < (largest >> 20)) && (difference > -(largest >> 20)));
    }
}

/* Before there are rows the start is what is known. */
static void without_rows_the_start_is_published(void **state)
{
    begin();
    pvid_estimate_q31 estimate;
    pvid_estimator_assess_q31(&estimator, &estimate);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(estimate.p[i], config.start[i]);
        assert_in_range(estimate.se[i], config.start_sd[i] - 2, config.start_sd[i] + 2);
    }
    assert_int_equal(estimate.kappa, 0);
    assert_int_equal(estimate.least_pivot, 0);
    assert_int_equal(estimate.weight, 0);
}

static const pvid_model_q31 own_model = IDENTITY_Q31(2);

static void begin_own(void)
{
    (void)start_again(NULL);
    config.model = &own_model;
    for (int i = 0; i < 2; i++) {
        config.start[i] = ONE_Q26;
        config.start_sd[i] = ONE_Q26; /* 1: H0 is the square of row_sd, 1 */
        config.lower[i] = -8 * ONE_Q26;
        config.upper[i] = 8 * ONE_Q26;
    }
    config.row_sd = 256 * ONE_Q20;
}

/* A row that has the information `part` on p[0] and 9 on p[1]. */
static void own_row(double part)
{
    const int32_t first[2] = {(int32_t)(sqrt(part) * ONE_Q20), 0};
    const int32_t second[2] = {0, 3 * ONE_Q20};
    assert_int_equal(pvid_estimator_add_q31(&estimator, first, first[0]), PVID_ACCUMULATED);
    assert_int_equal(pvid_estimator_add_q31(&estimator, second, second[1]), PVID_ACCUMULATED);
}

/* S must exceed margin times what noise alone gives so many rows of the same weight; that of `noise_rows` is known. */
static void information_of_noise_alone_moves_nothing(void **state)
{
    const double margins[] = {0.9, 1.1};
    for (int i = 0; i < 2; i++) {
        begin_own();
        config.noise_margin = (uint32_t)(margins[i] * 65536.0);
        begin();
        estimator.noise_rows =
            4; /* twice the rows that follow: noise has 4 of p[0] in them; in the integers of Y over p */
        estimator.noise_table[0] = pvid_scaled_packed_q31(pvid_scaled_of_q31(8, -12));
        estimator.noise_table[1] = 0;
        estimator.noise_table[2] = pvid_scaled_packed_q31(pvid_scaled_of_q31(1, -12));
        own_row(4.0);
        assert_int_equal(pvid_estimator_update_q31(&estimator), (i == 0) ? PVID_UPDATED : PVID_HELD_NOT_EXCITED);
    }
}

/* kappa of p[0] times its information with the prior's must be twice the prior's, that of p[0] and of no other. */
static void p0_needs_more_information_than_its_start(void **state)
{
    const double parts[] = {0.9, 1.1};
    for (int i = 0; i < 2; i++) {
        begin_own();
        config.kappa_min = 1;
        config.start_sd[1] = ONE_Q26 / 16;
        begin();
        own_row(parts[i]);
        assert_int_equal(pvid_estimator_update_q31(&estimator), (i == 0) ? PVID_HELD_NOT_EXCITED : PVID_UPDATED);
        begin_own();
        config.kappa_min = 1;
        config.start_sd[1] = 8 * ONE_Q26;
        begin();
        own_row(parts[i]);
        assert_int_equal(pvid_estimator_update_q31(&estimator), (i == 0) ? PVID_HELD_NOT_EXCITED : PVID_UPDATED);
    }
}

/* s_ab = c_b^T (M c_a) with each product in M c_a rounded down at 2^32, in integers: no bit is missing, none is added.
 */
static void a_projection_is_exact_but_for_its_products(void **state)
{
    static const int32_t m[3] = {1073741823, -987654321, 1012345678}; /* M_11, M_12, M_22 */
    static const uint8_t row[4] = {0, 1, 0, 1};
    static const uint8_t column[4] = {0, 0, 1, 1};
    static const int32_t c[4] = {536870911, -400000003, 123456789, 500000001};
    pvid_model_q31 model = own_model;
    model.n_c = 4;
    model.c_row = row;
    model.c_column = column;
    for (size_t a = 0; a < 2u; a++) {
        int64_t s[PVID_MAX_P] = {99, 99};
        assert_int_equal(pvid_system_project_q31(&model, m, c, 2u * a, s), 2u * (a + 1u));
        for (size_t b = a; b < 2u; b++) {
            int64_t expected = 0;
            for (size_t i = 0; i < 2u; i++) {
                int64_t t = 0;
                for (size_t j = 0; j < 2u; j++) {
                    t += pvid_floor_shift_q31((int64_t)m[i + j] * c[(2u * a) + j], 32);
                }
                expected += t * c[(2u * b) + i];
            }
            assert_true(s[b] == expected);
        }
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test_setup(within_the_dead_zone_p_stays, start_again),
    cmocka_unit_test_setup(a_wider_dead_zone_is_left_less_often, start_again),
    cmocka_unit_test_setup(gauss_newton_steps_end_at_the_parameters_that_made_the_rows, start_again),
    cmocka_unit_test_setup(a_row_beyond_its_format_changes_nothing_but_the_counter, start_again),
    cmocka_unit_test_setup(a_solve_in_stages_is_the_solve_at_once, start_again),
    cmocka_unit_test_setup(p_goes_to_the_fallback_if_it_may_not_step, start_again),
    cmocka_unit_test_setup(without_rows_the_start_is_published, start_again),
    cmocka_unit_test(information_of_noise_alone_moves_nothing),
    cmocka_unit_test(p0_needs_more_information_than_its_start),
    cmocka_unit_test(a_projection_is_exact_but_for_its_products),
};
RUN(tests)
