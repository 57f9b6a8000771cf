/* The weak-form identifier, whole: what it refuses, that it identifies, that it survives. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "plant.h"
#include "pvid/pvid.h"
#include "weak_table.h"

#define INFINITE (3.4e38f * 10.0f)
#define NOT_A_NUMBER (INFINITE - INFINITE)

/* Ticks until the first window is worked off: taps, W samples decimated by 8, and the stages. */
#define FIRST_ESTIMATE (5 + (TABLE_WINDOW * TABLE_DECIMATION) + 400)

static pvid_weak_config_f32 good_config(void)
{
    const float start[4] = {22.0f, 12.0f, 4.0f, 0.0f};
    pvid_weak_config_f32 config = table_config(start);
    config.estimator.kappa_min = 5.0e-6f;
    return config;
}

static pvid_weak_f32 identifier;

static void start(const pvid_weak_config_f32 *config)
{
    assert_int_equal(pvid_weak_init_f32(&identifier, config), PVID_OK);
}

/* Steps through `ticks` samples of the plant with the encoder's zero at c [rad]. */
static void run(plant_state *plant, int ticks, double c, int reasons[16])
{
    for (int i = 0; i < ticks; i++) {
        double phi;
        double y;
        plant_step(plant, &phi, &y);
        const pvid_reason reason = pvid_weak_step_f32(&identifier, (float)(phi + c), (float)y);
        if (reasons != NULL) {
            reasons[reason]++;
        }
    }
}

static void assert_near(double value, double truth, double relative)
{
    const double error = (value / truth) - 1.0;
    assert_true((error < relative) && (error > -relative));
}

static void the_pendulum_is_identified_with_its_encoders_zero(void **state)
{
    (void)state;
    const double zeros[3] = {0.0, 0.02, -0.1};
    for (int i = 0; i < 3; i++) {
        const pvid_weak_config_f32 config = good_config();
        start(&config);
        plant_state plant = released_plant();
        int reasons[16] = {0};
        run(&plant, 20000, zeros[i], reasons);
        const pvid_estimate_f32 estimate = *pvid_weak_estimate_f32(&identifier);
        for (int k = 0; k < 3; k++) {
            /* float32 samples differentiated twice over five taps leave u a noise of 1e-3 of itself,
             * decimation without smoothing and the trapezoid rule at 8 ms some 1e-3 of bias */
            assert_near((double)estimate.p[k], plant_p[k], 5.0e-3);
        }
        assert_true(((double)estimate.p[3] - zeros[i]) < 1.0e-4);
        assert_true(((double)estimate.p[3] - zeros[i]) > -1.0e-4);
        assert_true(estimate.kappa > 1.0e-3f);
        /* windows of 0.624 s in 20 s, less the first half; the first ones are not trusted, and this design's biases
         * raise the alarm, which is told of an exact sensor */
        const int windows = reasons[PVID_UPDATED] + reasons[PVID_MISFIT] + reasons[PVID_HELD_UNCERTAIN];
        assert_int_equal(windows, 31 - 1);
        assert_in_range(reasons[PVID_HELD_UNCERTAIN], 2, 4);
        assert_int_equal(reasons[PVID_ACCUMULATED] + windows + reasons[PVID_WARMING_UP], 20000);
        assert_int_equal(identifier.estimator.counters.updates, 3 * 30);
    }
}

static void a_zeroed_encoder_needs_five_entries(void **state)
{
    (void)state;
    pvid_weak_config_f32 config = good_config();
    config.zero_unknown = false;
    start(&config);
    plant_state plant = released_plant();
    run(&plant, 10000, 0.0, NULL);
    for (int k = 0; k < 3; k++) {
        assert_near((double)identifier.estimator.p[k], plant_p[k], 5.0e-3);
    }
    assert_int_equal(identifier.estimator.model->n_theta, PVID_KAPITZA_ZEROED_THETA);
}

static void a_sample_that_is_no_number_restarts_the_windows_and_keeps_the_sums(void **state)
{
    (void)state;
    const pvid_weak_config_f32 config = good_config();
    start(&config);
    plant_state plant = released_plant();
    run(&plant, 6000, 0.0, NULL);
    float before[PVID_MAX_SUMS];
    float after[PVID_MAX_SUMS];
    pvid_information_read_f32(&identifier.estimator.information, before);
    const float hostile[4][2] = {{NOT_A_NUMBER, 0.0f}, {0.0f, NOT_A_NUMBER}, {INFINITE, 0.0f}, {0.0f, -INFINITE}};
    for (int i = 0; i < 4; i++) {
        assert_int_equal(pvid_weak_step_f32(&identifier, hostile[i][0], hostile[i][1]), PVID_REJECTED_NOT_FINITE);
    }
    assert_int_equal(identifier.estimator.counters.rejected_not_finite, 4);
    pvid_information_read_f32(&identifier.estimator.information, after);
    assert_memory_equal(before, after, 46 * sizeof(float));
    int reasons[16] = {0};
    run(&plant, 5000, 0.0, reasons);
    /* no window can be complete before W decimated samples have come in */
    assert_true(reasons[PVID_WARMING_UP] >= TABLE_WINDOW * (TABLE_DECIMATION - 1));
    assert_true(reasons[PVID_UPDATED] >= 4);
    for (int k = 0; k < 3; k++) {
        assert_near((double)identifier.estimator.p[k], plant_p[k], 5.0e-3);
    }
}

static void a_gap_is_a_sample_that_is_no_number_without_the_sample(void **state)
{
    (void)state;
    static pvid_weak_f32 gapped;
    const pvid_weak_config_f32 config = good_config();
    start(&config);
    plant_state plant = released_plant();
    run(&plant, 4321, 0.0, NULL);
    gapped = identifier;
    pvid_weak_gap_f32(&gapped);
    (void)pvid_weak_step_f32(&identifier, NOT_A_NUMBER, 0.0f);
    identifier.estimator.counters.rejected_not_finite = 0;
    assert_memory_equal(&gapped, &identifier, sizeof gapped);
}

static void a_new_init_equals_a_fresh_object(void **state)
{
    (void)state;
    static pvid_weak_f32 fresh;
    const pvid_weak_config_f32 config = good_config();
    start(&config);
    plant_state plant = released_plant();
    run(&plant, 3000, 0.0, NULL);
    start(&config);
    memset(&fresh, 0xA5, sizeof fresh);
    assert_int_equal(pvid_weak_init_f32(&fresh, &config), PVID_OK);
    plant = released_plant();
    for (int i = 0; i < FIRST_ESTIMATE; i++) {
        double phi;
        double y;
        plant_step(&plant, &phi, &y);
        const pvid_reason one = pvid_weak_step_f32(&identifier, (float)phi, (float)y);
        assert_int_equal(pvid_weak_step_f32(&fresh, (float)phi, (float)y), one);
    }
    assert_memory_equal(fresh.estimator.p, identifier.estimator.p, sizeof fresh.estimator.p);
    assert_int_equal(fresh.estimator.counters.updates, 3);
}

static void start_is_held_with_reason_without_drive(void **state)
{
    (void)state;
    pvid_weak_config_f32 config = good_config();
    config.drive_min = 0.4f;
    start(&config);
    int reasons[16] = {0};
    plant_state plant = released_plant();
    for (int i = 0; i < 10000; i++) { /* the pendulum swings, the pivot stands */
        double phi;
        double y;
        plant_step(&plant, &phi, &y);
        reasons[pvid_weak_step_f32(&identifier, (float)phi, 0.001f)]++;
    }
    assert_memory_equal(identifier.estimator.p, config.estimator.start, 4 * sizeof(float));
    assert_true(reasons[PVID_HELD_NOT_EXCITED] > 10);
    assert_int_equal(reasons[PVID_UPDATED], 0);
    assert_int_equal(identifier.estimator.counters.rows, 0);
    assert_int_equal(identifier.estimator.counters.held_not_excited, reasons[PVID_HELD_NOT_EXCITED]);
}

static void absurd_samples_never_make_the_state_infinite(void **state)
{
    (void)state;
    pvid_weak_config_f32 config = good_config();
    config.estimator.kappa_min = 0.0f;
    start(&config);
    uint32_t generator = 1u;
    const float scale[5] = {1.0f, 1.0e6f, 1.0e30f, 3.4e38f, 1.0e-30f};
    for (int i = 0; i < 20000; i++) {
        float sample[2];
        for (int k = 0; k < 2; k++) {
            generator = (generator * 1664525u) + 1013904223u;
            sample[k] = scale[(i / 3000) % 5] * (((float)(generator >> 8) / 8388608.0f) - 1.0f);
        }
        (void)pvid_weak_step_f32(&identifier, sample[0], sample[1]);
        for (int k = 0; k < 4; k++) {
            const float p = identifier.estimator.p[k];
            assert_true((p >= config.estimator.lower[k]) && (p <= config.estimator.upper[k]));
        }
    }
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&identifier.estimator.information, sums);
    for (int i = 0; i < 46; i++) {
        assert_true((sums[i] <= 3.4e38f) && (sums[i] >= -3.4e38f));
    }
    assert_true(identifier.estimator.counters.rejected_not_finite > 0u);
    assert_true(identifier.estimator.counters.rejected_saturated > 0u);
}

static pvid_status status_of(const pvid_weak_config_f32 *config)
{
    static pvid_weak_f32 refused;
    return pvid_weak_init_f32(&refused, config);
}

static void a_window_that_cannot_be_worked_off_is_refused(void **state)
{
    (void)state;
    pvid_weak_design_f32 design = table_design;
    pvid_weak_config_f32 config = good_config();
    config.design = &design;
    design.decimation = 1; /* a free tick a sample: 4 in the shortest window's hop, for 32 stages each */
    design.window = 9;
    config.iterations = 3;
    assert_int_equal(status_of(&config), PVID_BAD_ITERATIONS);
    config.iterations = 2;
    assert_int_equal(status_of(&config), PVID_OK);
}

static int prepare(void **state)
{
    (void)state;
    make_table();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_pendulum_is_identified_with_its_encoders_zero),
        cmocka_unit_test(a_zeroed_encoder_needs_five_entries),
        cmocka_unit_test(a_sample_that_is_no_number_restarts_the_windows_and_keeps_the_sums),
        cmocka_unit_test(a_gap_is_a_sample_that_is_no_number_without_the_sample),
        cmocka_unit_test(a_new_init_equals_a_fresh_object),
        cmocka_unit_test(start_is_held_with_reason_without_drive),
        cmocka_unit_test(absurd_samples_never_make_the_state_infinite),
        cmocka_unit_test(a_window_that_cannot_be_worked_off_is_refused),
    };
    return cmocka_run_group_tests(tests, prepare, NULL);
}
