/* Which estimates of the fixed-point core are published: the gate, the alarm, the way back. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pvid/pvid_q31.h"

#define PER_CENT(x) ((x) / 100.0)

static pvid_estimator_q31 estimator;
static pvid_trust_q31 trust;

/* The defaults of trust.h: 3e-5, 5 %, 4, 3, 16, 20 %. */
static const pvid_trust_config_q31 defaults = {32212, 838861, 262144, 3, 16, 13107};

static int64_t q24(double x)
{
    return (int64_t)(x * 16777216.0);
}

static int64_t size(double x)
{
    return (int64_t)(x * 4194304.0);
}

static int start_again(void **state)
{
    (void)state;
    pvid_estimator_config_q31 config = {.model = &pvid_kapitza_weak_q31,
                                        .row_sd = 256,
                                        .gain = 1 << 30,
                                        .correlation = 1u << 16,
                                        .row_weight = 1u << 16,
                                        .step_limit = 19661,
                                        .divider = 1};
    for (int i = 0; i < 4; i++) {
        config.start[i] = (i < 3) ? (10 << 20) : 0;
        config.start_sd[i] = 1 << 20;
        config.lower[i] = (i < 3) ? (1 << 17) : -(1 << 20);
        config.upper[i] = 100 << 20;
        config.p_bits[i] = 20;
    }
    assert_int_equal(pvid_estimator_init_q31(&estimator, &config), PVID_OK);
    assert_int_equal(pvid_trust_init_q31(&trust, &defaults, &estimator), PVID_OK);
    return 0;
}

/* An estimate with relative standard errors of `error`. */
static pvid_estimate_q31 candidate(double error, double kappa)
{
    pvid_estimate_q31 estimate;
    memset(&estimate, 0, sizeof estimate);
    for (int i = 0; i < 4; i++) {
        estimate.p[i] = 20 << 20;
        estimate.se[i] = (int32_t)(error * (20 << 20));
    }
    estimate.kappa = (int32_t)(kappa * 1073741824.0);
    estimate.least_pivot = 1 << 24;
    return estimate;
}

static pvid_reason judge(pvid_reason solved, double moved, bool above_noise, double variance_ratio,
                         pvid_estimate_q31 estimate)
{
    return pvid_trust_judge_q31(&trust, &estimator, solved, size(moved), above_noise, q24(variance_ratio), &estimate);
}

static pvid_reason judge_good(double variance_ratio)
{
    return judge(PVID_UPDATED, 1.0e-5, true, variance_ratio, candidate(PER_CENT(1), 1.0e-2));
}

static void the_first_groups_are_never_published(void **state)
{
    (void)state;
    assert_int_equal(judge_good(1.0), PVID_HELD_UNCERTAIN);
    assert_int_equal(judge_good(1.0), PVID_HELD_UNCERTAIN);
    assert_false(trust.published);
    assert_memory_equal(trust.estimate.p, estimator.p, sizeof estimator.p);
    assert_int_equal(judge_good(1.0), PVID_UPDATED);
    assert_true(trust.published);
    assert_int_equal(estimator.counters.held_uncertain, 2);
}

static void held_group_keeps_the_published_estimate_with_reason(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        (void)judge_good(1.0);
    }
    const pvid_estimate_q31 before = trust.estimate;
    const pvid_estimate_q31 fine = candidate(PER_CENT(2), 1.0e-2);
    assert_int_equal(judge(PVID_HELD_PIVOT, 0.0, true, 1.0, fine), PVID_HELD_PIVOT);
    assert_int_equal(judge(PVID_HELD_NOT_EXCITED, 0.0, true, 1.0, fine), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_ACCUMULATED, 0.0, true, 1.0, fine), PVID_ACCUMULATED);
    assert_int_equal(judge(PVID_UPDATED, 0.0, false, 1.0, fine), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_UPDATED, 0.0, true, 1.0, candidate(PER_CENT(2), 2.9e-5)), PVID_HELD_NOT_EXCITED);
    pvid_estimate_q31 imitated = fine;
    imitated.least_pivot = 21474; /* 2e-5: one mode of motion */
    assert_int_equal(judge(PVID_UPDATED, 0.0, true, 1.0, imitated), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_UPDATED, 0.0, true, 1.0, candidate(PER_CENT(5.1), 1.0e-2)), PVID_HELD_UNCERTAIN);
    pvid_estimate_q31 unknown = fine;
    unknown.se[1] = INT32_MAX; /* saturated */
    unknown.p[1] = 1;
    assert_int_equal(judge(PVID_UPDATED, 0.0, true, 1.0, unknown), PVID_HELD_UNCERTAIN);
    assert_int_equal(judge(PVID_UPDATED, 0.0061, true, 1.0, fine), PVID_HELD_UNCERTAIN); /* 0.3 of 2 % is 0.6 % */
    assert_memory_equal(&before, &trust.estimate, sizeof before);
    assert_int_equal(judge(PVID_UPDATED, 0.0059, true, 1.0, fine), PVID_UPDATED);
    assert_memory_equal(&fine, &trust.estimate, sizeof fine);
    /* a step of a ten-thousandth is small whatever the errors */
    assert_int_equal(judge(PVID_UPDATED, 9.9e-5, true, 1.0, candidate(1.0e-6, 1.0e-2)), PVID_UPDATED);
    assert_int_equal(judge(PVID_UPDATED, 1.02e-4, true, 1.0, candidate(1.0e-6, 1.0e-2)), PVID_HELD_UNCERTAIN);
}

static void after_sixteen_refusals_p_goes_back(void **state)
{
    (void)state;
    for (int i = 0; i < 16; i++) {
        assert_null(pvid_trust_fallback_q31(&trust));
        (void)judge(PVID_HELD_NOT_EXCITED, 0.0, true, 1.0, candidate(1.0, 0.0));
    }
    assert_ptr_equal(pvid_trust_fallback_q31(&trust), trust.estimate.p);
    (void)judge(PVID_HELD_NOT_EXCITED, 0.0, true, 1.0, candidate(1.0, 0.0)); /* it went */
    assert_null(pvid_trust_fallback_q31(&trust));
}

static void a_step_ends_the_refusals(void **state)
{
    (void)state;
    for (int i = 0; i < 15; i++) {
        (void)judge(PVID_HELD_PIVOT, 0.0, true, 1.0, candidate(1.0, 0.0));
    }
    (void)judge_good(1.0);
    (void)judge(PVID_HELD_PIVOT, 0.0, true, 1.0, candidate(1.0, 0.0));
    assert_null(pvid_trust_fallback_q31(&trust));
}

static void large_residuals_raise_the_alarm_and_small_ones_end_it(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        (void)judge_good(1000.0); /* p is on its way: not counted */
    }
    for (int i = 0; i < 7; i++) {
        assert_int_equal(judge_good(6.4), PVID_UPDATED);
    }
    assert_int_equal(judge_good(6.4), PVID_MISFIT); /* eight groups, 6.4 > 6 */
    assert_true(trust.published);
    assert_int_equal(estimator.counters.misfits, 1);
    int groups = 0;
    while (judge_good(0.5) == PVID_MISFIT) {
        groups++;
    }
    assert_in_range(groups, 0, 40);
    assert_int_equal(judge_good(0.5), PVID_UPDATED);
}

static void small_variance_ratio_raises_after_sixteen_groups(void **state)
{
    (void)state;
    for (int i = 0; i < 3 + 15; i++) {
        assert_true(judge_good(4.2) != PVID_MISFIT);
    }
    assert_int_equal(judge_good(4.2), PVID_MISFIT);
}

/* A fit whose residuals have so many times the variance that is expected, on so many rows. */
static pvid_reason judge_fit(double misfit, int rows)
{
    pvid_estimate_q31 estimate = candidate(PER_CENT(1), 1.0e-2);
    estimate.misfit = (int32_t)(misfit * 65536.0);
    estimate.weight = (uint32_t)rows;
    return judge(PVID_UPDATED, 1.0e-5, true, 1.0, estimate);
}

static void rows_that_do_not_fit_raise_the_alarm_with_the_first_publication(void **state)
{
    (void)state;
    (void)judge_fit(20.0, 20);
    (void)judge_fit(20.0, 30);
    assert_int_equal(judge_fit(20.0, 40), PVID_MISFIT);
    assert_int_equal(judge_fit(3.9, 50), PVID_UPDATED); /* and end it */
    /* by chance the variance of few rows is large: 4 (1 + 3 sqrt(2 / 18)) is 8, of 196 degrees of freedom 5.21 */
    assert_int_equal(judge_fit(7.9, 22), PVID_UPDATED);
    assert_int_equal(judge_fit(8.1, 22), PVID_MISFIT);
    assert_int_equal(judge_fit(5.2, 200), PVID_UPDATED);
    assert_int_equal(judge_fit(5.3, 200), PVID_MISFIT);
}

/* Groups before which the past fades, and what is left of it. */
static int groups_of_fading(double *left)
{
    int groups = 0;
    *left = 1.0;
    for (double fade = (double)pvid_trust_fade_factor_q31(&trust) / 2147483648.0; fade > 0.0;
         fade = (double)pvid_trust_fade_factor_q31(&trust) / 2147483648.0) {
        *left *= fade;
        groups++;
    }
    return groups;
}

static void judge_moved(double by, double misfit)
{
    estimator.p[0] = (int32_t)((10 << 20) * by);
    (void)judge_fit(misfit, 40);
}

static void rows_of_a_poor_start_fade(void **state)
{
    (void)state;
    double left;
    judge_moved(1.15, 20.0); /* not far from the start */
    assert_int_equal(groups_of_fading(&left), 0);
    judge_moved(1.25, 1.0); /* the rows agree with where p is: from here on that counts */
    assert_int_equal(groups_of_fading(&left), 0);
    judge_moved(1.45, 20.0);
    assert_int_equal(groups_of_fading(&left), 0);
    judge_moved(1.55, 20.0); /* 24 % beyond 1.25 */
    assert_int_equal(groups_of_fading(&left), 4);
    assert_true(left < 0.01);
    judge_moved(1.2, 20.0); /* and 23 % below where that was */
    assert_int_equal(groups_of_fading(&left), 4);
}

static void nothing_fades_before_convergence_or_with_large_errors(void **state)
{
    (void)state;
    double left;
    pvid_estimate_q31 estimate = candidate(PER_CENT(1), 1.0e-2);
    estimate.misfit = (int32_t)(20.0 * 65536.0);
    estimate.weight = 40;
    estimator.p[0] = 15 << 20;
    (void)judge(PVID_UPDATED, 0.021, true, 1.0, estimate); /* on its way */
    assert_int_equal(groups_of_fading(&left), 0);
    (void)judge(PVID_HELD_PIVOT, 0.0, true, 1.0, estimate);
    assert_int_equal(groups_of_fading(&left), 0);
    pvid_estimate_q31 vague = candidate(PER_CENT(20), 1.0e-2);
    vague.misfit = estimate.misfit;
    vague.weight = estimate.weight;
    (void)judge(PVID_UPDATED, 1.0e-5, true, 1.0, vague);
    assert_int_equal(groups_of_fading(&left), 0);
    (void)judge(PVID_UPDATED, 0.019, true, 1.0, estimate);
    (void)judge(PVID_UPDATED, 1.0e-5, true, 1.0, vague); /* what is left says too little to let it fade further */
    assert_int_equal(groups_of_fading(&left), 0);
    (void)judge(PVID_UPDATED, 1.0e-5, true, 1.0, estimate);
    assert_int_equal(groups_of_fading(&left), 4);
    trust.config.renewal = 0;
    judge_moved(5.0, 20.0);
    assert_int_equal(groups_of_fading(&left), 0);
}

/* What the windows told while the past faded is of an estimate that has gone. */
static void the_alarms_means_begin_anew_with_a_renewal(void **state)
{
    (void)state;
    double left;
    for (int i = 0; i < 3 + 20; i++) {
        (void)judge_good(100.0);
    }
    assert_true(trust.misfit);
    judge_moved(1.5, 20.0);
    assert_int_equal(trust.judged, 0);
    assert_int_equal(groups_of_fading(&left), 4);
    assert_int_equal(judge_good(1.0), PVID_UPDATED);
    assert_false(trust.misfit);
}

/* One group that the model cannot explain at all must not outweigh thousands. */
static void huge_variance_ratio_is_clamped(void **state)
{
    (void)state;
    for (int i = 0; i < 4; i++) {
        pvid_estimate_q31 fine = candidate(PER_CENT(1), 1.0e-2);
        (void)pvid_trust_judge_q31(&trust, &estimator, PVID_UPDATED, 0, true, (int64_t)1 << 62, &fine);
    }
    assert_int_equal(trust.recent[0], q24(1.0e6));
    assert_int_equal(trust.long_mean, q24(1.0e6));
}

static void the_alarm_can_be_switched_off(void **state)
{
    (void)state;
    trust.config.misfit_max = 0;
    for (int i = 0; i < 40; i++) {
        assert_true(judge_good(1000.0) != PVID_MISFIT);
    }
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
        cmocka_unit_test_setup(rows_that_do_not_fit_raise_the_alarm_with_the_first_publication, start_again),
        cmocka_unit_test_setup(rows_of_a_poor_start_fade, start_again),
        cmocka_unit_test_setup(nothing_fades_before_convergence_or_with_large_errors, start_again),
        cmocka_unit_test_setup(the_alarms_means_begin_anew_with_a_renewal, start_again),
        cmocka_unit_test_setup(huge_variance_ratio_is_clamped, start_again),
        cmocka_unit_test_setup(the_alarm_can_be_switched_off, start_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
