/* The pure functions of the float core's solve, on normal equations written by hand: no estimator, no model, no sums.
 */
#include "test.h"

#include "solve/assess_f32.h"
#include "solve/step_f32.h"

#define INFINITE (3.4e38f * 10.0f)
#define NOT_A_NUMBER (INFINITE - INFINITE)

static const float start[2] = {2.0f, -1.0f};

/* Two parameters, the first of them positive, with wide bounds and no limit that an ordinary step would meet. */
static pvid_solve_settings_f32 wide_settings(void)
{
    const pvid_solve_settings_f32 settings = {
        .prior = {0.0f, 0.0f},
        .start_sd = {1.0f, 4.0f},
        .lower = {0.125f, -64.0f},
        .upper = {64.0f, 64.0f},
        .row_variance = 0.25f,
        .gain = 1.0f,
        .correlation = 2.0f,
        .step_limit = 0.9f,
        .kappa_min = 1.0e-5f,
        .noise_margin = 16.0f,
        .n_p = 2,
        .positive = 1,
    };
    return settings;
}

/* S = (8 4; 4 10), F = (8, -8): dp = (1.75, -1.5). 34 rows, so 32 degrees of freedom, with a residual of 4. */
static pvid_system_f32 known_system(void)
{
    const pvid_system_f32 system = {
        .s = {{8.0f, 4.0f}, {0.0f, 10.0f}},
        .force = {8.0f, -8.0f},
        .rss = 4.0f,
        .weight = 34.0f,
    };
    return system;
}

static pvid_solution_f32 solved(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings, float p[2])
{
    pvid_cholesky_f32 factor;
    pvid_solution_f32 solution = {.p = p};
    memcpy(p, start, sizeof start);
    solution.reason = pvid_step_factor_f32(system, settings, &factor);
    if (solution.reason == PVID_UPDATED) {
        pvid_step_take_f32(system, settings, &factor, 0, start, system->force, &solution);
    }
    return solution;
}

/* ---- a step ---- */

static void a_step_solves_the_equations(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    const pvid_system_f32 system = known_system();
    float p[2];
    const pvid_solution_f32 solution = solved(&system, &settings, p);
    assert_int_equal(solution.reason, PVID_UPDATED);
    assert_float_equal(solution.size, 0.875f, 1.0e-6f); /* |dp|/p of the first, |dp|/start_sd of the second: 0.375 */
    assert_float_equal(p[0], 3.75f, 1.0e-6f);
    assert_float_equal(p[1], -2.5f, 1.0e-6f);
    assert_false(solution.limited || solution.bounded || solution.in_dead_zone);
}

static void the_right_hand_side_may_differ_from_the_force(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    const pvid_system_f32 system = known_system();
    const float rhs[2] = {4.0f, -4.0f};
    float p[2];
    pvid_cholesky_f32 factor;
    pvid_solution_f32 solution = {.p = p};
    assert_int_equal(pvid_step_factor_f32(&system, &settings, &factor), PVID_UPDATED);
    pvid_step_take_f32(&system, &settings, &factor, 0, start, rhs, &solution);
    assert_float_equal(p[0], 2.875f, 1.0e-6f);
    assert_float_equal(p[1], -1.75f, 1.0e-6f);
}

static void a_step_in_place_is_the_same(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    const pvid_system_f32 system = known_system();
    float p[2];
    float in_place[2] = {start[0], start[1]};
    pvid_cholesky_f32 factor;
    pvid_solution_f32 solution = {.p = in_place};
    (void)solved(&system, &settings, p);
    assert_int_equal(pvid_step_factor_f32(&system, &settings, &factor), PVID_UPDATED);
    pvid_step_take_f32(&system, &settings, &factor, 0, in_place, system.force, &solution);
    assert_memory_equal(p, in_place, sizeof p);
}

/* The whole step is shortened by one factor, here 0.4375 over 0.875; its size is that before. */
static void a_large_step_is_shortened_as_a_whole(void **state)
{
    pvid_solve_settings_f32 settings = wide_settings();
    settings.step_limit = 0.4375f;
    const pvid_system_f32 system = known_system();
    float p[2];
    const pvid_solution_f32 solution = solved(&system, &settings, p);
    assert_true(solution.limited && !solution.bounded);
    assert_float_equal(solution.size, 0.875f, 1.0e-6f);
    assert_float_equal(p[0], 2.875f, 1.0e-6f);
    assert_float_equal(p[1], -1.75f, 1.0e-6f);
}

/* S = (8 4; 4 10) with the second at its lower bound and F = (8, -8), which pulls it outwards: the first alone, 8/8. */
static void a_parameter_that_is_pulled_out_of_its_bound_is_pinned(void **state)
{
    pvid_solve_settings_f32 settings = wide_settings();
    settings.lower[1] = start[1];
    pvid_system_f32 system = known_system();
    float p[2] = {start[0], start[1]};
    pvid_cholesky_f32 factor;
    pvid_solution_f32 solution = {.p = p};
    const uint8_t pinned = pvid_step_pin_f32(&system, &settings, p);
    assert_int_equal(pinned, 2);
    assert_int_equal(pvid_step_factor_f32(&system, &settings, &factor), PVID_UPDATED);
    pvid_step_take_f32(&system, &settings, &factor, pinned, start, system.force, &solution);
    assert_float_equal(p[0], 3.0f, 3.0e-6f);
    assert_float_equal(p[1], start[1], 0.0f);
    assert_true(solution.bounded);
    assert_int_equal(solution.blocked, 0);
    system = known_system();
    system.force[1] = 8.0f; /* inwards: nothing is pinned */
    assert_int_equal(pvid_step_pin_f32(&system, &settings, start), 0);
    assert_float_equal(system.s[1][1], 10.0f, 0.0f);
}

/* F = (8, 2) pulls the second inwards, and dp = (1.125, -0.25) outwards: no step; the next solve pins it. */
static void a_step_that_leaves_a_bound_waits_for_the_next_solve(void **state)
{
    pvid_solve_settings_f32 settings = wide_settings();
    settings.lower[1] = start[1];
    pvid_system_f32 system = known_system();
    system.force[1] = 2.0f;
    float p[2];
    const pvid_solution_f32 solution = solved(&system, &settings, p);
    assert_int_equal(solution.reason, PVID_UPDATED);
    assert_int_equal(solution.blocked, 2);
    assert_float_equal(solution.size, 0.5625f, 1.0e-6f); /* of the step that is not taken: p has not converged */
    assert_memory_equal(p, start, sizeof p);
    settings.blocked = solution.blocked;
    assert_int_equal(pvid_step_pin_f32(&system, &settings, p), 2);
    settings.gain = 0.0f; /* equation (5) alone: the step, clamped */
    system.s[1][1] = 10.0f;
    assert_int_equal(solved(&system, &settings, p).blocked, 0);
    assert_float_equal(p[0], 3.125f, 1.0e-6f);
    assert_float_equal(p[1], start[1], 0.0f);
}

static void a_step_stops_at_the_bounds(void **state)
{
    pvid_solve_settings_f32 settings = wide_settings();
    settings.upper[0] = 3.0f;
    settings.lower[1] = -1.25f;
    const pvid_system_f32 system = known_system();
    float p[2];
    const pvid_solution_f32 solution = solved(&system, &settings, p);
    assert_true(solution.bounded && !solution.limited);
    assert_true((p[0] == 3.0f) && (p[1] == -1.25f));
}

static void a_singular_system_holds_p(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    pvid_system_f32 system = known_system();
    system.s[0][0] = 1.6f; /* 4^2 / 10: rank one */
    float p[2];
    assert_int_equal(solved(&system, &settings, p).reason, PVID_HELD_SINGULAR);
    assert_memory_equal(p, start, sizeof start);
    memset(system.s, 0, sizeof system.s);
    assert_int_equal(solved(&system, &settings, p).reason, PVID_HELD_SINGULAR);
}

static void a_number_that_is_none_holds_p(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    const float bad[3] = {NOT_A_NUMBER, INFINITE, -INFINITE};
    float p[2];
    for (size_t k = 0; k < 3u; k++) {
        for (size_t a = 0; a < 2u; a++) {
            for (size_t b = a; b < 2u; b++) {
                pvid_system_f32 system = known_system();
                system.s[a][b] = bad[k];
                assert_int_equal(solved(&system, &settings, p).reason, PVID_HELD_SINGULAR);
            }
            pvid_system_f32 system = known_system();
            system.force[a] = bad[k];
            const pvid_solution_f32 solution = solved(&system, &settings, p);
            assert_int_equal(solution.reason, PVID_HELD_SINGULAR);
            assert_true(solution.size == 0.0f);
            assert_memory_equal(p, start, sizeof start);
        }
    }
}

/* kappa of the first parameter is 1 - 4^2 / (8 10) = 0.8. */
static void too_little_excitation_holds_p(void **state)
{
    const pvid_system_f32 system = known_system();
    float p[2];
    pvid_solve_settings_f32 settings = wide_settings();
    settings.kappa_min = 0.79f;
    assert_int_equal(solved(&system, &settings, p).reason, PVID_UPDATED);
    settings.kappa_min = 0.81f;
    assert_int_equal(solved(&system, &settings, p).reason, PVID_HELD_NOT_EXCITED);
    assert_memory_equal(p, start, sizeof start);
    /* of the 8 of S + H0, 6.4 are its own: twice the prior is less, or more */
    settings.kappa_min = 0.5f;
    settings.prior[0] = 3.1f;
    assert_int_equal(solved(&system, &settings, p).reason, PVID_UPDATED);
    settings.prior[0] = 3.3f;
    assert_int_equal(solved(&system, &settings, p).reason, PVID_HELD_NOT_EXCITED);
    settings.kappa_min = 0.0f; /* no check */
    assert_int_equal(solved(&system, &settings, p).reason, PVID_UPDATED);
}

/* F^T S^-1 F = 8 1.75 + 8 1.5 = 26; correlation times s^2, the smaller of 4/32 and 0.25, is 0.25. */
static void no_step_is_taken_in_the_dead_zone(void **state)
{
    pvid_solve_settings_f32 settings = wide_settings();
    pvid_system_f32 system = known_system();
    float p[2];
    settings.dead_zone = 103.0f;
    assert_false(solved(&system, &settings, p).in_dead_zone);
    settings.dead_zone = 105.0f;
    const pvid_solution_f32 solution = solved(&system, &settings, p);
    assert_true(solution.in_dead_zone && (solution.reason == PVID_UPDATED) && (solution.size == 0.0f));
    assert_memory_equal(p, start, sizeof start);
    /* larger residuals widen the zone up to row_sd^2 alone: 26 <= zone 2 0.25 */
    system.rss = 4000.0f;
    settings.dead_zone = 51.0f;
    assert_false(solved(&system, &settings, p).in_dead_zone);
    settings.dead_zone = 53.0f;
    assert_true(solved(&system, &settings, p).in_dead_zone);
}

/* ---- an assessment ---- */

/* Covariance = (S / (2 s^2) + 1 / start_sd^2)^-1 with s^2 = 4/32: 4 S + diag(1, 1/16) = (33 16; 16 40.0625). */
static void the_covariance_is_the_inverse_of_the_information(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    pvid_system_f32 system = known_system();
    pvid_estimate_f32 estimate;
    pvid_assess_f32(&system, &settings, &estimate);
    const double det = (33.0 * 40.0625) - 256.0;
    assert_float_equal(estimate.covariance[0][0], 40.0625 / det, 1.0e-8);
    assert_float_equal(estimate.covariance[1][1], 33.0 / det, 1.0e-8);
    assert_float_equal(estimate.covariance[0][1], -16.0 / det, 1.0e-8);
    assert_true(estimate.covariance[0][1] == estimate.covariance[1][0]);
    assert_float_equal(estimate.se[0], sqrt(40.0625 / det), 1.0e-7);
    assert_float_equal(estimate.se[1], sqrt(33.0 / det), 1.0e-7);
    assert_float_equal(estimate.kappa, 0.8f, 1.0e-6f);
    assert_float_equal(estimate.least_pivot, 0.8f, 1.0e-6f);
    assert_float_equal(estimate.residual_sd, sqrt(0.125), 1.0e-7);
    assert_true(estimate.weight == 34.0f);
}

static void without_information_the_errors_are_those_of_the_start(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    const float bad[4] = {0.0f, NOT_A_NUMBER, INFINITE, -8.0f};
    for (size_t k = 0; k < 4u; k++) {
        pvid_system_f32 system = known_system();
        system.s[0][0] = bad[k];
        system.s[0][1] = 0.0f;
        system.s[1][1] = bad[k];
        pvid_estimate_f32 estimate;
        pvid_assess_f32(&system, &settings, &estimate);
        assert_float_equal(estimate.se[0], 1.0f, 1.0e-6f);
        assert_float_equal(estimate.se[1], 4.0f, 4.0e-6f);
        assert_float_equal(estimate.covariance[1][1], 16.0f, 1.6e-5f);
        assert_true((estimate.covariance[0][1] == 0.0f) && (estimate.kappa == 0.0f) && (estimate.least_pivot == 0.0f));
    }
}

/* An inverse that overflows, and one whose diagonal is negative: rounding beyond what the limits of the settings allow.
 */
static void a_covariance_that_is_none_is_not_published(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    const float inverse[3][2] = {{INFINITE, 1.0f}, {1.0f, -1.0f}, {1.0f, NOT_A_NUMBER}};
    for (size_t k = 0; k < 3u; k++) {
        pvid_estimate_f32 estimate = {.covariance = {{inverse[k][0], 0.5f}, {0.5f, inverse[k][1]}}};
        pvid_assess_scale_f32(&settings, 2.0f, true, &estimate);
        assert_true((estimate.se[0] == 1.0f) && (estimate.se[1] == 4.0f) && (estimate.covariance[0][1] == 0.0f));
        assert_true((estimate.covariance[0][0] == 1.0f) && (estimate.covariance[1][1] == 16.0f));
    }
}

static void the_variance_has_its_limits(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    pvid_system_f32 system = known_system();
    assert_true(pvid_assess_variance_f32(&system, &settings) == 0.125f);
    system.rounding = 4.0f; /* counts as residual */
    assert_true(pvid_assess_variance_f32(&system, &settings) == 0.25f);
    system.floor = 16.0f;
    assert_true(pvid_assess_variance_f32(&system, &settings) == 0.5f);
    system.rss = NOT_A_NUMBER;
    assert_true(pvid_assess_variance_f32(&system, &settings) == (PVID_RESIDUAL_MAX / 32.0f));
    system.weight = 2.5f; /* no whole degree of freedom: row_sd^2 */
    assert_true(pvid_assess_variance_f32(&system, &settings) == 0.25f);
}

static void the_misfit_compares_the_residual_with_its_floor(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    pvid_system_f32 system = known_system();
    assert_true(pvid_assess_misfit_f32(&system, &settings) == 0.0f); /* no expectation */
    system.floor = 2.0f;
    system.rounding = 100.0f; /* no part of it */
    assert_true(pvid_assess_misfit_f32(&system, &settings) == 2.0f);
    system.rss = INFINITE;
    assert_true(pvid_assess_misfit_f32(&system, &settings) == PVID_RESIDUAL_MAX);
    system.rss = NOT_A_NUMBER;
    assert_true(pvid_assess_misfit_f32(&system, &settings) == 0.0f);
    system = known_system();
    system.floor = 2.0f;
    system.weight = 2.0f;
    assert_true(pvid_assess_misfit_f32(&system, &settings) == 0.0f);
}

/* 16 x 0.5 x 34 = 272 times the noise of a row; the least eigenvalue of S is 9 - sqrt(17), 0.0179 times that. */
static void information_is_compared_with_that_of_noise(void **state)
{
    const pvid_solve_settings_f32 settings = wide_settings();
    const pvid_system_f32 system = known_system();
    float little[PVID_MAX_P][PVID_MAX_P] = {{0.0175f, 0.0f}, {0.0f, 0.0175f}};
    float much[PVID_MAX_P][PVID_MAX_P] = {{0.0185f, 0.0f}, {0.0f, 0.0185f}};
    float none[PVID_MAX_P][PVID_MAX_P] = {{NOT_A_NUMBER, 0.0f}, {0.0f, 0.0f}};
    assert_true(pvid_assess_above_noise_f32(&system, &settings, 0.5f, (const float (*)[PVID_MAX_P])little));
    assert_false(pvid_assess_above_noise_f32(&system, &settings, 0.5f, (const float (*)[PVID_MAX_P])much));
    assert_false(pvid_assess_above_noise_f32(&system, &settings, 0.5f, (const float (*)[PVID_MAX_P])none));
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(a_step_solves_the_equations),
    cmocka_unit_test(the_right_hand_side_may_differ_from_the_force),
    cmocka_unit_test(a_step_in_place_is_the_same),
    cmocka_unit_test(a_large_step_is_shortened_as_a_whole),
    cmocka_unit_test(a_parameter_that_is_pulled_out_of_its_bound_is_pinned),
    cmocka_unit_test(a_step_that_leaves_a_bound_waits_for_the_next_solve),
    cmocka_unit_test(a_step_stops_at_the_bounds),
    cmocka_unit_test(a_singular_system_holds_p),
    cmocka_unit_test(a_number_that_is_none_holds_p),
    cmocka_unit_test(too_little_excitation_holds_p),
    cmocka_unit_test(no_step_is_taken_in_the_dead_zone),
    cmocka_unit_test(the_covariance_is_the_inverse_of_the_information),
    cmocka_unit_test(without_information_the_errors_are_those_of_the_start),
    cmocka_unit_test(a_covariance_that_is_none_is_not_published),
    cmocka_unit_test(the_variance_has_its_limits),
    cmocka_unit_test(the_misfit_compares_the_residual_with_its_floor),
    cmocka_unit_test(information_is_compared_with_that_of_noise),
};
RUN(tests)
