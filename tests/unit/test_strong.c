/* The strong-form identifier as a whole: windows, gaps, bad samples, sizes. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pvid/pvid.h"

/* State of a board with five-point differences: 816 B on a Cortex-M4F. */
_Static_assert(sizeof(pvid_strong_estimator_f32) <= 680, "the estimator's state has a budget");
_Static_assert(sizeof(pvid_strong_f32) - (2 * PVID_MAX_WINDOW * sizeof(float)) <= 790, "and so has the rest");

#define INFINITE (3.4e38f * 10.0f)

enum { STRIDE = 4, WINDOW = (4 * STRIDE) + 1 };

static pvid_strong_config_f32 good_config(void)
{
    pvid_strong_config_f32 config = {
        .sample_rate_hz = 1000.0f,
        .l1 = 0.3f,
        .bank = {.half = 2, .stride = STRIDE, .weights = pvid_five_points_f32},
        .estimator = pvid_estimator_defaults_f32,
    };
    const float start[3] = {25.0f, 7.0f, 4.0f};
    for (int i = 0; i < 3; i++) {
        config.estimator.start[i] = start[i];
        config.estimator.start_sd[i] = 0.5f * start[i];
        config.estimator.lower[i] = 0.05f * start[i];
        config.estimator.upper[i] = 20.0f * start[i];
    }
    config.estimator.row_sd = 1.0e5f;
    return config;
}

/* x[k+1] = 2 c x[k] - x[k-1], in double: tones without libm's rounding differing between machines. */
static float tone(int tick, double cosine)
{
    double before = cosine;
    double now = 1.0;
    for (int i = 0; i < tick; i++) {
        const double next = (2.0 * cosine * now) - before;
        before = now;
        now = next;
    }
    return (float)now;
}

static float phi_at(int tick)
{
    return (0.08f * tone(tick, 0.99999)) + (0.03f * tone(tick, 0.99987));
}

static float y_at(int tick)
{
    return (0.006f * tone(tick, 0.99997)) + (0.004f * tone(tick, 0.99967));
}

static void warming_up_lasts_one_window(void **state)
{
    (void)state;
    static pvid_strong_f32 identifier;
    const pvid_strong_config_f32 config = good_config();
    assert_int_equal(pvid_strong_init_f32(&identifier, &config), PVID_OK);
    for (int tick = 0; tick < 100; tick++) {
        const pvid_reason reason = pvid_strong_step_f32(&identifier, phi_at(tick), y_at(tick));
        assert_int_equal(reason == PVID_WARMING_UP, tick < WINDOW - 1);
    }
    assert_int_equal(identifier.estimator.counters.rows, 100 - (WINDOW - 1));
}

static void bad_sample_empties_the_windows_and_keeps_the_sums(void **state)
{
    (void)state;
    const float bad[3] = {INFINITE, -INFINITE, INFINITE - INFINITE};
    static pvid_strong_f32 identifier;
    const pvid_strong_config_f32 config = good_config();
    assert_int_equal(pvid_strong_init_f32(&identifier, &config), PVID_OK);
    int tick = 0;
    for (int k = 0; k < 6; k++) {
        for (int i = 0; i < 60; i++, tick++) {
            (void)pvid_strong_step_f32(&identifier, phi_at(tick), y_at(tick));
        }
        const pvid_strong_sums_f32 before = identifier.estimator.sums;
        const float phi = (k < 3) ? bad[k] : phi_at(tick);
        const float y = (k < 3) ? y_at(tick) : bad[k - 3];
        assert_int_equal(pvid_strong_step_f32(&identifier, phi, y), PVID_REJECTED_NOT_FINITE);
        tick++;
        assert_memory_equal(&before, &identifier.estimator.sums, sizeof before);
        for (int i = 0; i < WINDOW - 1; i++, tick++) {
            assert_int_equal(pvid_strong_step_f32(&identifier, phi_at(tick), y_at(tick)), PVID_WARMING_UP);
        }
    }
    assert_int_equal(identifier.estimator.counters.rejected_not_finite, 6);
}

static void gap_does_what_a_bad_sample_does_without_counting_one(void **state)
{
    (void)state;
    static pvid_strong_f32 with_gap;
    static pvid_strong_f32 with_nan;
    const pvid_strong_config_f32 config = good_config();
    assert_int_equal(pvid_strong_init_f32(&with_gap, &config), PVID_OK);
    assert_int_equal(pvid_strong_init_f32(&with_nan, &config), PVID_OK);
    for (int tick = 0; tick < 200; tick++) {
        if (tick == 90) {
            pvid_strong_gap_f32(&with_gap);
            (void)pvid_strong_step_f32(&with_nan, INFINITE, 0.0f);
        }
        const pvid_reason one = pvid_strong_step_f32(&with_gap, phi_at(tick), y_at(tick));
        assert_int_equal(one, pvid_strong_step_f32(&with_nan, phi_at(tick), y_at(tick)));
    }
    assert_memory_equal(with_gap.estimator.p, with_nan.estimator.p, sizeof with_gap.estimator.p);
    assert_int_equal(with_gap.estimator.counters.rejected_not_finite, 0);
    assert_int_equal(with_nan.estimator.counters.rejected_not_finite, 1);
}

static void absurd_samples_never_make_the_state_infinite(void **state)
{
    (void)state;
    static pvid_strong_f32 identifier;
    const pvid_strong_config_f32 config = good_config();
    assert_int_equal(pvid_strong_init_f32(&identifier, &config), PVID_OK);
    uint32_t generator = 5u;
    for (int tick = 0; tick < 20000; tick++) {
        float sample[2];
        for (int i = 0; i < 2; i++) { /* any bit pattern that is a number, or not */
            generator = (generator * 1664525u) + 1013904223u;
            uint32_t bits = generator;
            if ((tick % 200) > 20) { /* long enough stretches of numbers to fill the windows */
                bits &= 0xBFFFFFFFu;
            }
            memcpy(&sample[i], &bits, sizeof bits);
        }
        (void)pvid_strong_step_f32(&identifier, sample[0], sample[1]);
        pvid_estimate_f32 estimate;
        pvid_strong_assess_f32(&identifier, &estimate);
        for (int a = 0; a < 3; a++) {
            assert_true((estimate.p[a] >= config.estimator.lower[a]) && (estimate.p[a] <= config.estimator.upper[a]));
            assert_true((estimate.se[a] >= 0.0f) && (estimate.se[a] < INFINITE));
        }
        assert_true((estimate.kappa >= 0.0f) && (estimate.kappa <= 1.0f));
        assert_true((estimate.residual_sd >= 0.0f) && (estimate.residual_sd < INFINITE));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(warming_up_lasts_one_window),
        cmocka_unit_test(bad_sample_empties_the_windows_and_keeps_the_sums),
        cmocka_unit_test(gap_does_what_a_bad_sample_does_without_counting_one),
        cmocka_unit_test(absurd_samples_never_make_the_state_infinite),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
