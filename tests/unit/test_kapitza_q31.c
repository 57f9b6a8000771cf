/* The pendulum's physical parameters in integers, against their formulas in double. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pvid/kapitza.h"
#include "pvid/kapitza_q31.h"

#define ONE 16777216.0 /* 2^24 */
#define D_BITS 24

static pvid_estimate_q31 estimate;
static pvid_kapitza_scale_q31 scale;
static pvid_kapitza_q31 value;
static pvid_kapitza_q31 se;

/* p = (w, d1, d2) with w in 2^-20, standard errors and the correlation of d1 and d2. */
static void set_estimate(const double p[3], const double errors[3], double correlation)
{
    memset(&estimate, 0, sizeof estimate);
    const double unit[3] = {1 << 20, 1 << D_BITS, 1 << D_BITS};
    for (int i = 0; i < 3; i++) {
        estimate.p[i] = (int32_t)floor((p[i] * unit[i]) + 0.5);
        estimate.se[i] = (int32_t)floor((errors[i] * unit[i]) + 0.5);
    }
    estimate.correlation[PVID_KAPITZA_D1][PVID_KAPITZA_D2] = (int32_t)(correlation * 1073741824.0);
}

/* l1 of 0.3 m: g = w l1, w in 2^-20 and g in 2^-24. */
static int start_again(void **state)
{
    (void)state;
    const pvid_kapitza_scale_q31 fresh = {
        .l1 = (int32_t)(0.3 * ONE),
        .g_multiplier = (int32_t)(0.3 * 1073741824.0),
        .g_shift = 26,
        .d1_bits = D_BITS,
        .d2_bits = D_BITS,
    };
    const double p[3] = {31.0, 8.875, 5.625};
    const double errors[3] = {0.01, 0.002, 0.003};
    scale = fresh;
    set_estimate(p, errors, 0.75);
    return 0;
}

static bool physical(void)
{
    memset(&value, 0x5A, sizeof value);
    memset(&se, 0x5A, sizeof se);
    const pvid_kapitza_q31 before = value;
    const bool done = pvid_kapitza_physical_q31(&estimate, &scale, &value, &se);
    if (!done) {
        assert_memory_equal(&before, &value, sizeof value); /* left unwritten */
        assert_memory_equal(&before, &se, sizeof se);
    }
    return done;
}

static void assert_near(int32_t got, double expected, double relative)
{
    const double error = ((double)got / ONE) - expected;
    if (!(fabs(error) <= ((relative * fabs(expected)) + (2.0 / ONE)))) {
        fail_msg("%.9g, not %.9g", (double)got / ONE, expected);
    }
}

static void parameters_and_errors_are_the_formulas(void **state)
{
    (void)state;
    static const double cases[6][4] = {
        /* w, d1, d2, correlation */
        {31.0, 8.875, 5.625, 0.75}, {31.0, 8.875, 5.625, -0.9},  {1.5, 3.0, 1.0, 0.0},
        {400.0, 90.0, 20.0, 0.999}, {31.0, 2.0, 0.9375, -0.999}, {31.0, 40.0, 36.5, 0.5},
    };
    for (int i = 0; i < 6; i++) {
        const double *p = cases[i];
        const double errors[3] = {1.0e-2 * p[0], 1.0e-3 * p[1], 2.0e-3 * p[2]};
        set_estimate(p, errors, p[3]);
        assert_true(physical());
        const double l1 = 0.3;
        const double big = p[1] - p[2] - 1.0;
        const double l2 = l1 * big / p[2];
        const double rho2 = l1 * sqrt(big) / p[2];
        const double l2_d[2] = {l1 / p[2], -(l1 / p[2]) - (l2 / p[2])};
        const double rho2_d[2] = {rho2 / (2.0 * big), -(rho2 / (2.0 * big)) - (rho2 / p[2])};
        const double own[2] = {errors[1], errors[2]};
        double variance[2];
        for (int k = 0; k < 2; k++) {
            const double *d = (k == 0) ? l2_d : rho2_d;
            const double a = d[0] * own[0];
            const double b = d[1] * own[1];
            variance[k] = (a * a) + (b * b) + (2.0 * p[3] * a * b);
        }
        assert_near(value.g, l1 * p[0], 1.0e-6);
        assert_near(value.l2, l2, 1.0e-6);
        assert_near(value.rho2, rho2, 1.0e-6);
        /* where the two errors nearly cancel, the 29 digits of each leave some 1e-4 of their difference */
        assert_near(se.g, l1 * errors[0], 1.0e-4);
        assert_near(se.l2, sqrt(variance[0]), 2.0e-4);
        assert_near(se.rho2, sqrt(variance[1]), 2.0e-4);
    }
}

static void cancelling_errors_give_no_negative_root(void **state)
{
    (void)state;
    const double p[3] = {31.0, 8.875, 5.625};
    const double none[3] = {0.0, 0.0, 0.0};
    set_estimate(p, none, 0.0);
    assert_true(physical());
    assert_int_equal(se.g, 0);
    assert_int_equal(se.l2, 0);
    assert_int_equal(se.rho2, 0);
    /* l2 = l1 (d1 - d2 - 1)/d2: errors in the ratio d1 - 1 to d2, wholly correlated, leave l2 as it is */
    const double along[3] = {0.0, 7.875e-2, 5.625e-2};
    set_estimate(p, along, 1.0);
    assert_true(physical());
    assert_true((se.l2 >= 0) && (se.l2 <= 64));                                /* of 85 000 for either alone */
    estimate.correlation[PVID_KAPITZA_D1][PVID_KAPITZA_D2] = (1 << 30) + 1000; /* rounding may say a little more */
    assert_true(physical());
    assert_true((se.l2 >= 0) && (se.l2 <= 64));
}

static void unphysical_p_has_no_parameters(void **state)
{
    (void)state;
    assert_true(physical());
    estimate.p[PVID_KAPITZA_W] = 1;
    assert_true(physical());
    estimate.p[PVID_KAPITZA_W] = 0;
    assert_false(physical());
    estimate.p[PVID_KAPITZA_W] = -1;
    assert_false(physical());
    (void)start_again(NULL);
    estimate.p[PVID_KAPITZA_D2] = 0;
    assert_false(physical());
    estimate.p[PVID_KAPITZA_D2] = -1;
    assert_false(physical());
    (void)start_again(NULL);
    estimate.p[PVID_KAPITZA_D1] = estimate.p[PVID_KAPITZA_D2] + (1 << D_BITS); /* L2 of 0 */
    assert_false(physical());
    estimate.p[PVID_KAPITZA_D1] += 1;
    assert_true(physical());
}

static void value_beyond_its_format_is_refused(void **state)
{
    (void)state;
    scale.g_multiplier = 1 << 30;
    scale.g_shift = 30; /* g is the integer of w */
    estimate.p[PVID_KAPITZA_W] = INT32_MAX;
    assert_true(physical());
    assert_int_equal(value.g, INT32_MAX);
    scale.g_shift = 29;
    assert_false(physical());
    estimate.p[PVID_KAPITZA_W] = 1 << 30;
    assert_false(physical()); /* 2^31 */
    estimate.p[PVID_KAPITZA_W] = (1 << 30) - 1;
    assert_true(physical());
    estimate.se[PVID_KAPITZA_W] = INT32_MAX; /* errors end there instead */
    assert_true(physical());
    assert_int_equal(se.g, INT32_MAX);
    (void)start_again(NULL);
    scale.l1 = INT32_MAX; /* 128 m; l2 is L2/d2 = 0.4 of it, rho2 0.27 */
    assert_true(physical());
    const double shorter[3] = {31.0, 3.5, 1.125}; /* l2 = 1.2 l1, rho2 = 1.04 l1 */
    const double errors[3] = {0.01, 0.01, 0.01};
    set_estimate(shorter, errors, 0.0);
    assert_false(physical());
    const double slimmer[3] = {31.0, 1.71875, 0.5}; /* l2 = 0.44 l1, rho2 = 0.94 l1 */
    set_estimate(slimmer, errors, 0.0);
    assert_true(physical());
    const double equal[3] = {31.0, 3.0, 1.0}; /* l2 and rho2 of l1: as long as they may be */
    set_estimate(equal, errors, 0.0);
    assert_true(physical());
    assert_int_equal(value.l2, INT32_MAX);
    assert_int_equal(value.rho2, INT32_MAX);
    const double slim[3] = {31.0, 1.65625, 0.375}; /* l2 = 0.75 l1, rho2 = 1.41 l1 */
    set_estimate(slim, errors, 0.0);
    assert_false(physical());
    set_estimate(slimmer, errors, 0.0);
    estimate.se[PVID_KAPITZA_D2] = INT32_MAX;
    assert_true(physical());
    assert_int_equal(se.l2, INT32_MAX);
    assert_int_equal(se.rho2, INT32_MAX);
}

#define ASSERT_SCALE(field, good, bad)                                                                                 \
    do {                                                                                                               \
        (void)start_again(NULL);                                                                                       \
        estimate.p[PVID_KAPITZA_W] = 1;                                                                                \
        scale.field = (good);                                                                                          \
        (void)physical(); /* may be beyond its format */                                                               \
        scale.field = (bad);                                                                                           \
        assert_false(physical());                                                                                      \
    } while (0)

static void a_scale_out_of_its_range_is_refused(void **state)
{
    (void)state;
    ASSERT_SCALE(l1, 1, 0);
    ASSERT_SCALE(g_multiplier, 1, 0);
    ASSERT_SCALE(g_shift, 62, 63);
    ASSERT_SCALE(g_shift, -31, -32);
    ASSERT_SCALE(d1_bits, 31, 32);
    ASSERT_SCALE(d1_bits, 0, -1);
    ASSERT_SCALE(d2_bits, 31, 32);
    ASSERT_SCALE(d2_bits, 0, -1);
    /* each end of a range is taken */
    (void)start_again(NULL);
    scale.l1 = 1;
    scale.g_multiplier = 1;
    scale.g_shift = 62;
    assert_true(physical());
    assert_int_equal(value.g, 0);
    scale.g_shift = -31;
    estimate.p[PVID_KAPITZA_W] = 1;
    assert_false(physical()); /* 2^31: beyond */
    (void)start_again(NULL);
    scale.d1_bits = 0;
    scale.d2_bits = 0;
    estimate.p[PVID_KAPITZA_D1] = 9;
    estimate.p[PVID_KAPITZA_D2] = 4;
    assert_true(physical());
    assert_near(value.l2, 0.3, 1.0e-6);
    assert_near(value.rho2, 0.15, 1.0e-6);
    scale.d1_bits = 31;
    scale.d2_bits = 31;
    estimate.p[PVID_KAPITZA_D1] = INT32_MAX; /* just below 1: outside of the physical region */
    assert_false(physical());
    scale.d1_bits = 30;
    estimate.p[PVID_KAPITZA_D1] = 1879048192; /* 1.75 */
    estimate.p[PVID_KAPITZA_D2] = 1073741824; /* 0.5 */
    assert_true(physical());
    assert_near(value.l2, 0.15, 1.0e-6);
    assert_near(value.rho2, 0.3, 1.0e-6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(parameters_and_errors_are_the_formulas, start_again),
        cmocka_unit_test_setup(cancelling_errors_give_no_negative_root, start_again),
        cmocka_unit_test_setup(unphysical_p_has_no_parameters, start_again),
        cmocka_unit_test_setup(value_beyond_its_format_is_refused, start_again),
        cmocka_unit_test_setup(a_scale_out_of_its_range_is_refused, start_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
