/* Sine, cosine and sign against the library's own in double. */
#include "test.h"

#include "pvid/elementary.h"

static double sine_error(float x)
{
    return fabs((double)pvid_sin_f32(x) - sin((double)x));
}

static double cosine_error(float x)
{
    return fabs((double)pvid_cos_f32(x) - cos((double)x));
}

/* Largest error over 200 001 angles of a range, evenly spaced. */
static void assert_error_below(double bound, float limit)
{
    double worst = 0.0;
    for (int32_t i = -100000; i <= 100000; i++) {
        const float x = limit * ((float)i / 100000.0f);
        worst = fmax(worst, fmax(sine_error(x), cosine_error(x)));
    }
    assert_true(worst < bound);
}

static void errors_are_those_of_the_header(void **state)
{
    assert_error_below(1.3e-7, 1.6f);
    assert_error_below(1.3e-7, 1000.0f);
    assert_error_below(3.0e-7, PVID_ANGLE_LIMIT_F32);
}

static void results_never_exceed_one(void **state)
{
    for (int32_t k = -5000; k <= 5000; k++) {
        const float x = (float)k * 1.57079633f;
        assert_true(fabsf(pvid_sin_f32(x)) <= 1.0f);
        assert_true(fabsf(pvid_cos_f32(x)) <= 1.0f);
    }
    assert_true(pvid_cos_f32(0.0f) == 1.0f);
    assert_true(pvid_sin_f32(0.0f) == 0.0f);
    assert_true(pvid_sin_f32(1.0e-30f) == 1.0e-30f);
}

static void beyond_the_limit_there_is_no_number(void **state)
{
    static const float beyond[] = {16384.002f, -16384.002f, 3.0e38f, INFINITY, -INFINITY, NAN};
    for (size_t i = 0; i < sizeof beyond / sizeof beyond[0]; i++) {
        assert_true(isnan(pvid_sin_f32(beyond[i])));
        assert_true(isnan(pvid_cos_f32(beyond[i])));
    }
    assert_false(isnan(pvid_sin_f32(-PVID_ANGLE_LIMIT_F32)));
    assert_false(isnan(pvid_cos_f32(PVID_ANGLE_LIMIT_F32)));
}

static void tanh_is_that_of_the_library_within_its_error(void **state)
{
    double worst = 0.0;
    for (int32_t i = -100000; i <= 100000; i++) {
        const float x = 9.0f * ((float)i / 100000.0f);
        worst = fmax(worst, fabs((double)pvid_tanh_f32(x) - tanh((double)x)));
        assert_true(fabsf(pvid_tanh_f32(x)) <= 1.0f);
    }
    assert_true(worst < 1.7e-6);
    assert_true(pvid_tanh_f32(0.0f) == 0.0f);
    assert_true((pvid_tanh_f32(7.0f) < 1.0f) && (pvid_tanh_f32(-7.0f) > -1.0f)); /* where the quotient ends */
    assert_true(pvid_tanh_f32(INFINITY) == 1.0f);
    assert_true(pvid_tanh_f32(-3.0e38f) == -1.0f);
    assert_true(isnan(pvid_tanh_f32(NAN)));
}

static void signs_are_plain_or_soft(void **state)
{
    assert_true(pvid_sign_f32(1.0e-40f) == 1.0f);
    assert_true(pvid_sign_f32(-3.0f) == -1.0f);
    assert_true(pvid_sign_f32(-0.0f) == 0.0f);
    assert_true(pvid_sign_f32(NAN) == 0.0f);
    assert_true(pvid_sign_f32(-INFINITY) == -1.0f);
    assert_true(pvid_soft_sign_f32(0.25f, 0.25f) == 0.5f);
    assert_true(pvid_soft_sign_f32(-0.75f, 0.25f) == -0.75f);
    assert_true(pvid_soft_sign_f32(0.0f, 0.25f) == 0.0f);
    assert_true(pvid_magnitude_f32(-2.0f) == 2.0f);
    assert_true(pvid_magnitude_f32(2.0f) == 2.0f);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(errors_are_those_of_the_header),
    cmocka_unit_test(results_never_exceed_one),
    cmocka_unit_test(beyond_the_limit_there_is_no_number),
    cmocka_unit_test(tanh_is_that_of_the_library_within_its_error),
    cmocka_unit_test(signs_are_plain_or_soft),
};
RUN(tests)
