/* The fixed-point factor and solve, against float64, and what is left where there is none. */
#include "test.h"

#include "solve/assess_q31.h"
#include "solve/cholesky_q31.h"

#define ONE 1073741824.0 /* 2^30 */

static uint32_t generator = 5u;

static double noise(void)
{
    generator = (generator * 1664525u) + 1013904223u;
    return ((double)(generator >> 8) / 8388608.0) - 1.0;
}

/* A symmetric matrix with a diagonal next to 1 and what lies off it below `off`: Q30. */
static void make(size_t n, double off, int32_t s[][PVID_MAX_P], double exact[][PVID_MAX_P])
{
    for (size_t i = 0; i < n; i++) {
        for (size_t j = i; j < n; j++) {
            s[i][j] = (i == j) ? ((1 << 30) - 1) : (int32_t)(off * noise() * ONE);
            exact[i][j] = s[i][j] / ONE;
            exact[j][i] = exact[i][j];
        }
    }
}

static void solving_returns_what_was_multiplied(void **state)
{
    for (uint8_t n = 1; n <= PVID_MAX_P; n++) {
        for (int k = 0; k < 50; k++) {
            int32_t s[PVID_MAX_P][PVID_MAX_P] = {{0}};
            double exact[PVID_MAX_P][PVID_MAX_P];
            make(n, (n <= 4u) ? 0.3 : (0.9 / (n - 1.0)), s, exact); /* the diagonal dominates */
            pvid_cholesky_q31 factor;
            assert_true(pvid_cholesky_factor_q31(&factor, n, (const int32_t (*)[PVID_MAX_P])s));
            double x[PVID_MAX_P];
            int64_t rhs[PVID_MAX_P];
            for (size_t i = 0; i < n; i++) {
                x[i] = noise();
            }
            for (size_t i = 0; i < n; i++) {
                double sum = 0.0;
                for (size_t j = 0; j < n; j++) {
                    sum += exact[i][j] * x[j];
                }
                rhs[i] = (int64_t)(sum * 1099511627776.0); /* 2^40 */
            }
            int32_t found[PVID_MAX_P];
            const int32_t exponent = pvid_cholesky_solve_q31(&factor, rhs, found);
            for (size_t i = 0; i < n; i++) {
                assert_true(fabs(ldexp((double)found[i], exponent - 40) - x[i]) < 2.0e-5); /* of 20 bits */
            }
            /* the first pivot: what is left of entry 0 once the others are eliminated */
            if (n == 2u) {
                const double left = 1.0 - (exact[0][1] * exact[0][1]);
                assert_true(fabs((factor.first_pivot / ONE) - left) < 1.0e-8);
                const int32_t least = pvid_cholesky_least_pivot_q31(&factor, (const int32_t (*)[PVID_MAX_P])s);
                assert_int_equal(least, factor.first_pivot);
            }
        }
    }
}

static void indefinite_matrix_gives_zero_first_pivot(void **state)
{
    for (uint8_t n = 2; n <= PVID_MAX_P; n++) {
        int32_t s[PVID_MAX_P][PVID_MAX_P] = {{0}};
        for (size_t i = 0; i < n; i++) {
            for (size_t j = i; j < n; j++) {
                s[i][j] = (1 << 30) - 1; /* all alike */
            }
        }
        pvid_cholesky_q31 factor;
        memset(&factor, 0x5A, sizeof factor);
        assert_false(pvid_cholesky_factor_q31(&factor, n, (const int32_t (*)[PVID_MAX_P])s));
        assert_false(factor.positive);
        assert_int_equal(factor.first_pivot, 0);
    }
}

/* No sum overflows, or the sanitizers tell: a row of ones over the identity, and a solution as large as they are. */
static void the_largest_sums_fit(void **state)
{
    int32_t s[PVID_MAX_P][PVID_MAX_P] = {{0}};
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        s[i][i] = (1 << 30) - 1;
        s[0][i] = s[i][i];
    }
    pvid_cholesky_q31 factor;
    assert_false(pvid_cholesky_factor_q31(&factor, PVID_MAX_P, (const int32_t (*)[PVID_MAX_P])s));
    const double u = sqrt(1.0 - (1.5 / 1048576.0)); /* above the least pivot */
    int64_t rhs[PVID_MAX_P];
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        for (size_t j = i + 1u; j < PVID_MAX_P; j++) {
            s[i][j] = (int32_t)(((j == PVID_MAX_P - 1u) ? u : (u * u)) * ONE);
        }
        rhs[i] = (i == PVID_MAX_P - 1u) ? 0 : INT64_MAX - 1;
    }
    assert_true(pvid_cholesky_factor_q31(&factor, PVID_MAX_P, (const int32_t (*)[PVID_MAX_P])s));
    int32_t found[PVID_MAX_P];
    (void)pvid_cholesky_solve_q31(&factor, rhs, found);
    const int32_t largest = pvid_x_max_q31(PVID_MAX_P);
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        assert_true((found[i] >= -largest) && (found[i] <= largest));
    }
}

/* The column of U^-1 of two unknowns that the data can hardly tell apart, beside others: their standard error is from
 * it.
 */
static void the_largest_column_of_an_inverse_fits(void **state)
{
    for (uint8_t n = 2; n <= PVID_MAX_P; n++) {
        int32_t s[PVID_MAX_P][PVID_MAX_P] = {{0}};
        for (size_t i = 0; i < n; i++) {
            s[i][i] = 1 << 28;
        }
        s[0][1] = (1 << 28) - 150; /* a pivot of 1.1 times the least one that is significant */
        pvid_cholesky_q31 factor;
        assert_true(pvid_cholesky_factor_q31(&factor, n, (const int32_t (*)[PVID_MAX_P])s));
        const double part = s[0][1] / (double)s[1][1];
        const int32_t one = (int32_t)1 << pvid_unit_bits_q31(n);
        const int32_t rhs[PVID_MAX_P] = {0, one};
        int32_t x[PVID_MAX_P];
        pvid_cholesky_lower_q31(&factor, rhs, x);
        assert_true(fabs((x[0] / (2.0 * one)) * sqrt((1.0 - part) * (1.0 + part)) + part) <
                    1.0e-2); /* the pivot is a difference in its 20th bit */
        assert_int_equal(x[1], 2 * one);
    }
}

static void only_eliminated_columns_are_read(void **state)
{
    int32_t s[PVID_MAX_P][PVID_MAX_P] = {{0}};
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        s[i][i] = (1 << 30) - 1;
    }
    s[PVID_MAX_P - 1][PVID_MAX_P - 1] = 0; /* the first to be eliminated */
    pvid_cholesky_q31 factor;
    memset(&factor, 0x80,
           sizeof factor); /* three squares of what stands there overflow an int64: the sanitizers tell */
    assert_false(pvid_cholesky_factor_q31(&factor, PVID_MAX_P, (const int32_t (*)[PVID_MAX_P])s));
    assert_int_equal(factor.first_pivot, 0);
}

static void a_block_keeps_its_largest_entry_in_so_many_bits(void **state)
{
    int32_t out[3];
    const int64_t nothing[3] = {0, 0, 0};
    assert_int_equal(pvid_to_block_q31(3, nothing, 30, out), -30);
    assert_int_equal(out[0], 0);
    const int64_t small[3] = {3, -1, 0};
    assert_int_equal(pvid_to_block_q31(3, small, 30, out), -28);
    assert_int_equal(out[0], 3 << 28);
    assert_int_equal(out[1], -(1 << 28));
    const int64_t large[3] = {((int64_t)1 << 40) - 1, 5, -((int64_t)1 << 39)};
    assert_int_equal(pvid_to_block_q31(3, large, 30, out), 10);
    assert_int_equal(out[0], 1 << 30); /* rounded */
    assert_int_equal(out[1], 0);
    assert_int_equal(out[2], -(1 << 29));
    out[1] = 77;
    (void)pvid_to_block_q31(1, large, 30, out); /* no further than it is told */
    assert_int_equal(out[1], 77);
}

static void a_scale_ends_at_the_widest(void **state)
{
    assert_int_equal(pvid_scale_q31(1, -61), (int64_t)1 << 61);
    const int32_t beyond[4] = {-62, -63, -64, -1000};
    for (int i = 0; i < 4; i++) {
        assert_int_equal(pvid_scale_q31(1, beyond[i]), PVID_WIDE);
        assert_int_equal(pvid_scale_q31(-1, beyond[i]), -PVID_WIDE);
        assert_int_equal(pvid_scale_q31(0, beyond[i]), 0);
    }
    assert_int_equal(pvid_scale_q31(-3, 0), -3);
    assert_int_equal(pvid_scale_q31(-3, 1), -1);
    assert_int_equal(pvid_scale_q31(PVID_WIDE, 62), 1);
    assert_int_equal(pvid_scale_q31(PVID_WIDE, 63), 1); /* a half, up */
    assert_int_equal(pvid_scale_q31(PVID_WIDE, 64), 0);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(solving_returns_what_was_multiplied),
    cmocka_unit_test(indefinite_matrix_gives_zero_first_pivot),
    cmocka_unit_test(the_largest_sums_fit),
    cmocka_unit_test(the_largest_column_of_an_inverse_fits),
    cmocka_unit_test(only_eliminated_columns_are_read),
    cmocka_unit_test(a_block_keeps_its_largest_entry_in_so_many_bits),
    cmocka_unit_test(a_scale_ends_at_the_widest),
};
RUN(tests)
