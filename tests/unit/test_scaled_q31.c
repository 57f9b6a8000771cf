/* Numbers of 30 digits and any size: each operation against what it says, in double where that is exact enough. */
#include "test.h"

#include "number/scaled_q31.h"

static double value_of(pvid_scaled_q31 a)
{
    return ldexp((double)a.m, a.e);
}

static void assert_scaled(pvid_scaled_q31 a, int32_t m, int32_t e)
{
    assert_int_equal(a.m, m);
    assert_int_equal(a.e, e);
}

/* 2^29 <= |m| <= 2^30, or 0. */
static void assert_normal(pvid_scaled_q31 a)
{
    const int64_t size = (a.m < 0) ? -(int64_t)a.m : a.m;
    assert_true((size == 0) || ((size >= ((int64_t)1 << 29)) && (size <= ((int64_t)1 << 30))));
}

static void an_integer_keeps_thirty_digits(void **state)
{
    assert_scaled(pvid_scaled_of_q31(0, 5), 0, -25);
    assert_scaled(pvid_scaled_of_q31(1, 0), 1 << 29, -29);
    assert_scaled(pvid_scaled_of_q31(-1, 7), -(1 << 29), -22);
    assert_scaled(pvid_scaled_of_q31((1 << 30) - 1, 0), (1 << 30) - 1, 0);
    assert_scaled(pvid_scaled_of_q31((int64_t)1 << 30, 0), 1 << 29, 1);
    /* what does not fit is rounded half up, and may then be 2^30 */
    assert_scaled(pvid_scaled_of_q31((((int64_t)1 << 30) + 1), 0), (1 << 29) + 1, 1);
    assert_scaled(pvid_scaled_of_q31(-(((int64_t)1 << 30) + 1), 0), -(1 << 29), 1);
    assert_scaled(pvid_scaled_of_q31(((int64_t)1 << 31) - 1, 0), 1 << 30, 1);
    assert_scaled(pvid_scaled_of_q31(PVID_WIDE, -62), 1 << 29, -29);
    assert_scaled(pvid_scaled_of_q31(-PVID_WIDE, -62), -(1 << 29), -29);
}

static void a_shift_and_a_fixed_point_are_exact(void **state)
{
    const pvid_scaled_q31 three = pvid_scaled_of_q31(3, 0);
    assert_true(value_of(pvid_scaled_shifted_q31(three, 100)) == ldexp(3.0, 100));
    assert_true(value_of(pvid_scaled_shifted_q31(three, -100)) == ldexp(3.0, -100));
    assert_int_equal(pvid_scaled_fixed_q31(three, 4), 48);
    assert_int_equal(pvid_scaled_fixed_q31(three, -1), 2); /* 1.5, half up */
    assert_int_equal(pvid_scaled_fixed_q31(pvid_scaled_of_q31(-3, 0), -1), -1);
    assert_int_equal(pvid_scaled_fixed_q31(three, -2), 1);
    assert_int_equal(pvid_scaled_fixed_q31(three, -3), 0);
    assert_int_equal(pvid_scaled_fixed_q31(three, 70), PVID_WIDE);
    assert_int_equal(pvid_scaled_fixed_q31(pvid_scaled_of_q31(-3, 0), 70), -PVID_WIDE);
}

/* Of every sign and many sizes: as near as 30 digits are. */
static void operations_are_those_of_real_numbers(void **state)
{
    static const int64_t m[] = {1, 3, 7, 1000003, 536870912, 1073741823, 4611686018427387904};
    static const int32_t e[] = {-90, -62, -31, -30, -29, -1, 0, 1, 30, 62};
    for (int i = 0; i < 70 * 70; i++) {
        const int64_t sign_a = ((i % 2) == 0) ? 1 : -1;
        const int64_t sign_b = ((i % 3) == 0) ? 1 : -1;
        const pvid_scaled_q31 a = pvid_scaled_of_q31(sign_a * m[i % 7], e[(i / 7) % 10]);
        const pvid_scaled_q31 b = pvid_scaled_of_q31(sign_b * m[(i / 70) % 7], e[(i / 490) % 10]);
        const double x = value_of(a);
        const double y = value_of(b);
        const double larger = (fabs(x) > fabs(y)) ? fabs(x) : fabs(y);
        const pvid_scaled_q31 sum = pvid_scaled_plus_q31(a, b);
        const pvid_scaled_q31 product = pvid_scaled_times_q31(a, b);
        assert_normal(sum);
        assert_normal(product);
        assert_true(fabs(value_of(sum) - (x + y)) <= ldexp(larger, -28));
        assert_true(fabs(value_of(product) - (x * y)) <= ldexp(fabs(x * y), -29));
        if (y > 0.0) {
            const pvid_scaled_q31 quotient = pvid_scaled_over_q31(a, b);
            assert_normal(quotient);
            assert_true(fabs(value_of(quotient) - (x / y)) <= ldexp(fabs(x / y), -28));
        }
        assert_int_equal(pvid_scaled_plus_q31(b, a).m, sum.m);
        assert_int_equal(pvid_scaled_plus_q31(b, a).e, sum.e);
    }
}

static void empty_input_changes_nothing(void **state)
{
    const pvid_scaled_q31 zero = pvid_scaled_of_q31(0, 1000);
    const pvid_scaled_q31 a = pvid_scaled_of_q31(-12345, 6);
    assert_scaled(pvid_scaled_plus_q31(zero, a), a.m, a.e);
    assert_scaled(pvid_scaled_plus_q31(a, zero), a.m, a.e);
    assert_int_equal(pvid_scaled_plus_q31(zero, zero).m, 0);
    assert_int_equal(pvid_scaled_times_q31(zero, a).m, 0);
    assert_int_equal(pvid_scaled_over_q31(zero, pvid_scaled_of_q31(12345, 6)).m, 0);
    assert_int_equal(pvid_scaled_plus_q31(a, pvid_scaled_of_q31(12345, 6)).m, 0);
    /* far too small to be seen beside it */
    const pvid_scaled_q31 dust = pvid_scaled_of_q31(1, -200);
    assert_scaled(pvid_scaled_plus_q31(a, dust), a.m, a.e);
}

/* 20 bits in 2^-19 of it, exponents within +-1000, 0 below. */
static void a_packed_number_keeps_twenty_bits(void **state)
{
    static const int32_t m[] = {536870912, 536872960, 805306368, 1073739776, 1073741823, -536870912, -1073739777};
    static const int32_t e[] = {0, 7, -999, -1000, 999, 31};
    for (size_t i = 0; i < sizeof m / sizeof m[0]; i++) {
        for (size_t j = 0; j < sizeof e / sizeof e[0]; j++) {
            const pvid_scaled_q31 given = {m[i], e[j]};
            const pvid_scaled_q31 back = pvid_scaled_unpacked_q31(pvid_scaled_packed_q31(given));
            assert_int_equal(back.e, e[j]);
            assert_in_range((int64_t)given.m - back.m, 0, 2047); /* rounded down */
            assert_int_equal(back.m % 2048, 0);
        }
    }
    const pvid_scaled_q31 largest = {1 << 29, 1700};
    assert_scaled(pvid_scaled_unpacked_q31(pvid_scaled_packed_q31(largest)), 1 << 29, 1000);
    const pvid_scaled_q31 vanishing = {1 << 29, -1001};
    const pvid_scaled_q31 nothing = {0, 50};
    assert_int_equal(pvid_scaled_packed_q31(vanishing), 0);
    assert_int_equal(pvid_scaled_packed_q31(nothing), 0);
    assert_int_equal(pvid_scaled_unpacked_q31(0).m, 0);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(an_integer_keeps_thirty_digits),       cmocka_unit_test(a_shift_and_a_fixed_point_are_exact),
    cmocka_unit_test(operations_are_those_of_real_numbers), cmocka_unit_test(empty_input_changes_nothing),
    cmocka_unit_test(a_packed_number_keeps_twenty_bits),
};
RUN(tests)
