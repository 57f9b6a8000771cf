/* Sine, cosine, sign and quotients in integers against the library's own in double. */
#include "test.h"

#include "pvid/elementary_q31.h"

#define ONE ((int32_t)1 << 30)

static double fixed(int32_t x, int32_t bits)
{
    return ldexp((double)x, -bits);
}

/* Every format, angles of every size in it: within 4e-9 and 1.2e-10 of the angle. */
static void errors_are_those_of_the_header(void **state)
{
    for (uint32_t bits = 0; bits <= 30u; bits++) {
        for (int64_t x = -INT32_MAX; x <= INT32_MAX; x += 2147489) {
            const int32_t given = (int32_t)x;
            const double angle = fixed(given, (int32_t)bits);
            const double bound = 4.0e-9 + (fmax(0.0, fabs(angle) - 4.0) * 1.2e-10);
            const int32_t sine = pvid_sin_q31(given, bits);
            const int32_t cosine = pvid_cos_q31(given, bits);
            assert_true(fabs(fixed(sine, 30) - sin(angle)) <= bound);
            assert_true(fabs(fixed(cosine, 30) - cos(angle)) <= bound);
            assert_true((sine <= ONE) && (sine >= -ONE) && (cosine <= ONE) && (cosine >= -ONE));
            assert_int_equal(pvid_sin_q31(-given, bits), -sine);
        }
    }
    assert_int_equal(pvid_sin_q31(0, 30), 0);
    assert_int_equal(pvid_cos_q31(0, 7), ONE);
    assert_true(fabs(fixed(pvid_sin_q31(INT32_MIN, 29), 30) - sin(-4.0)) < 4.0e-9);
}

static void signs_are_plain_or_soft(void **state)
{
    assert_int_equal(pvid_sign_q31(5), ONE);
    assert_int_equal(pvid_sign_q31(INT32_MIN), -ONE);
    assert_int_equal(pvid_sign_q31(0), 0);
    assert_int_equal(pvid_soft_sign_q31(100, 100), ONE / 2);
    assert_int_equal(pvid_soft_sign_q31(-300, 100), -(ONE / 4) * 3);
    assert_int_equal(pvid_soft_sign_q31(ONE, 1), ONE - 1);
    assert_int_equal(pvid_soft_sign_q31(0, 1), 0);
}

static void products_round_half_up_and_quotients_towards_0(void **state)
{
    assert_int_equal(pvid_fixed_product_q31(3, 1, 1), 2);
    assert_int_equal(pvid_fixed_product_q31(-3, 1, 1), -1);
    assert_int_equal(pvid_fixed_product_q31(ONE, -ONE, 30), -ONE);
    assert_int_equal(pvid_fixed_shift_q31(-5, 1), -2);
    assert_int_equal(pvid_fixed_shift_q31(-5, 0), -5);
    assert_int_equal(pvid_fixed_quotient_q31(7, 2, 0), 3);
    assert_int_equal(pvid_fixed_quotient_q31(-7, 2, 0), -3);
    assert_int_equal(pvid_fixed_quotient_q31(1, 3, 30), ONE / 3);
    assert_int_equal(pvid_fixed_quotient_q31(1, 0, 30), 0);
    assert_int_equal(pvid_fixed_magnitude_q31(-INT32_MAX), INT32_MAX);
}

static void limits_are_inclusive(void **state)
{
    static const int32_t limit[2] = {5, 7};
    static const int32_t inside[2] = {-5, 7};
    static const int32_t above[2] = {5, 8};
    static const int32_t below[2] = {-6, 0};
    assert_true(pvid_within_limits_q31(inside, limit, 2));
    assert_false(pvid_within_limits_q31(above, limit, 2));
    assert_false(pvid_within_limits_q31(below, limit, 2));
    assert_true(pvid_within_limits_q31(above, limit, 1));
}

static double value_of(pvid_scaled_q31 a)
{
    return ldexp((double)a.m, a.e);
}

static void scaled_functions_are_those_of_real_numbers(void **state)
{
    for (int32_t e = -60; e <= 0; e++) {
        for (int32_t m = 1 - ONE; m <= (ONE - 100000007); m += 100000007) {
            const pvid_scaled_q31 a = pvid_scaled_of_q31(m, e);
            const double angle = value_of(a);
            const double bound = 4.0e-9 + (fabs(angle) * 1.2e-10);
            assert_true(fabs(value_of(pvid_scaled_sin_q31(a)) - sin(angle)) <= bound);
            assert_true(fabs(value_of(pvid_scaled_cos_q31(a)) - cos(angle)) <= bound);
            assert_true(value_of(pvid_scaled_magnitude_q31(a)) == fabs(angle));
            assert_true(value_of(pvid_scaled_sign_q31(a)) == (double)((m > 0) - (m < 0)));
        }
    }
    const pvid_scaled_q31 small = pvid_scaled_of_q31(12345, -60);
    assert_true(value_of(pvid_scaled_sin_q31(small)) == value_of(small));
    assert_true(value_of(pvid_scaled_cos_q31(small)) == 1.0);
    assert_true(value_of(pvid_scaled_cos_q31(pvid_scaled_of_q31(0, 40))) == 1.0);
    assert_true(value_of(pvid_scaled_sin_q31(pvid_scaled_of_q31(1, 40))) == 0.0);
    assert_true(value_of(pvid_scaled_cos_q31(pvid_scaled_of_q31(1, 40))) == 0.0);
}

static void quotients_have_the_sign_of_both(void **state)
{
    const pvid_scaled_q31 six = pvid_scaled_of_q31(6, 0);
    const pvid_scaled_q31 minus_two = pvid_scaled_of_q31(-2, 0);
    assert_true(value_of(pvid_scaled_quotient_q31(six, minus_two)) == -3.0);
    assert_true(value_of(pvid_scaled_quotient_q31(minus_two, minus_two)) == 1.0);
    assert_true(value_of(pvid_scaled_quotient_q31(minus_two, six)) < -0.333333333);
    assert_int_equal(pvid_scaled_quotient_q31(six, pvid_scaled_of_q31(0, 0)).m, 0);
    assert_true(value_of(pvid_scaled_minus_q31(six, minus_two)) == 8.0);
}

/* Its error is that of the header, 2^-26; it is odd, and 1 far out. */
static void the_hyperbolic_tangent_is_that_of_real_numbers(void **state)
{
    static const int32_t widths[] = {1, 1000, 123456, 300000000, INT32_MAX};
    for (size_t i = 0; i < sizeof widths / sizeof widths[0]; i++) {
        const int64_t step = (widths[i] / 97) + 1;
        for (int64_t v = 0; (v <= (24 * (int64_t)widths[i])) && (v <= INT32_MAX); v += step) {
            const int32_t found = pvid_tanh_q31((int32_t)v, widths[i]);
            assert_true(fabs(fixed(found, 30) - tanh((double)v / widths[i])) <= ldexp(1.0, -26));
            assert_int_equal(pvid_tanh_q31((int32_t)-v, widths[i]), -found);
        }
    }
    assert_int_equal(pvid_tanh_q31(INT32_MAX, 1), ONE);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(errors_are_those_of_the_header),
    cmocka_unit_test(signs_are_plain_or_soft),
    cmocka_unit_test(products_round_half_up_and_quotients_towards_0),
    cmocka_unit_test(limits_are_inclusive),
    cmocka_unit_test(scaled_functions_are_those_of_real_numbers),
    cmocka_unit_test(quotients_have_the_sign_of_both),
    cmocka_unit_test(the_hyperbolic_tangent_is_that_of_real_numbers),
};
RUN(tests)
