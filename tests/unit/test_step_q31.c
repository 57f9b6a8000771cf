/* The pure functions of the fixed-point core's solve, on normal equations written by hand: no estimator, no model. */
#include "test.h"

#include "solve/assess_q31.h"
#include "solve/step_q31.h"

#define UNIT_Q16 65536

static const int32_t start[2] = {2000000, -1000000};

/* Two parameters, the first of them positive, with wide bounds and no limit that an ordinary step would meet. */
static pvid_solve_settings_q31 wide_settings(void)
{
    const pvid_solve_settings_q31 settings = {
        .start_sd = {1000000, 4000000},
        .lower = {1, -64000000},
        .upper = {64000000, 64000000},
        .row_sd = 1000 << PVID_ROW_SD_BITS,
        .gain = PVID_ONE_Q30,
        .correlation = 2 * UNIT_Q16,
        .step_limit = 58982,
        .kappa_min = PVID_ONE_Q30 / 100,
        .n_p = 2,
        .positive = 1,
    };
    return settings;
}

/* S = (8 4; 4 10), factored. The unit of s is 2^(f_a + f_b + 32) = 1. */
static pvid_system_q31 known_system(int64_t first)
{
    pvid_system_q31 system = {.s = {{first, 4}, {0, 10}}, .f = {-16, -16}};
    pvid_system_equilibrate_q31(2, (const int64_t (*)[PVID_MAX_P])system.s, system.g, system.q);
    (void)pvid_cholesky_factor_q31(&system.factor, 2, (const int32_t (*)[PVID_MAX_P])system.q);
    return system;
}

/* 34 rows of weight one, 32 degrees of freedom, and this residual. */
static pvid_residual_q31 sums_with(int64_t residual)
{
    pvid_information_q31 sums = {.n_theta = 2, .n_sums = 7};
    sums.sums[5] = residual;
    sums.sums[6] = (int64_t)34 << 16;
    return pvid_residual_of_q31(&sums);
}

static const pvid_scaled_q31 unknown = {0, 0};

/* ---- a step ---- */

static pvid_solution_q31 stepped(const pvid_solve_settings_q31 *settings, int64_t first, int64_t second, int32_t p[2])
{
    const int64_t dp[2] = {first, second};
    pvid_solution_q31 solution = {.p = p};
    pvid_step_take_q31(settings, start, dp, &solution);
    return solution;
}

static void a_step_is_added(void **state)
{
    const pvid_solve_settings_q31 settings = wide_settings();
    int32_t p[2];
    const pvid_solution_q31 solution = stepped(&settings, 1750000, -1500000, p);
    assert_int_equal(solution.size, (7 << PVID_SIZE_BITS) / 8); /* |dp|/p of the first; 0.375 start_sd of the second */
    assert_true((p[0] == 3750000) && (p[1] == -2500000));
    assert_false(solution.limited || solution.bounded);
}

/* The whole step is shortened by one factor, here 0.4375 over 0.875; its size is that before. */
static void a_large_step_is_shortened_as_a_whole(void **state)
{
    pvid_solve_settings_q31 settings = wide_settings();
    settings.step_limit = 7 * UNIT_Q16 / 16;
    int32_t p[2];
    const pvid_solution_q31 solution = stepped(&settings, 1750000, -1500000, p);
    assert_true(solution.limited && !solution.bounded);
    assert_int_equal(solution.size, (7 << PVID_SIZE_BITS) / 8);
    assert_true((p[0] == 2875000) && (p[1] == -1750000));
}

/* The largest step that a solve gives, 2^40, and the smallest reference. */
static void a_step_of_any_size_stops_at_the_bounds(void **state)
{
    pvid_solve_settings_q31 settings = wide_settings();
    settings.upper[0] = 3000000;
    settings.lower[1] = -1250000;
    int32_t p[2];
    pvid_solution_q31 solution = stepped(&settings, 1750000, -1500000, p);
    assert_true(solution.bounded && !solution.limited);
    assert_true((p[0] == 3000000) && (p[1] == -1250000));
    settings.start_sd[1] = 1;
    const int64_t most = (int64_t)1 << 40;
    solution = stepped(&settings, 0, -most, p);
    assert_true(solution.limited && (solution.size == (most << PVID_SIZE_BITS)));
    assert_true((p[0] == start[0]) && (p[1] >= settings.lower[1]) && (p[1] <= start[1]));
}

/* kappa of the first parameter is 1 - 4^2 / (8 10) = 0.8; of its 8, 6.4 are its own. */
static void excitation_is_kappa_and_more_than_the_prior(void **state)
{
    pvid_solve_settings_q31 settings = wide_settings();
    pvid_system_q31 system = known_system(8);
    assert_true(system.factor.positive);
    settings.kappa_min = (int32_t)(0.79 * PVID_ONE_Q30);
    assert_true(pvid_step_is_excited_q31(&system, &settings));
    settings.kappa_min = (int32_t)(0.81 * PVID_ONE_Q30);
    assert_false(pvid_step_is_excited_q31(&system, &settings));
    settings.kappa_min = PVID_ONE_Q30 / 2;
    system.first_prior = 3; /* twice the prior is 6 */
    assert_true(pvid_step_is_excited_q31(&system, &settings));
    system.first_prior = 4;
    assert_false(pvid_step_is_excited_q31(&system, &settings));
    settings.kappa_min = 0; /* no check */
    assert_true(pvid_step_is_excited_q31(&system, &settings));
}

/* Rank one, and no information at all. */
static void a_singular_system_has_no_factor(void **state)
{
    pvid_system_q31 system = {.s = {{16, 40}, {0, 100}}, .f = {-16, -16}};
    pvid_system_equilibrate_q31(2, (const int64_t (*)[PVID_MAX_P])system.s, system.g, system.q);
    assert_false(pvid_cholesky_factor_q31(&system.factor, 2, (const int32_t (*)[PVID_MAX_P])system.q));
    assert_false(known_system(0).factor.positive);
}

/* correlation times s^2, the smaller of 4000000/32 and row_sd^2, is 250000: a zone of half a standard error is 62500.
 */
static void the_dead_zone_is_measured_in_standard_errors(void **state)
{
    pvid_solve_settings_q31 settings = wide_settings();
    pvid_residual_q31 sums = sums_with(4000000);
    settings.dead_zone = UNIT_Q16 / 2;
    assert_true(pvid_step_is_in_dead_zone_q31(&sums, &settings, unknown, pvid_scaled_of_q31(62499, 0)));
    assert_false(pvid_step_is_in_dead_zone_q31(&sums, &settings, unknown, pvid_scaled_of_q31(62501, 0)));
    sums = sums_with(4000000000000); /* larger residuals widen the zone up to row_sd^2 alone */
    assert_true(pvid_step_is_in_dead_zone_q31(&sums, &settings, unknown, pvid_scaled_of_q31(499999, 0)));
    assert_false(pvid_step_is_in_dead_zone_q31(&sums, &settings, unknown, pvid_scaled_of_q31(500001, 0)));
}

/* ---- an assessment ---- */

static void the_residual_gives_the_variance(void **state)
{
    const pvid_solve_settings_q31 settings = wide_settings();
    const pvid_scaled_q31 expected = pvid_scaled_of_q31(62500, 0);
    pvid_residual_q31 sums = sums_with(4000000);
    pvid_estimate_q31 estimate;
    pvid_scaled_q31 variance;
    pvid_root_q31 wide;
    pvid_assess_residual_q31(&sums, &settings, expected, &variance, &wide, &estimate);
    assert_float_equal(ldexp(variance.m, variance.e), 125000.0, 0.001);
    assert_float_equal(ldexp(wide.r, wide.e), 500.0, 0.00001);
    assert_int_equal(estimate.residual_sd, 90510); /* sqrt(125000) 2^8, rounded */
    assert_int_equal(estimate.misfit, 2 * UNIT_Q16);
    assert_int_equal(estimate.weight, 34);
    sums.residual = 1000000; /* less than the sensors explain */
    pvid_assess_residual_q31(&sums, &settings, expected, &variance, &wide, &estimate);
    assert_float_equal(ldexp(variance.m, variance.e), 62500.0, 0.001);
    assert_int_equal(estimate.misfit, UNIT_Q16 / 2);
    sums.weight = (int64_t)2 << 16; /* no degree of freedom: row_sd^2 */
    pvid_assess_residual_q31(&sums, &settings, expected, &variance, &wide, &estimate);
    assert_float_equal(ldexp(variance.m, variance.e), 1.0e6, 0.01);
    assert_int_equal(estimate.misfit, 0);
}

static pvid_estimate_q31 assessed(pvid_system_q31 *system, const pvid_solve_settings_q31 *settings)
{
    pvid_inverse_q31 inverse = {.wide = {1000000 << 10, -10}};
    pvid_estimate_q31 estimate;
    memset(&estimate, 0, sizeof estimate);
    pvid_assess_widen_q31(system, settings, inverse.wide);
    pvid_system_equilibrate_q31(2, (const int64_t (*)[PVID_MAX_P])system->s, system->g, system->q);
    (void)pvid_cholesky_factor_q31(&system->factor, 2, (const int32_t (*)[PVID_MAX_P])system->q);
    for (size_t a = 0; a < 2u; a++) {
        pvid_assess_invert_q31(&system->factor, a, &inverse);
        pvid_assess_errors_q31(system, settings, &inverse, a, &estimate);
    }
    return estimate;
}

/* Covariance = wide^2 (S + wide^2 / start_sd^2)^-1, the root of wide^2 is 10^6: (9 4; 4 11)^-1 with equal start_sd. */
static void the_covariance_is_the_inverse_of_the_information(void **state)
{
    pvid_solve_settings_q31 settings = wide_settings();
    settings.start_sd[1] = 1000000;
    pvid_system_q31 system = known_system(8);
    const pvid_estimate_q31 estimate = assessed(&system, &settings);
    assert_float_equal(estimate.se[0], 1.0e6 * sqrt(11.0 / 83.0), 2.0);
    assert_float_equal(estimate.se[1], 1.0e6 * sqrt(9.0 / 83.0), 2.0);
    assert_float_equal(estimate.correlation[0][1] / (double)PVID_ONE_Q30, -4.0 / sqrt(99.0), 1.0e-6);
    assert_int_equal(estimate.correlation[0][1], estimate.correlation[1][0]);
    assert_true((estimate.correlation[0][0] == PVID_ONE_Q30) && (estimate.correlation[1][1] == PVID_ONE_Q30));
}

/* A start that says nothing beside a singular S: the errors are start_sd. */
static void without_a_factor_the_errors_are_those_of_the_start(void **state)
{
    pvid_solve_settings_q31 settings = wide_settings();
    settings.start_sd[0] = INT32_MAX;
    settings.start_sd[1] = INT32_MAX;
    pvid_system_q31 system = known_system(0);
    const pvid_estimate_q31 estimate = assessed(&system, &settings);
    assert_true((estimate.se[0] == INT32_MAX) && (estimate.se[1] == INT32_MAX));
    assert_true((estimate.correlation[0][1] == 0) && (estimate.correlation[1][1] == PVID_ONE_Q30));
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(a_step_is_added),
    cmocka_unit_test(a_large_step_is_shortened_as_a_whole),
    cmocka_unit_test(a_step_of_any_size_stops_at_the_bounds),
    cmocka_unit_test(excitation_is_kappa_and_more_than_the_prior),
    cmocka_unit_test(a_singular_system_has_no_factor),
    cmocka_unit_test(the_dead_zone_is_measured_in_standard_errors),
    cmocka_unit_test(the_residual_gives_the_variance),
    cmocka_unit_test(the_covariance_is_the_inverse_of_the_information),
    cmocka_unit_test(without_a_factor_the_errors_are_those_of_the_start),
};
RUN(tests)
