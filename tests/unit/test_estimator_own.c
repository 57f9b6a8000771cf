/* The estimator with a model that adds up and projects by itself, beside the same model without: the same steps; and
 * what it holds. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pvid/pvid.h"

#define MOST PVID_MAX_P

static uint32_t generator;

static float noise(void)
{
    generator = (generator * 1664525u) + 1013904223u;
    return ((float)(generator >> 8) / 8388608.0f) - 1.0f;
}

/* ---- y = N^T p: theta is p, C the identity, all of whose sums are kept ---- */

static uint8_t n; /* of the model in use */

static void theta_of(const float p[], float theta[])
{
    memcpy(theta, p, n * sizeof p[0]);
}

static void jacobian_of(const float p[], float c[])
{
    (void)p;
    for (size_t i = 0; i < n; i++) {
        c[i] = 1.0f;
    }
}

static void accumulate_of(const float row[], float y, const float high[], float low[], float sums[])
{
    size_t at = 0;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = i; j < n; j++) {
            low[at++] += row[i] * row[j];
        }
    }
    for (size_t i = 0; i < n; i++) {
        low[at++] += row[i] * y;
    }
    low[at++] += y * y;
    low[at++] += 1.0f;
    for (size_t k = 0; k < at; k++) {
        sums[k] = high[k] + low[k];
    }
}

static float project_of(const float p[], const float m[], const float b[], float s[][PVID_MAX_P], float f[])
{
    size_t at = 0;
    float rss_minus_yy = 0.0f;
    for (size_t i = 0; i < n; i++) {
        f[i] = b[i];
        rss_minus_yy -= 2.0f * (p[i] * b[i]);
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = i; j < n; j++) {
            s[i][j] = m[at++];
            f[i] -= s[i][j] * p[j];
            f[j] -= (i == j) ? 0.0f : (s[i][j] * p[i]);
            rss_minus_yy += ((i == j) ? 1.0f : 2.0f) * (p[i] * (s[i][j] * p[j]));
        }
    }
    return rss_minus_yy;
}

static float innovate_of(const float p[], const float row[], float y, float gradient[])
{
    float e = y;
    for (size_t i = 0; i < n; i++) {
        e -= row[i] * p[i];
        gradient[i] = row[i];
    }
    return e;
}

static const uint8_t places[MOST] = {0, 1, 2, 3};
static pvid_model_f32 plain;
static pvid_model_f32 own;
static pvid_estimator_config_f32 config;

static void use(uint8_t parameters)
{
    const pvid_model_f32 fresh = {
        .n_theta = parameters,
        .n_p = parameters,
        .n_moments = (uint16_t)((parameters * (parameters + 1u)) / 2u),
        .n_c = parameters,
        .c_row = places,
        .c_column = places,
        .theta = theta_of,
        .jacobian = jacobian_of,
    };
    n = parameters;
    plain = fresh;
    own = fresh;
    own.accumulate = accumulate_of;
    own.project = project_of;
    own.innovate = innovate_of;
    config = pvid_estimator_defaults_f32;
    for (size_t i = 0; i < MOST; i++) {
        config.start[i] = 0.0f;
        config.start_sd[i] = 4.0f;
        config.lower[i] = -100.0f;
        config.upper[i] = 100.0f;
    }
    config.row_sd = 0.1f;
    config.update_rate_hz = 100.0f;
}

static pvid_estimator_f32 started(const pvid_model_f32 *model)
{
    pvid_estimator_f32 estimator;
    memset(&estimator, 0x5A, sizeof estimator);
    config.model = model;
    assert_int_equal(pvid_estimator_init_f32(&estimator, &config), PVID_OK);
    generator = 3u;
    return estimator;
}

static const float truth[MOST] = {1.5f, -2.0f, 0.25f, 3.0f};

static float row_of(float row[])
{
    float y = 0.0f;
    for (size_t i = 0; i < n; i++) {
        row[i] = noise();
        y += truth[i] * row[i];
    }
    return y + (0.05f * noise());
}

static void assert_near(const float one[], const float other[], float tolerance)
{
    for (size_t i = 0; i < n; i++) {
        assert_true(fabsf(one[i] - other[i]) < tolerance);
    }
}

/* Both keep the same sums in another form, so that they differ by rounding alone. */
static void both_ways_take_the_same_steps(void **state)
{
    (void)state;
    const struct {
        float feedback_hz;
        pvid_law law;
        uint16_t divider;
        float forgetting_s;
    } cases[] = {
        {0.0f, PVID_LAW_STATIONARY, 1, 0.0f},     {0.0f, PVID_LAW_STATIONARY, 3, 2.0f},
        {30.0f, PVID_LAW_STATIONARY, 1, 0.0f},    {10.0f, PVID_LAW_STATIONARY, 2, 0.0f},
        {0.0f, PVID_LAW_PSEUDOVELOCITY, 1, 0.0f},
    };
    for (uint8_t parameters = 2; parameters <= MOST; parameters++) {
        for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
            use(parameters);
            config.feedback_hz = cases[k].feedback_hz;
            config.law = cases[k].law;
            config.divider = cases[k].divider;
            config.forgetting_s = cases[k].forgetting_s;
            pvid_estimator_f32 one = started(&plain);
            pvid_estimator_f32 other = started(&own);
            for (int i = 0; i < 400; i++) {
                float row[MOST];
                const float y = row_of(row);
                const pvid_reason reason = pvid_estimator_step_f32(&one, row, y);
                assert_int_equal(pvid_estimator_step_f32(&other, row, y), reason);
                assert_near(one.p, other.p, 2.0e-4f); /* of sums of 400 rows, 2^-23 each */
            }
            assert_memory_equal(&one.counters, &other.counters, sizeof one.counters);
            assert_int_equal(other.counters.rows, 400);
            assert_near(other.p, truth, 0.05f);
            pvid_estimate_f32 estimates[2];
            pvid_estimator_assess_f32(&one, &estimates[0]);
            pvid_estimator_assess_f32(&other, &estimates[1]);
            assert_near(estimates[0].se, estimates[1].se, 0.02f * estimates[0].se[0]);
            assert_true(fabsf(estimates[0].kappa - estimates[1].kappa) < 1.0e-4f);
            assert_true(estimates[0].weight == estimates[1].weight);
        }
    }
}

/* Rows first, then a group's end, then more solves of the same sums: where Gauss-Newton is, once is enough for a linear
 * model; where g < 1 there is nothing to iterate. */
static void rows_solves_and_iterations_come_one_by_one(void **state)
{
    (void)state;
    const float feedback_hz[2] = {0.0f, 30.0f};
    for (uint8_t parameters = 3; parameters <= MOST; parameters++) {
        for (int k = 0; k < 2; k++) {
            use(parameters);
            config.feedback_hz = feedback_hz[k];
            config.step_limit = 0.9f;
            pvid_estimator_f32 one = started(&plain);
            pvid_estimator_f32 other = started(&own);
            for (int i = 0; i < 50; i++) {
                float row[MOST];
                for (int r = 0; r < 8; r++) {
                    const float y = row_of(row);
                    assert_int_equal(pvid_estimator_add_f32(&one, row, y), PVID_ACCUMULATED);
                    assert_int_equal(pvid_estimator_add_f32(&other, row, y), PVID_ACCUMULATED);
                }
                assert_int_equal(pvid_estimator_update_f32(&one), PVID_UPDATED);
                assert_int_equal(pvid_estimator_update_f32(&other), PVID_UPDATED);
                const pvid_reason more = (k == 0) ? PVID_UPDATED : PVID_ACCUMULATED;
                assert_int_equal(pvid_estimator_iterate_f32(&one), more);
                assert_int_equal(pvid_estimator_iterate_f32(&other), more);
                assert_near(one.p, other.p, 2.0e-4f);
            }
            assert_memory_equal(&one.counters, &other.counters, sizeof one.counters);
            assert_int_equal(other.counters.updates, (k == 0) ? 100 : 50);
            assert_near(other.p, truth, 0.02f);
        }
    }
    use(3);
    config.divider = 2;
    pvid_estimator_f32 rare = started(&own);
    for (int i = 0; i < 8; i++) {
        float row[MOST];
        const float y = row_of(row);
        assert_int_equal(pvid_estimator_add_f32(&rare, row, y), PVID_ACCUMULATED);
    }
    assert_int_equal(pvid_estimator_update_f32(&rare), PVID_ACCUMULATED); /* not due */
    assert_int_equal(pvid_estimator_update_f32(&rare), PVID_UPDATED);
}

static void a_row_beyond_the_limit_is_counted_and_changes_nothing(void **state)
{
    (void)state;
    for (uint8_t parameters = 3; parameters <= MOST; parameters++) {
        for (int k = 0; k < 2; k++) {
            use(parameters);
            pvid_estimator_f32 estimator = started((k == 0) ? &plain : &own);
            const pvid_estimator_f32 before = estimator;
            float row[MOST] = {1.0f, 1.0f, 1.0f, 1.0f};
            row[parameters - 1u] = 2.0f * PVID_ROW_LIMIT;
            assert_int_equal(pvid_estimator_add_f32(&estimator, row, 0.0f), PVID_REJECTED_SATURATED);
            assert_int_equal(pvid_estimator_step_f32(&estimator, row, 0.0f), PVID_REJECTED_SATURATED);
            row[parameters - 1u] = NAN;
            assert_int_equal(pvid_estimator_add_f32(&estimator, row, 0.0f), PVID_REJECTED_NOT_FINITE);
            row[parameters - 1u] = 0.0f;
            assert_int_equal(pvid_estimator_add_f32(&estimator, row, INFINITY), PVID_REJECTED_NOT_FINITE);
            assert_int_equal(pvid_estimator_add_f32(&estimator, row, -2.0f * PVID_ROW_LIMIT), PVID_REJECTED_SATURATED);
            assert_int_equal(estimator.counters.rejected_saturated, 3);
            assert_int_equal(estimator.counters.rejected_not_finite, 2);
            memset(&estimator.counters, 0, sizeof estimator.counters);
            assert_memory_equal(&before.p, &estimator.p, sizeof before.p);
            assert_memory_equal(&before.information, &estimator.information, sizeof before.information);
        }
    }
    /* a row within the limit whose innovation is not */
    use(3);
    for (int i = 0; i < 3; i++) {
        config.start[i] = 100.0f;
        config.start_sd[i] = 1.0f;
    }
    pvid_estimator_f32 estimator = started(&plain);
    const float row[MOST] = {0.5f * PVID_ROW_LIMIT, 0.5f * PVID_ROW_LIMIT, 0.5f * PVID_ROW_LIMIT, 0.0f};
    assert_int_equal(pvid_estimator_add_f32(&estimator, row, 0.0f), PVID_REJECTED_SATURATED);
    assert_int_equal(estimator.counters.rows, 0);
}

/* No prior to speak of: (row_sd / start_sd)^2 is less than the least float. */
static void without_prior(void)
{
    for (size_t i = 0; i < MOST; i++) {
        config.start_sd[i] = 1.0e12f;
    }
    config.row_sd = 1.0e-12f;
}

static void a_system_without_a_solution_is_held(void **state)
{
    (void)state;
    for (uint8_t parameters = 2; parameters <= MOST; parameters++) {
        for (int k = 0; k < 2; k++) {
            use(parameters);
            without_prior();
            pvid_estimator_f32 estimator = started((k == 0) ? &plain : &own);
            const float nothing[MOST] = {0.0f, 0.0f, 0.0f, 0.0f};
            assert_int_equal(pvid_estimator_step_f32(&estimator, nothing, 1.0f), PVID_HELD_PIVOT);
            assert_int_equal(estimator.counters.held_pivot, 1);
            assert_memory_equal(estimator.p, config.start, n * sizeof(float));
        }
    }
}

static void below_noise_margin_is_held(void **state)
{
    (void)state;
    for (uint8_t parameters = 2; parameters <= MOST; parameters++) {
        for (int k = 0; k < 2; k++) {
            use(parameters);
            config.kappa_min = 0.999f;
            pvid_estimator_f32 estimator = started((k == 0) ? &plain : &own);
            for (int i = 0; i < 5; i++) { /* all parameters always in the same proportion */
                const float row[MOST] = {1.0f, 1.0f, 1.0f, 1.0f};
                assert_int_equal(pvid_estimator_step_f32(&estimator, row, 1.0f), PVID_HELD_NOT_EXCITED);
            }
            assert_int_equal(estimator.counters.held_not_excited, 5);
            assert_memory_equal(estimator.p, config.start, n * sizeof(float));
        }
    }
}

/* Information so small that its inverse, measured by a parameter as small, is beyond float32. */
static void a_step_beyond_all_numbers_is_held(void **state)
{
    (void)state;
    for (uint8_t parameters = 2; parameters <= MOST; parameters++) {
        for (int k = 0; k < 2; k++) {
            use(parameters);
            without_prior();
            plain.positive = 15u;
            own.positive = 15u;
            config.kappa_min = 0.0f;
            for (size_t i = 0; i < MOST; i++) {
                config.start[i] = 1.0e-36f;
                config.lower[i] = 1.0e-37f;
            }
            pvid_estimator_f32 estimator = started((k == 0) ? &plain : &own);
            pvid_reason reason = PVID_UPDATED;
            for (size_t i = 0; i < n; i++) {
                float row[MOST] = {0.0f, 0.0f, 0.0f, 0.0f};
                row[i] = 1.0e-17f;
                reason = pvid_estimator_step_f32(&estimator, row, 1.0e13f);
            }
            assert_int_equal(reason, PVID_HELD_PIVOT);
            assert_memory_equal(estimator.p, config.start, n * sizeof(float));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(both_ways_take_the_same_steps),
        cmocka_unit_test(rows_solves_and_iterations_come_one_by_one),
        cmocka_unit_test(a_row_beyond_the_limit_is_counted_and_changes_nothing),
        cmocka_unit_test(a_system_without_a_solution_is_held),
        cmocka_unit_test(below_noise_margin_is_held),
        cmocka_unit_test(a_step_beyond_all_numbers_is_held),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
