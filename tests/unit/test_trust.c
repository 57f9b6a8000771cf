/* Which estimates are published: the gate, the alarm, the way back. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pvid/pvid.h"

static pvid_estimator_f32 estimator;
static pvid_trust_f32 trust;

static int start_again(void **state)
{
    (void)state;
    pvid_estimator_config_f32 config = pvid_estimator_defaults_f32;
    config.model = &pvid_kapitza_weak_f32;
    for (int i = 0; i < 4; i++) {
        config.start[i] = (i < 3) ? (10.0f + (float)i) : 0.0f;
        config.start_sd[i] = 1.0f;
        config.lower[i] = (i < 3) ? 0.1f : -1.0f;
        config.upper[i] = 100.0f;
    }
    config.row_sd = 1.0f;
    config.update_rate_hz = 1.6f;
    assert_int_equal(pvid_estimator_init_f32(&estimator, &config), PVID_OK);
    assert_int_equal(pvid_trust_init_f32(&trust, &pvid_trust_defaults_f32, &estimator), PVID_OK);
    return 0;
}

/* An estimate with relative standard errors of `error`. */
static pvid_estimate_f32 candidate(float error, float kappa)
{
    pvid_estimate_f32 estimate;
    memset(&estimate, 0, sizeof estimate);
    for (int i = 0; i < 4; i++) {
        estimate.p[i] = 20.0f;
        estimate.se[i] = 20.0f * error;
    }
    estimate.kappa = kappa;
    estimate.least_pivot = 1.0e-2f;
    return estimate;
}

static pvid_reason judge(pvid_reason solved, float size, bool informed, float surplus, pvid_estimate_f32 estimate)
{
    return pvid_trust_judge_f32(&trust, &estimator, solved, size, informed, surplus, &estimate);
}

static pvid_reason judge_good(float surplus)
{
    return judge(PVID_UPDATED, 1.0e-5f, true, surplus, candidate(0.01f, 1.0e-2f));
}

static void the_first_groups_are_never_published(void **state)
{
    (void)state;
    assert_int_equal(judge_good(1.0f), PVID_HELD_UNCERTAIN);
    assert_int_equal(judge_good(1.0f), PVID_HELD_UNCERTAIN);
    assert_false(trust.published);
    assert_memory_equal(trust.estimate.p, estimator.p, sizeof estimator.p);
    assert_int_equal(judge_good(1.0f), PVID_UPDATED);
    assert_true(trust.published);
    assert_int_equal(estimator.counters.held_uncertain, 2);
}

static void what_is_held_leaves_the_published_estimate_and_says_why(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        (void)judge_good(1.0f);
    }
    const pvid_estimate_f32 before = trust.estimate;
    const pvid_estimate_f32 fine = candidate(0.02f, 1.0e-2f);
    assert_int_equal(judge(PVID_HELD_PIVOT, 0.0f, true, 1.0f, fine), PVID_HELD_PIVOT);
    assert_int_equal(judge(PVID_HELD_NOT_EXCITED, 0.0f, true, 1.0f, fine), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_ACCUMULATED, 0.0f, true, 1.0f, fine), PVID_ACCUMULATED);
    assert_int_equal(judge(PVID_UPDATED, 0.0f, false, 1.0f, fine), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_UPDATED, 0.0f, true, 1.0f, candidate(0.02f, 2.9e-5f)), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_UPDATED, 0.0f, true, 1.0f, candidate(0.02f, NAN)), PVID_HELD_NOT_EXCITED);
    pvid_estimate_f32 imitated = fine;
    imitated.least_pivot = 2.0e-5f; /* one mode of motion */
    assert_int_equal(judge(PVID_UPDATED, 0.0f, true, 1.0f, imitated), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_UPDATED, 0.0f, true, 1.0f, candidate(0.051f, 1.0e-2f)), PVID_HELD_UNCERTAIN);
    assert_int_equal(judge(PVID_UPDATED, 0.0f, true, 1.0f, candidate(NAN, 1.0e-2f)), PVID_HELD_UNCERTAIN);
    assert_int_equal(judge(PVID_UPDATED, 0.0061f, true, 1.0f, fine), PVID_HELD_UNCERTAIN); /* 0.3 of 2 % is 0.6 % */
    assert_memory_equal(&before, &trust.estimate, sizeof before);
    assert_int_equal(judge(PVID_UPDATED, 0.0059f, true, 1.0f, fine), PVID_UPDATED);
    assert_memory_equal(&fine, &trust.estimate, sizeof fine);
    /* a step of a ten-thousandth is small whatever the errors */
    assert_int_equal(judge(PVID_UPDATED, 9.9e-5f, true, 1.0f, candidate(1.0e-6f, 1.0e-2f)), PVID_UPDATED);
}

static void after_sixteen_refusals_p_goes_back(void **state)
{
    (void)state;
    for (int i = 0; i < 16; i++) {
        assert_null(pvid_trust_refuge_f32(&trust));
        (void)judge(PVID_HELD_NOT_EXCITED, 0.0f, true, 1.0f, candidate(1.0f, 0.0f));
    }
    assert_ptr_equal(pvid_trust_refuge_f32(&trust), trust.estimate.p);
    (void)judge(PVID_HELD_NOT_EXCITED, 0.0f, true, 1.0f, candidate(1.0f, 0.0f)); /* it went */
    assert_null(pvid_trust_refuge_f32(&trust));
}

static void a_step_ends_the_refusals(void **state)
{
    (void)state;
    for (int i = 0; i < 15; i++) {
        (void)judge(PVID_HELD_PIVOT, 0.0f, true, 1.0f, candidate(1.0f, 0.0f));
    }
    (void)judge_good(1.0f);
    (void)judge(PVID_HELD_PIVOT, 0.0f, true, 1.0f, candidate(1.0f, 0.0f));
    assert_null(pvid_trust_refuge_f32(&trust));
}

static void large_residuals_raise_the_alarm_and_small_ones_end_it(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        (void)judge_good(1000.0f); /* before the first publication p is on its way: not counted */
    }
    for (int i = 0; i < 7; i++) {
        assert_int_equal(judge_good(2.4f), PVID_UPDATED);
    }
    assert_int_equal(judge_good(2.4f), PVID_MISFIT); /* eight groups, 2.4 > 2.25 */
    assert_true(trust.published);
    assert_int_equal(estimator.counters.misfits, 1);
    int groups = 0;
    while (judge_good(0.5f) == PVID_MISFIT) {
        groups++;
    }
    assert_in_range(groups, 0, 40);
    assert_int_equal(judge_good(0.5f), PVID_UPDATED);
}

static void a_small_surplus_takes_sixteen_groups(void **state)
{
    (void)state;
    for (int i = 0; i < 3 + 15; i++) {
        assert_true(judge_good(1.6f) != PVID_MISFIT);
    }
    assert_int_equal(judge_good(1.6f), PVID_MISFIT);
}

static void what_is_expected_raises_no_alarm(void **state)
{
    (void)state;
    for (int i = 0; i < 1000; i++) {
        assert_true(judge_good(((i % 3) == 0) ? 2.0f : 1.0f) != PVID_MISFIT);
    }
}

static void a_surplus_that_is_no_number_counts_as_large(void **state)
{
    (void)state;
    for (int i = 0; i < 3 + 8; i++) {
        (void)judge_good((i < 3) ? 1.0f : NAN);
    }
    assert_int_equal(judge_good(INFINITY), PVID_MISFIT);
    assert_true(isfinite((double)trust.long_mean));
}

static void the_alarm_can_be_switched_off(void **state)
{
    (void)state;
    trust.config.misfit_max = 0.0f;
    for (int i = 0; i < 100; i++) {
        assert_true(judge_good(1.0e9f) != PVID_MISFIT);
    }
}

#define REFUSED(field, value, status)                                                                                  \
    do {                                                                                                               \
        pvid_trust_config_f32 config = pvid_trust_defaults_f32;                                                        \
        config.field = (value);                                                                                        \
        assert_int_equal(pvid_trust_init_f32(&trust, &config, &estimator), (status));                                  \
    } while (0)

static void init_names_what_it_refuses(void **state)
{
    (void)state;
    const float wrong[] = {NAN, INFINITY, -INFINITY, -1.0f};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        REFUSED(kappa_min, wrong[i], PVID_BAD_PUBLISH_KAPPA);
        REFUSED(se_max, wrong[i], PVID_BAD_SE_MAX);
        REFUSED(misfit_max, wrong[i], PVID_BAD_MISFIT_MAX);
    }
    REFUSED(kappa_min, 1.0f, PVID_BAD_PUBLISH_KAPPA);
    REFUSED(se_max, 0.0f, PVID_BAD_SE_MAX);
    REFUSED(misfit_max, 0.5f, PVID_BAD_MISFIT_MAX);
    REFUSED(misfit_max, 0.0f, PVID_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_first_groups_are_never_published, start_again),
        cmocka_unit_test_setup(what_is_held_leaves_the_published_estimate_and_says_why, start_again),
        cmocka_unit_test_setup(after_sixteen_refusals_p_goes_back, start_again),
        cmocka_unit_test_setup(a_step_ends_the_refusals, start_again),
        cmocka_unit_test_setup(large_residuals_raise_the_alarm_and_small_ones_end_it, start_again),
        cmocka_unit_test_setup(a_small_surplus_takes_sixteen_groups, start_again),
        cmocka_unit_test_setup(what_is_expected_raises_no_alarm, start_again),
        cmocka_unit_test_setup(a_surplus_that_is_no_number_counts_as_large, start_again),
        cmocka_unit_test_setup(the_alarm_can_be_switched_off, start_again),
        cmocka_unit_test_setup(init_names_what_it_refuses, start_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
