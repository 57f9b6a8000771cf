/* Which estimates of the fixed-point core are published: the gate, the alarm, the way back. */
#include "test.h"

#include "identity_q31.h"
#include "pendulum_model_q31.h"

typedef pvid_estimate_q31 an_estimate;

static pvid_estimator_q31 estimator;
static pvid_trust_q31 trust;

#include "trust_cases.h"

/* The defaults of trust.h: 3e-5, 5 %, 4, 3, 16, 1000, 20 %, 0. */
static const pvid_trust_config_q31 defaults = {32212, 838861, 262144, 3, 16, 1000, 13107, 0};

static int64_t q24(double x)
{
    return (int64_t)(x * 16777216.0);
}

static int32_t shared[10];
static double moved;

static int start_again(void **state)
{
    moved = 0.0;
    pvid_estimator_config_q31 config = usual_config_q31(&pendulum_model_q31);
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

static an_estimate candidate(double error, double kappa)
{
    an_estimate estimate;
    memset(&estimate, 0, sizeof estimate);
    for (int i = 0; i < 4; i++) {
        estimate.p[i] = (int32_t)((20 << 20) * (1.0 + moved));
        estimate.se[i] = (int32_t)(error * estimate.p[i]);
    }
    estimate.kappa = (int32_t)(kappa * 1073741824.0);
    estimate.least_pivot = 1 << 24;
    return estimate;
}

static an_estimate one_mode(void)
{
    an_estimate estimate = candidate(0.02, 1.0e-2);
    estimate.least_pivot = 21474; /* 2e-5 */
    return estimate;
}

static an_estimate unknown(void)
{
    an_estimate estimate = candidate(0.02, 1.0e-2);
    estimate.se[1] = INT32_MAX; /* saturated */
    estimate.p[1] = 1;
    return estimate;
}

static an_estimate fitted(an_estimate estimate, double misfit, int rows)
{
    estimate.misfit = (int32_t)(misfit * 65536.0);
    estimate.weight = (uint32_t)rows;
    return estimate;
}

static pvid_reason judge(pvid_reason solved, double size, bool above_noise, double variance_ratio, an_estimate estimate)
{
    return pvid_trust_judge_q31(&trust, &estimator, solved, (int64_t)(size * 4194304.0), above_noise,
                                q24(variance_ratio), 20, &estimate);
}

static void place(double p)
{
    estimator.p[0] = (int32_t)((1 << 20) * p);
}

static const void *fallback(void)
{
    return pvid_trust_fallback_q31(&trust);
}

static double fade_factor(void)
{
    const int32_t factor = pvid_trust_fade_factor_q31(&trust);
    return (factor == 0) ? 1.0 : ((double)factor / 2147483648.0);
}

static void begin_anew(void)
{
    pvid_trust_begin_anew_q31(&trust, &estimator);
}

static void share(double relative, double fourth, double correlation)
{
    const int32_t sd = (int32_t)(relative * 16777216.0);
    const int32_t beside = (int32_t)(correlation * 1073741824.0);
    const int32_t own[10] = {sd, beside, beside, 0, sd, beside, 0, sd, 0, (int32_t)(fourth * 1048576.0)};
    memcpy(shared, own, sizeof shared);
    trust.config.shared = shared;
}

static void move(double part)
{
    moved = part;
}

static double published_error(int a)
{
    return (double)trust.estimate.se[a] / (double)(1 << 20);
}

static double published_correlation(int a, int b)
{
    return (double)trust.estimate.correlation[a][b] / 1073741824.0;
}

/* One group that the model cannot explain at all must not outweigh thousands. */
static void huge_variance_ratio_is_clamped(void **state)
{
    for (int i = 0; i < 4; i++) {
        an_estimate fine = candidate(0.01, 1.0e-2);
        (void)pvid_trust_judge_q31(&trust, &estimator, PVID_UPDATED, 0, true, (int64_t)1 << 62, 20, &fine);
    }
    assert_int_equal(trust.recent[0], 1024000000);
    assert_int_equal(trust.long_mean, q24(1.0e6));
}

static const struct CMUnitTest tests[] = {
    TRUST_CASES cmocka_unit_test_setup(huge_variance_ratio_is_clamped, start_again),
};
RUN(tests)
