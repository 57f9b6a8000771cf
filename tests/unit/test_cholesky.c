/* The equilibrated factorisation: its accuracy, its verdicts, and the written-out order three. */
#include "test.h"

#include "solve/cholesky_f32.h"

static uint32_t generator = 7u;

static float noise(void)
{
    generator = (generator * 1664525u) + 1013904223u;
    return ((float)(generator >> 8) / 8388608.0f) - 1.0f;
}

/* A A^T + shift, scaled by very different units. */
static void random_matrix(size_t n, float s[][PVID_MAX_P], const float unit[])
{
    float a[PVID_MAX_P][PVID_MAX_P];
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            a[i][j] = noise();
        }
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            float sum = (i == j) ? 0.1f : 0.0f;
            for (size_t k = 0; k < n; k++) {
                sum += a[i][k] * a[j][k];
            }
            s[i][j] = sum * unit[i] * unit[j];
        }
    }
}

static const float units[16] = {1.0e-6f, 3.0e4f, 1.0f, 7.0e2f, 1.0e-6f, 3.0e4f, 1.0f, 7.0e2f,
                                1.0e-6f, 3.0e4f, 1.0f, 7.0e2f, 1.0e-6f, 3.0e4f, 1.0f, 7.0e2f};

static void solving_returns_what_was_multiplied(void **state)
{
    for (int trial = 0; trial < 2000; trial++) {
        const uint8_t n = (uint8_t)(1 + (trial % PVID_MAX_P));
        float s[PVID_MAX_P][PVID_MAX_P];
        float x[PVID_MAX_P];
        float rhs[PVID_MAX_P];
        float back[PVID_MAX_P];
        random_matrix(n, s, units);
        for (size_t i = 0; i < n; i++) {
            x[i] = (1.0f + (0.5f * noise())) / units[i];
        }
        for (size_t i = 0; i < n; i++) {
            double sum = 0.0;
            for (size_t j = 0; j < n; j++) {
                sum += (double)s[i][j] * (double)x[j];
            }
            rhs[i] = (float)sum;
        }
        pvid_cholesky_f32 factor;
        assert_true(pvid_cholesky_factor_f32(&factor, n, (const float (*)[PVID_MAX_P])s));
        pvid_cholesky_solve_f32(&factor, rhs, back);
        for (size_t i = 0; i < n; i++) {
            /* equilibrated condition at most (4 n + 0.1) / 0.1 = 160: 160 ulp and a few roundings; of n = 16 640 */
            const double relative = ((double)back[i] / (double)x[i]) - 1.0;
            assert_true((relative < 1.0e-4) && (relative > -1.0e-4));
        }
    }
}

static void order_three_has_the_bits_of_the_general_order(void **state)
{
    /* A 4 x 4 matrix whose first index is decoupled eliminates its last three as a 3 x 3 one does. */
    for (int trial = 0; trial < 2000; trial++) {
        float three[PVID_MAX_P][PVID_MAX_P];
        float four[PVID_MAX_P][PVID_MAX_P];
        memset(four, 0, sizeof four);
        random_matrix(3, three, units);
        four[0][0] = 1.0f;
        for (size_t i = 0; i < 3; i++) {
            for (size_t j = 0; j < 3; j++) {
                four[i + 1][j + 1] = three[i][j];
            }
        }
        pvid_cholesky_f32 small;
        pvid_cholesky_f32 large;
        assert_true(pvid_cholesky_factor_f32(&small, 3, (const float (*)[PVID_MAX_P])three));
        assert_true(pvid_cholesky_factor_f32(&large, 4, (const float (*)[PVID_MAX_P])four));
        for (size_t i = 0; i < 3; i++) {
            assert_memory_equal(&small.scale[i], &large.scale[i + 1], sizeof(float));
            for (size_t j = i; j < 3; j++) {
                assert_memory_equal(&small.u[i][j], &large.u[i + 1][j + 1], sizeof(float));
            }
        }
    }
}

static void first_pivot_is_one_minus_r_squared(void **state)
{
    const float r = 0.8f;
    const float s[PVID_MAX_P][PVID_MAX_P] = {{4.0f, r * 6.0f}, {r * 6.0f, 9.0f}};
    pvid_cholesky_f32 factor;
    assert_true(pvid_cholesky_factor_f32(&factor, 2, s));
    assert_float_equal(factor.first_pivot, 1.0f - (r * r), 1.0e-6f); /* a few roundings of numbers near 1 */
}

static void indefinite_matrix_is_refused(void **state)
{
    const float infinity = 3.4e38f * 10.0f;
    const float nan = infinity - infinity;
    const float bad[6][3] = {
        /* s00, s01, s11 */
        {0.0f, 0.0f, 1.0f}, {1.0f, 0.0f, -1.0f},    {1.0f, 1.0f, 1.0f},
        {1.0f, 2.0f, 1.0f}, {infinity, 0.0f, 1.0f}, {1.0f, nan, 1.0f},
    };
    for (int i = 0; i < 6; i++) {
        const float s[PVID_MAX_P][PVID_MAX_P] = {{bad[i][0], bad[i][1]}, {bad[i][1], bad[i][2]}};
        pvid_cholesky_f32 factor;
        assert_false(pvid_cholesky_factor_f32(&factor, 2, s));
        assert_true(factor.first_pivot <= 0.0f);
    }
    const float singular[PVID_MAX_P][PVID_MAX_P] = {{1.0f, 1.0f, 1.0f}, {1.0f, 1.0f, 1.0f}, {1.0f, 1.0f, 1.0f}};
    pvid_cholesky_f32 factor;
    assert_false(pvid_cholesky_factor_f32(&factor, 3, singular));
}

static void scaling_a_parameter_by_a_power_of_two_scales_its_solution_exactly(void **state)
{
    for (int trial = 0; trial < 500; trial++) {
        float s[PVID_MAX_P][PVID_MAX_P];
        float scaled[PVID_MAX_P][PVID_MAX_P];
        random_matrix(3, s, units);
        const float by[3] = {1048576.0f, 1.0f, 0.0009765625f};
        float rhs[3];
        float scaled_rhs[3];
        for (size_t i = 0; i < 3; i++) {
            rhs[i] = noise() * units[i];
            scaled_rhs[i] = rhs[i] * by[i];
            for (size_t j = 0; j < 3; j++) {
                scaled[i][j] = s[i][j] * by[i] * by[j];
            }
        }
        pvid_cholesky_f32 one;
        pvid_cholesky_f32 other;
        float x[3];
        float y[3];
        assert_true(pvid_cholesky_factor_f32(&one, 3, (const float (*)[PVID_MAX_P])s));
        assert_true(pvid_cholesky_factor_f32(&other, 3, (const float (*)[PVID_MAX_P])scaled));
        pvid_cholesky_solve_f32(&one, rhs, x);
        pvid_cholesky_solve_f32(&other, scaled_rhs, y);
        for (size_t i = 0; i < 3; i++) {
            const float back = y[i] * by[i];
            assert_memory_equal(&x[i], &back, sizeof(float));
        }
    }
}

static void inverse_times_matrix_is_one(void **state)
{
    float s[PVID_MAX_P][PVID_MAX_P];
    float inverse[PVID_MAX_P][PVID_MAX_P];
    random_matrix(4, s, units);
    pvid_cholesky_f32 factor;
    assert_true(pvid_cholesky_factor_f32(&factor, 4, (const float (*)[PVID_MAX_P])s));
    pvid_cholesky_inverse_f32(&factor, inverse);
    for (size_t i = 0; i < 4; i++) {
        for (size_t j = 0; j < 4; j++) {
            double sum = 0.0;
            for (size_t k = 0; k < 4; k++) {
                sum += (double)inverse[i][k] * (double)s[k][j];
            }
            /* in the units of (i, j); condition 160, see above */
            const double error = (sum - ((i == j) ? 1.0 : 0.0)) * (double)units[i] / (double)units[j];
            assert_true((error < 1.0e-3) && (error > -1.0e-3));
        }
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(solving_returns_what_was_multiplied),
    cmocka_unit_test(order_three_has_the_bits_of_the_general_order),
    cmocka_unit_test(first_pivot_is_one_minus_r_squared),
    cmocka_unit_test(indefinite_matrix_is_refused),
    cmocka_unit_test(scaling_a_parameter_by_a_power_of_two_scales_its_solution_exactly),
    cmocka_unit_test(inverse_times_matrix_is_one),
};
RUN(tests)
