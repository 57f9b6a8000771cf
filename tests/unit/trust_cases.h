/* Which estimates either core publishes: included by the tests of each, which define `an_estimate`, `estimator`,
 * `trust` and the functions declared here. */
#ifndef TRUST_CASES_H
#define TRUST_CASES_H

#include <stdbool.h>

/* Prepares an estimator with p = 10 and the default settings of trust.h. */
static int start_again(void **state);

/* An estimate p = 20 with relative standard errors of `error`; one that confuses two parameters; one whose standard
 * errors are unknown; and one whose residuals have `misfit` times the expected variance, on so many rows. */
static an_estimate candidate(double error, double kappa);
static an_estimate one_mode(void);
static an_estimate unknown(void);
static an_estimate fitted(an_estimate estimate, double misfit, int rows);

static pvid_reason judge(pvid_reason solved, double size, bool above_noise, double variance_ratio,
                         an_estimate estimate);

/* Sets the estimator's first parameter. */
static void place(double p);

/* Where p goes back to, or NULL; factor on the past before this group, 1: none. */
static const void *fallback(void);
static double fade_factor(void);

/* The mechanism has changed. */
static void begin_anew(void);

/* Shared errors: standard deviations of the first three and of the fourth parameter, and the correlation of the former.
 * The next estimates are p = 20 (1 + part). Then what is published: a standard error, a correlation. */
static void share(double relative, double fourth, double correlation);
static void move(double part);
static double published_error(int a);
static double published_correlation(int a, int b);

static pvid_reason judge_good(double variance_ratio)
{
    return judge(PVID_UPDATED, 1.0e-5, true, variance_ratio, candidate(0.01, 1.0e-2));
}

static void the_first_groups_are_never_published(void **state)
{
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
    for (int i = 0; i < 3; i++) {
        (void)judge_good(1.0);
    }
    const an_estimate before = trust.estimate;
    const an_estimate fine = candidate(0.02, 1.0e-2);
    assert_int_equal(judge(PVID_HELD_SINGULAR, 0.0, true, 1.0, fine), PVID_HELD_SINGULAR);
    assert_int_equal(judge(PVID_HELD_NOT_EXCITED, 0.0, true, 1.0, fine), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_ACCUMULATED, 0.0, true, 1.0, fine), PVID_ACCUMULATED);
    assert_int_equal(judge(PVID_UPDATED, 0.0, false, 1.0, fine), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_UPDATED, 0.0, true, 1.0, candidate(0.02, 2.9e-5)), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_UPDATED, 0.0, true, 1.0, one_mode()), PVID_HELD_NOT_EXCITED);
    assert_int_equal(judge(PVID_UPDATED, 0.0, true, 1.0, candidate(0.051, 1.0e-2)), PVID_HELD_UNCERTAIN);
    assert_int_equal(judge(PVID_UPDATED, 0.0, true, 1.0, unknown()), PVID_HELD_UNCERTAIN);
    assert_int_equal(judge(PVID_UPDATED, 0.0061, true, 1.0, fine), PVID_HELD_UNCERTAIN); /* 0.3 of 2 % is 0.6 % */
    assert_memory_equal(&before, &trust.estimate, offsetof(an_estimate, standing));
    assert_int_equal(judge(PVID_UPDATED, 0.0059, true, 1.0, fine), PVID_UPDATED);
    assert_memory_equal(&fine, &trust.estimate, offsetof(an_estimate, standing));
    /* a step of a ten-thousandth is small whatever the errors */
    assert_int_equal(judge(PVID_UPDATED, 9.9e-5, true, 1.0, candidate(1.0e-6, 1.0e-2)), PVID_UPDATED);
    assert_int_equal(judge(PVID_UPDATED, 1.02e-4, true, 1.0, candidate(1.0e-6, 1.0e-2)), PVID_HELD_UNCERTAIN);
}

static void a_condition_at_its_limit_is_met(void **state)
{
    for (int i = 0; i < 3; i++) {
        (void)judge_good(1.0);
    }
    an_estimate least = candidate(0.02, 1.0e-2);
    least.kappa = trust.config.kappa_min;
    least.least_pivot = trust.config.kappa_min;
    assert_int_equal(judge(PVID_UPDATED, 0.0, true, 1.0, least), PVID_UPDATED);
}

static void after_sixteen_refusals_p_goes_back(void **state)
{
    for (int i = 0; i < 16; i++) {
        assert_null(fallback());
        (void)judge(PVID_HELD_NOT_EXCITED, 0.0, true, 1.0, candidate(1.0, 0.0));
    }
    assert_ptr_equal(fallback(), trust.estimate.p);
    (void)judge(PVID_HELD_NOT_EXCITED, 0.0, true, 1.0, candidate(1.0, 0.0)); /* it went */
    assert_null(fallback());
}

static void a_step_ends_the_refusals(void **state)
{
    for (int i = 0; i < 15; i++) {
        (void)judge(PVID_HELD_SINGULAR, 0.0, true, 1.0, candidate(1.0, 0.0));
    }
    (void)judge_good(1.0);
    (void)judge(PVID_HELD_SINGULAR, 0.0, true, 1.0, candidate(1.0, 0.0));
    assert_null(fallback());
}

static void large_residuals_raise_the_alarm_and_small_ones_end_it(void **state)
{
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
    for (int i = 0; i < 3 + 15; i++) {
        assert_true(judge_good(4.2) != PVID_MISFIT);
    }
    assert_int_equal(judge_good(4.2), PVID_MISFIT);
}

static pvid_reason judge_fit(double misfit, int rows)
{
    return judge(PVID_UPDATED, 1.0e-5, true, 1.0, fitted(candidate(0.01, 1.0e-2), misfit, rows));
}

static void rows_that_do_not_fit_raise_the_alarm_with_the_first_publication(void **state)
{
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

/* Groups before which the past fades, and the part of it that remains. */
static int groups_of_fading(double *left)
{
    int groups = 0;
    *left = 1.0;
    for (double factor = fade_factor(); factor < 1.0; factor = fade_factor()) {
        *left *= factor;
        groups++;
    }
    return groups;
}

static void judge_moved(double by, double misfit)
{
    place(10.0 * by);
    (void)judge_fit(misfit, 40);
}

static void rows_of_a_poor_start_fade(void **state)
{
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
    double left;
    const an_estimate estimate = fitted(candidate(0.01, 1.0e-2), 20.0, 40);
    const an_estimate vague = fitted(candidate(0.2, 1.0e-2), 20.0, 40);
    place(15.0);
    (void)judge(PVID_UPDATED, 0.021, true, 1.0, estimate); /* on its way */
    assert_int_equal(groups_of_fading(&left), 0);
    (void)judge(PVID_HELD_SINGULAR, 0.0, true, 1.0, estimate);
    assert_int_equal(groups_of_fading(&left), 0);
    (void)judge(PVID_UPDATED, 1.0e-5, true, 1.0, vague);
    assert_int_equal(groups_of_fading(&left), 0);
    (void)judge(PVID_UPDATED, 0.019, true, 1.0, estimate);
    (void)judge(PVID_UPDATED, 1.0e-5, true, 1.0, vague); /* too little remains to let it fade further */
    assert_int_equal(groups_of_fading(&left), 0);
    (void)judge(PVID_UPDATED, 1.0e-5, true, 1.0, estimate);
    assert_int_equal(groups_of_fading(&left), 4);
    trust.config.renewal = 0;
    judge_moved(5.0, 20.0);
    assert_int_equal(groups_of_fading(&left), 0);
}

/* Residuals from while the past faded belong to an estimate that has gone. */
static void the_alarms_means_restart_with_a_renewal(void **state)
{
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

/* Next to nothing remains of the sums, at once, however large the errors are; what is published is held until the new
 * sums are trusted. */
static void a_changed_mechanism_begins_the_sums_anew(void **state)
{
    double left;
    for (int i = 0; i < 3 + 20; i++) {
        (void)judge_good(100.0);
    }
    assert_true(trust.misfit);
    begin_anew();
    assert_true(trust.published);
    assert_int_equal(groups_of_fading(&left), 1);
    assert_true(fabs(left - 1.0e-4) < 1.0e-9);
    assert_int_equal(trust.judged, 0);
    assert_int_equal(judge_good(1.0), PVID_HELD_UNCERTAIN);
    assert_int_equal(judge_good(1.0), PVID_HELD_UNCERTAIN);
    assert_int_equal(judge_good(1.0), PVID_UPDATED);
    assert_int_equal(groups_of_fading(&left), 0);
}

static void expected_residuals_raise_no_alarm(void **state)
{
    for (int i = 0; i < 1000; i++) {
        assert_true(judge_good(((i % 3) == 0) ? 2.0 : 1.0) != PVID_MISFIT);
    }
}

static void the_alarm_can_be_switched_off(void **state)
{
    trust.config.misfit_max = 0;
    for (int i = 0; i < 100; i++) {
        assert_true(judge_good(1.0e6) != PVID_MISFIT);
    }
}

/* se^2 of p = 20 +- 1 % becomes 1 %^2 + 3 %^2, of which nine tenths are common to the positive parameters; that of the
 * fourth 0.2^2 + 0.5^2. */
static void shared_errors_join_what_is_published(void **state)
{
    share(0.03, 0.5, -0.5);
    for (int i = 0; i < 4; i++) {
        (void)judge_good(1.0);
    }
    for (int a = 0; a < 3; a++) {
        assert_true(fabs(published_error(a) - 0.632456) < 1.0e-5);
        assert_true(fabs(published_correlation(a, (a + 1) % 3) + 0.45) < 1.0e-5);
        assert_true(fabs(published_correlation(a, 3)) < 1.0e-9);
    }
    assert_true(fabs(published_error(3) - 0.538516) < 1.0e-5);
}

/* They are no reason to hold an estimate, however large they are, and no excuse: windows share them, so that an
 * estimate that is more than five of the other errors away contradicts. */
static void shared_errors_neither_hold_nor_excuse(void **state)
{
    share(1.0, 0.0, 1.0);
    for (int i = 0; i < 4; i++) {
        (void)judge_good(1.0);
    }
    assert_int_equal(judge_good(1.0), PVID_UPDATED);
    assert_true(published_error(0) > 20.0);
    move(0.065); /* 6.5 / sqrt(1 + 1.065^2) is 4.4 */
    assert_int_equal(judge(PVID_UPDATED, 0.02, true, 1.0, candidate(0.01, 1.0e-2)), PVID_HELD_UNCERTAIN);
    assert_false(trust.standing.contradicts);
    move(0.08); /* 5.4 */
    assert_int_equal(judge(PVID_UPDATED, 0.02, true, 1.0, candidate(0.01, 1.0e-2)), PVID_HELD_UNCERTAIN);
    assert_true(trust.standing.contradicts);
    assert_false(trust.standing.grew);
    assert_int_equal(judge(PVID_UPDATED, 0.02, true, 1.0, candidate(0.04, 1.0e-2)), PVID_HELD_UNCERTAIN);
    assert_true(trust.standing.grew);
    move(0.0);
    trust.config.shared = NULL;
    assert_int_equal(judge_good(1.0), PVID_UPDATED);
    assert_true(fabs(published_error(0) - 0.2) < 1.0e-5);
}

#define TRUST_CASES                                                                                                    \
    cmocka_unit_test_setup(the_first_groups_are_never_published, start_again),                                         \
        cmocka_unit_test_setup(held_group_keeps_the_published_estimate_with_reason, start_again),                      \
        cmocka_unit_test_setup(a_condition_at_its_limit_is_met, start_again),                                          \
        cmocka_unit_test_setup(after_sixteen_refusals_p_goes_back, start_again),                                       \
        cmocka_unit_test_setup(a_step_ends_the_refusals, start_again),                                                 \
        cmocka_unit_test_setup(large_residuals_raise_the_alarm_and_small_ones_end_it, start_again),                    \
        cmocka_unit_test_setup(small_variance_ratio_raises_after_sixteen_groups, start_again),                         \
        cmocka_unit_test_setup(rows_that_do_not_fit_raise_the_alarm_with_the_first_publication, start_again),          \
        cmocka_unit_test_setup(rows_of_a_poor_start_fade, start_again),                                                \
        cmocka_unit_test_setup(nothing_fades_before_convergence_or_with_large_errors, start_again),                    \
        cmocka_unit_test_setup(the_alarms_means_restart_with_a_renewal, start_again),                                  \
        cmocka_unit_test_setup(a_changed_mechanism_begins_the_sums_anew, start_again),                                 \
        cmocka_unit_test_setup(expected_residuals_raise_no_alarm, start_again),                                        \
        cmocka_unit_test_setup(the_alarm_can_be_switched_off, start_again),                                            \
        cmocka_unit_test_setup(shared_errors_join_what_is_published, start_again),                                     \
        cmocka_unit_test_setup(shared_errors_neither_hold_nor_excuse, start_again),

#endif
