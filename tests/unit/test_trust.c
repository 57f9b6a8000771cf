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
    config.update_rate_hz = 4.2f;
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

static pvid_reason judge(pvid_reason solved, float size, bool above_noise, float variance_ratio,
                         pvid_estimate_f32 estimate)
{
    return pvid_trust_judge_f32(&trust, &estimator, solved, size, above_noise, variance_ratio, &estimate);
}

static pvid_reason judge_good(float variance_ratio)
{
    return judge(PVID_UPDATED, 1.0e-5f, true, variance_ratio, candidate(0.01f, 1.0e-2f));
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

static void held_group_keeps_the_published_estimate_with_reason(void **state)
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
        assert_null(pvid_trust_fallback_f32(&trust));
        (void)judge(PVID_HELD_NOT_EXCITED, 0.0f, true, 1.0f, candidate(1.0f, 0.0f));
    }
    assert_ptr_equal(pvid_trust_fallback_f32(&trust), trust.estimate.p);
    (void)judge(PVID_HELD_NOT_EXCITED, 0.0f, true, 1.0f, candidate(1.0f, 0.0f)); /* it went */
    assert_null(pvid_trust_fallback_f32(&trust));
}

static void a_step_ends_the_refusals(void **state)
{
    (void)state;
    for (int i = 0; i < 15; i++) {
        (void)judge(PVID_HELD_PIVOT, 0.0f, true, 1.0f, candidate(1.0f, 0.0f));
    }
    (void)judge_good(1.0f);
    (void)judge(PVID_HELD_PIVOT, 0.0f, true, 1.0f, candidate(1.0f, 0.0f));
    assert_null(pvid_trust_fallback_f32(&trust));
}

static void large_residuals_raise_the_alarm_and_small_ones_end_it(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        (void)judge_good(1000.0f); /* p is on its way: not counted */
    }
    for (int i = 0; i < 7; i++) {
        assert_int_equal(judge_good(6.4f), PVID_UPDATED);
    }
    assert_int_equal(judge_good(6.4f), PVID_MISFIT); /* eight groups, 6.4 > 6 */
    assert_true(trust.published);
    assert_int_equal(estimator.counters.misfits, 1);
    int groups = 0;
    while (judge_good(0.5f) == PVID_MISFIT) {
        groups++;
    }
    assert_in_range(groups, 0, 40);
    assert_int_equal(judge_good(0.5f), PVID_UPDATED);
}

static void small_variance_ratio_raises_after_sixteen_groups(void **state)
{
    (void)state;
    for (int i = 0; i < 3 + 15; i++) {
        assert_true(judge_good(4.2f) != PVID_MISFIT);
    }
    assert_int_equal(judge_good(4.2f), PVID_MISFIT);
}

static void expected_residuals_raise_no_alarm(void **state)
{
    (void)state;
    for (int i = 0; i < 1000; i++) {
        assert_true(judge_good(((i % 3) == 0) ? 2.0f : 1.0f) != PVID_MISFIT);
    }
}

static void nan_variance_ratio_counts_as_large(void **state)
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

/* A fit whose residuals have so many times the variance that is expected, on so many rows. */
static pvid_reason judge_fit(float misfit, int rows)
{
    pvid_estimate_f32 estimate = candidate(0.01f, 1.0e-2f);
    estimate.misfit = misfit;
    estimate.weight = (float)rows;
    return judge(PVID_UPDATED, 1.0e-5f, true, 1.0f, estimate);
}

static void rows_that_do_not_fit_raise_the_alarm_with_the_first_publication(void **state)
{
    (void)state;
    (void)judge_fit(20.0f, 20);
    (void)judge_fit(20.0f, 30);
    assert_int_equal(judge_fit(20.0f, 40), PVID_MISFIT);
    assert_int_equal(judge_fit(3.9f, 50), PVID_UPDATED); /* and end it */
    /* by chance the variance of few rows is large: 4 (1 + 3 sqrt(2 / 18)) is 8, of 196 degrees of freedom 5.21 */
    assert_int_equal(judge_fit(7.9f, 22), PVID_UPDATED);
    assert_int_equal(judge_fit(8.1f, 22), PVID_MISFIT);
    assert_int_equal(judge_fit(5.2f, 200), PVID_UPDATED);
    assert_int_equal(judge_fit(5.3f, 200), PVID_MISFIT);
}

/* Groups before which the past fades, and what is left of it. */
static int groups_of_fading(float *left)
{
    int groups = 0;
    *left = 1.0f;
    for (float fade = pvid_trust_fade_factor_f32(&trust); fade < 1.0f; fade = pvid_trust_fade_factor_f32(&trust)) {
        *left *= fade;
        groups++;
    }
    return groups;
}

static void judge_moved(float by, float misfit)
{
    estimator.p[0] = 10.0f * by;
    (void)judge_fit(misfit, 40);
}

static void rows_of_a_poor_start_fade(void **state)
{
    (void)state;
    float left;
    judge_moved(1.15f, 20.0f); /* not far from the start */
    assert_int_equal(groups_of_fading(&left), 0);
    judge_moved(1.25f, 1.0f); /* the rows agree with where p is: from here on that counts */
    assert_int_equal(groups_of_fading(&left), 0);
    judge_moved(1.45f, 20.0f);
    assert_int_equal(groups_of_fading(&left), 0);
    judge_moved(1.55f, 20.0f); /* 24 % beyond 1.25 */
    assert_int_equal(groups_of_fading(&left), 4);
    assert_true(left < 0.01f);
    judge_moved(1.2f, 20.0f); /* and 23 % below where that was */
    assert_int_equal(groups_of_fading(&left), 4);
}

static void nothing_fades_before_convergence_or_with_large_errors(void **state)
{
    (void)state;
    float left;
    pvid_estimate_f32 estimate = candidate(0.01f, 1.0e-2f);
    estimate.misfit = 20.0f;
    estimate.weight = 40.0f;
    estimator.p[0] = 15.0f;
    (void)judge(PVID_UPDATED, 0.021f, true, 1.0f, estimate); /* on its way */
    assert_int_equal(groups_of_fading(&left), 0);
    (void)judge(PVID_HELD_PIVOT, 0.0f, true, 1.0f, estimate);
    assert_int_equal(groups_of_fading(&left), 0);
    pvid_estimate_f32 vague = candidate(0.2f, 1.0e-2f);
    vague.misfit = estimate.misfit;
    vague.weight = estimate.weight;
    (void)judge(PVID_UPDATED, 1.0e-5f, true, 1.0f, vague);
    assert_int_equal(groups_of_fading(&left), 0);
    (void)judge(PVID_UPDATED, 0.019f, true, 1.0f, estimate);
    (void)judge(PVID_UPDATED, 1.0e-5f, true, 1.0f, vague); /* what is left says too little to let it fade further */
    assert_int_equal(groups_of_fading(&left), 0);
    (void)judge(PVID_UPDATED, 1.0e-5f, true, 1.0f, estimate);
    assert_int_equal(groups_of_fading(&left), 4);
    trust.config.renewal = 0.0f;
    judge_moved(5.0f, 20.0f);
    assert_int_equal(groups_of_fading(&left), 0);
}

/* What the windows told while the past faded is of an estimate that has gone. */
static void the_alarms_means_begin_anew_with_a_renewal(void **state)
{
    (void)state;
    float left;
    for (int i = 0; i < 3 + 20; i++) {
        (void)judge_good(100.0f);
    }
    assert_true(trust.misfit);
    judge_moved(1.5f, 20.0f);
    assert_int_equal(trust.judged, 0);
    assert_int_equal(groups_of_fading(&left), 4);
    assert_int_equal(judge_good(1.0f), PVID_UPDATED);
    assert_false(trust.misfit);
}

/* Where rounding may be all that is left of the residuals the sums are renewed, wherever p came from. */
static void sums_without_digits_fade(void **state)
{
    (void)state;
    float left;
    float *yy = &estimator.information.low[estimator.information.n_moments + estimator.information.n_theta];
    *yy = 1.0e-6f;
    estimator.information.rounding = 0.9e-6f;
    judge_moved(1.0f, 1.0f);
    assert_int_equal(groups_of_fading(&left), 0);
    estimator.information.rounding = 1.1e-6f;
    judge_moved(1.0f, 1.0f);
    assert_int_equal(groups_of_fading(&left), 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_first_groups_are_never_published, start_again),
        cmocka_unit_test_setup(held_group_keeps_the_published_estimate_with_reason, start_again),
        cmocka_unit_test_setup(after_sixteen_refusals_p_goes_back, start_again),
        cmocka_unit_test_setup(a_step_ends_the_refusals, start_again),
        cmocka_unit_test_setup(large_residuals_raise_the_alarm_and_small_ones_end_it, start_again),
        cmocka_unit_test_setup(small_variance_ratio_raises_after_sixteen_groups, start_again),
        cmocka_unit_test_setup(expected_residuals_raise_no_alarm, start_again),
        cmocka_unit_test_setup(nan_variance_ratio_counts_as_large, start_again),
        cmocka_unit_test_setup(rows_that_do_not_fit_raise_the_alarm_with_the_first_publication, start_again),
        cmocka_unit_test_setup(rows_of_a_poor_start_fade, start_again),
        cmocka_unit_test_setup(nothing_fades_before_convergence_or_with_large_errors, start_again),
        cmocka_unit_test_setup(the_alarms_means_begin_anew_with_a_renewal, start_again),
        cmocka_unit_test_setup(sums_without_digits_fade, start_again),
        cmocka_unit_test_setup(the_alarm_can_be_switched_off, start_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
