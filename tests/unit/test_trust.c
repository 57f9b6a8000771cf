/* Which estimates are published: the gate, the alarm, the way back. */
#include "test.h"

#include "pvid/pvid.h"

typedef pvid_estimate_f32 an_estimate;

static pvid_estimator_f32 estimator;
static pvid_trust_f32 trust;

#include "trust_cases.h"

/* theta = p, three of them positive. */
static void theta_of(const float p[], float theta[])
{
    memcpy(theta, p, 4u * sizeof p[0]);
}

static void jacobian_of(const float p[], float c[])
{
    (void)p;
    for (size_t k = 0; k < 4u; k++) {
        c[k] = 1.0f;
    }
}

static const uint8_t in_order[4] = {0, 1, 2, 3};
static const pvid_model_f32 model = {.n_theta = 4,
                                     .n_p = 4,
                                     .n_moments = 10,
                                     .n_c = 4,
                                     .positive = 7u,
                                     .c_row = in_order,
                                     .c_column = in_order,
                                     .theta = theta_of,
                                     .jacobian = jacobian_of};

static float shared[10];
static double moved;

static int start_again(void **state)
{
    moved = 0.0;
    pvid_estimator_config_f32 config = pvid_estimator_defaults_f32;
    config.model = &model;
    for (int i = 0; i < 4; i++) {
        config.start[i] = (i < 3) ? 10.0f : 0.0f;
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

static an_estimate candidate(double error, double kappa)
{
    an_estimate estimate;
    memset(&estimate, 0, sizeof estimate);
    for (int i = 0; i < 4; i++) {
        estimate.p[i] = 20.0f * (1.0f + (float)moved);
        estimate.se[i] = estimate.p[i] * (float)error;
    }
    estimate.kappa = (float)kappa;
    estimate.least_pivot = 1.0e-2f;
    return estimate;
}

static an_estimate one_mode(void)
{
    an_estimate estimate = candidate(0.02, 1.0e-2);
    estimate.least_pivot = 2.0e-5f;
    return estimate;
}

static an_estimate unknown(void)
{
    return candidate((double)NAN, 1.0e-2);
}

static an_estimate fitted(an_estimate estimate, double misfit, int rows)
{
    estimate.misfit = (float)misfit;
    estimate.weight = (float)rows;
    return estimate;
}

static pvid_reason judge(pvid_reason solved, double size, bool above_noise, double variance_ratio, an_estimate estimate)
{
    return pvid_trust_judge_f32(&trust, &estimator, solved, (float)size, above_noise, (float)variance_ratio, 20,
                                &estimate);
}

static void place(double p)
{
    estimator.p[0] = (float)p;
}

static const void *fallback(void)
{
    return pvid_trust_fallback_f32(&trust);
}

static double fade_factor(void)
{
    return (double)pvid_trust_fade_factor_f32(&trust);
}

static void begin_anew(void)
{
    pvid_trust_begin_anew_f32(&trust, &estimator);
}

static void share(double relative, double fourth, double correlation)
{
    const float sd = (float)relative;
    const float beside = (float)correlation;
    const float own[10] = {sd, beside, beside, 0, sd, beside, 0, sd, 0, (float)fourth};
    memcpy(shared, own, sizeof shared);
    trust.config.shared = shared;
}

static void move(double part)
{
    moved = part;
}

static double published_error(int a)
{
    return (double)trust.estimate.se[a];
}

static double published_correlation(int a, int b)
{
    return (double)trust.estimate.covariance[a][b] / (published_error(a) * published_error(b));
}

static void nan_counts_as_the_worst(void **state)
{
    for (int i = 0; i < 3 + 8; i++) {
        (void)judge_good((i < 3) ? 1.0 : (double)NAN);
    }
    assert_int_equal(judge_good((double)INFINITY), PVID_MISFIT);
    assert_true(isfinite((double)trust.long_mean));
    assert_int_equal(judge(PVID_UPDATED, 0.0, true, 1.0, candidate(0.02, (double)NAN)), PVID_HELD_NOT_EXCITED);
}

/* Where rounding may be all that is left of the residuals the sums are renewed, wherever p came from. */
static void sums_without_digits_fade(void **state)
{
    double left;
    float *yy = &estimator.information.low[estimator.information.n_moments + estimator.information.n_theta];
    *yy = 1.0e-6f;
    estimator.information.rounding = 0.9e-6f;
    judge_moved(1.0, 1.0);
    assert_int_equal(groups_of_fading(&left), 0);
    estimator.information.rounding = 1.1e-6f;
    judge_moved(1.0, 1.0);
    assert_int_equal(groups_of_fading(&left), 4);
}

static void the_second_stage_is_given_errors_without_the_shared(void **state)
{
    share(0.03, 0.5, 0.0);
    for (int i = 0; i < 8; i++) {
        an_estimate estimate = candidate(0.02, 1.0e-2);
        const pvid_reason reason =
            pvid_trust_judge_f32(&trust, &estimator, PVID_UPDATED, 0.0f, true, 1.0f, 20, &estimate);
        assert_true((reason == PVID_UPDATED) || (i < 3));
        assert_float_equal(estimate.se[0], 0.4f, 0.0f);
    }
    assert_true(published_error(0) > 0.7);
}

static const struct CMUnitTest tests[] = {
    TRUST_CASES cmocka_unit_test_setup(nan_counts_as_the_worst, start_again),
    cmocka_unit_test_setup(sums_without_digits_fade, start_again),
    cmocka_unit_test_setup(the_second_stage_is_given_errors_without_the_shared, start_again),
};
RUN(tests)
