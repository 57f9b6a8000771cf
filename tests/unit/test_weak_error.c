/* The variance of an equation's own error, in both cores: when it follows the residuals, and what it does not follow.
 */
#include "test.h"

#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "number/scaled_q31.h"
#include "weak/error_f32.h"
#include "weak/error_q31.h"

/* A unit of the variance has this share of the rows' mean square, whose expectation is 1. */
#define SHARE 0.125f
#define SHARE_BITS (-3)

static pvid_weak_error_f32 error;
static pvid_weak_error_q31 error_q31;
static float left;
static int32_t left_q31;

static void make(float variance, int64_t same)
{
    const pvid_weak_error_f32 one = {.variance = variance};
    const pvid_weak_error_q31 other = {.variance = pvid_scaled_of_q31(same, 0)};
    error = one;
    error_q31 = other;
}

/* A window of both; the least variance is 2. Returns whether the fixed-point one waits for a share. */
static bool take(int64_t residual)
{
    left = pvid_weak_error_take_f32(&error, 2.0f, (float)residual, SHARE);
    const pvid_scaled_q31 least = pvid_scaled_of_q31(2, 0);
    const bool waits = pvid_weak_error_take_q31(&error_q31, least, pvid_scaled_of_q31(residual, 0));
    left_q31 = pvid_weak_error_change_q31(&error_q31, least, pvid_scaled_of_q31(1, SHARE_BITS));
    return waits;
}

/* Both have this variance, a multiple of 1/256, and nothing is left of older rows but `part`. */
static void assert_variance(float variance, float part)
{
    assert_float_equal(error.variance, variance, 1e-5f * variance);
    assert_float_equal(left, part, 1e-6f);
    assert_int_equal(pvid_scaled_fixed_q31(error_q31.variance, 8), (int64_t)(variance * 256.0f));
    assert_float_equal((float)left_q31 / 2147483648.0f, part, 1e-6f);
}

static void test_residuals_that_stay_large_raise_it(void **state)
{
    make(2.0f, 2);
    for (int i = 0; i < 3; i++) {
        assert_false(take(101));
        assert_variance(2.0f, 1.0f);
    }
    assert_true(take(101));
    assert_variance(2.0f + (100.0f * 8.0f), 1.0f / 101.0f); /* 8: 1 / SHARE */
    for (int i = 0; i < 100; i++) {                         /* with it they are white */
        assert_false(take(1));
        assert_variance(802.0f, 1.0f);
    }
}

static void test_residuals_that_are_not_far_off_leave_it_alone(void **state)
{
    make(2.0f, 2);
    for (int i = 0; i < 100; i++) {
        assert_false(take(10));
        assert_variance(2.0f, 1.0f);
    }
}

static void test_it_falls_with_them_but_not_below_the_design_s(void **state)
{
    make(7.0f, 7);
    for (int i = 0; i < 4; i++) {
        (void)take(0);
    }
    assert_variance(2.0f, 1.0f); /* 7 - 8 */
    for (int i = 0; i < 20; i++) {
        assert_false(take(0));
    }
    assert_variance(2.0f, 1.0f);
    make(802.0f, 802);
    for (int i = 0; i < 4; i++) {
        (void)take(0);
    }
    assert_variance(794.0f, 1.0f);
}

static void test_single_windows_change_nothing(void **state)
{
    make(2.0f, 2);
    for (int i = 0; i < 50; i++) {
        assert_false(take(((i % 4) == 3) ? 1000000 : 1));
        assert_variance(2.0f, 1.0f);
    }
}

static void test_what_is_no_variance_is_not_taken(void **state)
{
    make(2.0f, 2);
    for (int i = 0; i < 20; i++) {
        left = pvid_weak_error_take_f32(&error, 2.0f, 1.0e30f, 1.0e-30f);
        assert_true((left == 1.0f) && (error.variance == 2.0f));
        left = pvid_weak_error_take_f32(&error, 2.0f, 100.0f, 0.0f);
        assert_true((left == 1.0f) && (error.variance == 2.0f));
        (void)pvid_weak_error_take_q31(&error_q31, pvid_scaled_of_q31(2, 0), pvid_scaled_of_q31(100, 0));
        assert_int_equal(pvid_weak_error_change_q31(&error_q31, pvid_scaled_of_q31(2, 0), pvid_scaled_of_q31(0, 0)),
                         INT32_MAX);
        assert_int_equal(pvid_weak_error_change_q31(&error_q31, pvid_scaled_of_q31(2, 0), pvid_scaled_of_q31(1, -2000)),
                         INT32_MAX);
        assert_int_equal(pvid_scaled_fixed_q31(error_q31.variance, 0), 2);
    }
}

/* The largest mean that fixed point keeps. */
static void test_the_largest_residual_is_kept(void **state)
{
    make(2.0f, 2);
    for (int i = 0; i < 4; i++) {
        (void)pvid_weak_error_take_q31(&error_q31, pvid_scaled_of_q31(2, 0), pvid_scaled_of_q31(1, 1000));
    }
    assert_int_equal(error_q31.mean, (int32_t)1 << 29);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_residuals_that_stay_large_raise_it),
    cmocka_unit_test(test_residuals_that_are_not_far_off_leave_it_alone),
    cmocka_unit_test(test_it_falls_with_them_but_not_below_the_design_s),
    cmocka_unit_test(test_single_windows_change_nothing),
    cmocka_unit_test(test_what_is_no_variance_is_not_taken),
    cmocka_unit_test(test_the_largest_residual_is_kept),
};
RUN(tests)
