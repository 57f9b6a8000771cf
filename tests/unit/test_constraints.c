/* Constraints of the float core, on normal equations written by hand. The library of the tests has none (config.h), so
 * the module is compiled here with room for two. */
#include "test.h"

#undef PVID_MAX_CONSTRAINTS
#define PVID_MAX_CONSTRAINTS 2

#include "solve/constraints_f32.c"

#define NOT_A_NUMBER ((3.4e38f * 10.0f) - (3.4e38f * 10.0f))

static float radius;

/* A circle of this radius in p[0], p[1]; and p[2] = p[0]. */
static void circle(const float p[], float g[])
{
    const float of_circle[4] = {((p[0] * p[0]) + (p[1] * p[1])) - (radius * fabsf(radius)), 2.0f * p[0], 2.0f * p[1],
                                0.0f};
    const float of_line[4] = {p[2] - p[0], -1.0f, 0.0f, 1.0f};
    memcpy(g, of_circle, sizeof of_circle);
    memcpy(&g[4], of_line, sizeof of_line);
}

/* p[0] + p[1] = 1 twice, the second time tenfold and by `radius` off. */
static void twice(const float p[], float g[])
{
    const float rows[8] = {
        (p[0] + p[1]) - 1.0f, 1.0f, 1.0f, 0.0f, (10.0f * ((p[0] + p[1]) - 1.0f)) + radius, 10.0f, 10.0f, 0.0f};
    memcpy(g, rows, sizeof rows);
}

static const pvid_model_f32 of_circle = {.n_theta = 3, .n_p = 3, .n_constraints = 2, .constraints = circle};
static const pvid_model_f32 of_twice = {.n_theta = 3, .n_p = 3, .n_constraints = 2, .constraints = twice};
static const pvid_solve_settings_f32 settings = {
    .start_sd = {1.0f, 1.0f, 1.0f}, .lower = {-9.0f, -9.0f, -9.0f}, .upper = {9.0f, 9.0f, 9.0f}, .n_p = 3};

static void test_a_step_with_its_return_is_newton_s(void **state)
{
    float p[3] = {3.0f, 5.0f, 2.0f};
    radius = 5.0f;
    assert_true(pvid_constraints_return_f32(&of_circle, &settings, p, 20));
    assert_true(fabsf(((p[0] * p[0]) + (p[1] * p[1])) - 25.0f) < 1.0e-5f);
    assert_true(p[2] == p[0]);
    radius = -5.0f; /* no p meets it */
    assert_false(pvid_constraints_return_f32(&of_circle, &settings, p, 20));
    for (size_t a = 0; a < 3u; a++) {
        assert_true((p[a] >= -9.0f) && (p[a] <= 9.0f));
    }
    radius = NOT_A_NUMBER;
    assert_false(pvid_constraints_return_f32(&of_circle, &settings, p, 2));
}

/* With dp = back + T z the projected equations are those of z: T^T (S dp - F) = 0 and A dp = -h, whatever the pivots.
 */
static void test_the_projected_equations_give_the_constrained_least_squares(void **state)
{
    const float p[3] = {3.0f, 4.5f, 2.9f};
    const float whole[3][3] = {{4.0f, 1.0f, 0.5f}, {1.0f, 3.0f, -0.25f}, {0.5f, -0.25f, 2.0f}};
    const float f[3] = {1.0f, -2.0f, 0.5f};
    float s[3][PVID_MAX_P];
    float force[3];
    float g[8];
    pvid_constraints_f32 ties;
    radius = 5.0f;
    for (size_t a = 0; a < 3u; a++) {
        for (size_t b = 0; b < 3u; b++) {
            s[a][b] = whole[a][b];
        }
        force[a] = f[a];
    }
    circle(p, g);
    pvid_constraints_at_f32(&ties, &of_circle, &settings, p);
    assert_int_equal(ties.count, 2);
    pvid_constraints_shift_f32(&ties, 3, (const float (*)[PVID_MAX_P])s, force);
    pvid_constraints_project_f32(&ties, 3, s, force);
    size_t free = 0;
    while (((ties.dependent >> free) & 1u) != 0u) {
        free++;
    }
    for (size_t a = 0; a < 3u; a++) {
        assert_true((a == free) || ((force[a] == 0.0f) && (s[a][a] == 0.0f)));
    }
    float dp[3] = {9.0f, 9.0f, 9.0f}; /* those of the dependent parameters are overwritten */
    dp[free] = force[free] / s[free][free];
    pvid_constraints_complete_f32(&ties, 3, dp);
    assert_true(fabsf(g[0] + (g[1] * dp[0]) + (g[2] * dp[1])) < 1.0e-5f);
    assert_true(fabsf(g[4] + dp[2] - dp[0]) < 1.0e-6f);
    float left[3]; /* S dp - F is orthogonal to the tangent (-p1, p0, -p1) */
    for (size_t a = 0; a < 3u; a++) {
        left[a] = (whole[a][0] * dp[0]) + (whole[a][1] * dp[1]) + (whole[a][2] * dp[2]) - f[a];
    }
    assert_true(fabsf((p[0] * left[1]) - (p[1] * (left[0] + left[2]))) < 1.0e-4f);
    float covariance[3][PVID_MAX_P] = {{0.0f}};
    covariance[free][free] = 1.0f / s[free][free];
    pvid_constraints_spread_f32(&ties, 3, covariance);
    assert_true(fabsf(covariance[0][0] - covariance[2][2]) < 1.0e-6f);
    assert_true(fabsf(covariance[0][0] - covariance[0][2]) < 1.0e-6f);
    assert_true(fabsf(covariance[1][1] - (covariance[0][0] * p[0] * p[0] / (p[1] * p[1]))) < 1.0e-6f);
}

static void test_redundant_constraints_are_left_out_and_contradictory_ones_never_met(void **state)
{
    float p[3] = {3.0f, 4.0f, 1.0f};
    pvid_constraints_f32 ties;
    radius = 0.0f;
    pvid_constraints_at_f32(&ties, &of_twice, &settings, p);
    assert_int_equal(ties.count, 1);
    assert_true(pvid_constraints_return_f32(&of_twice, &settings, p, 2));
    radius = 1.0f;
    assert_false(pvid_constraints_return_f32(&of_twice, &settings, p, 20));
}

static void test_a_parameter_at_its_bound_depends_last(void **state)
{
    const float p[3] = {9.0f, -8.0f, 0.0f};
    pvid_constraints_f32 ties;
    radius = 0.0f;
    pvid_constraints_at_f32(&ties, &of_twice, &settings, p);
    assert_int_equal(ties.place[0], 1);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_a_step_with_its_return_is_newton_s),
    cmocka_unit_test(test_the_projected_equations_give_the_constrained_least_squares),
    cmocka_unit_test(test_redundant_constraints_are_left_out_and_contradictory_ones_never_met),
    cmocka_unit_test(test_a_parameter_at_its_bound_depends_last),
};
RUN(tests)
