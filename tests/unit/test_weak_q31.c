/* The weak form in fixed point, whole: that it identifies, what it refuses, that it survives, that it can be saved. */
#include "test.h"

#include "kapitza_plant_q31.h"
#include "weak/weak_front_q31.h"
#include "weak/accumulator_q31.h"
#include "weak/weak_finish_q31.h"
#include "pvid/little_endian.h"
#include "pvid/pvid_q31.h"
#include "pvid/snapshot_weak_q31.h"

#define HOP PLANT_HOP_TICKS
#define WINDOWS(ticks) ((((ticks) - FIRST_TICKS) / HOP) + 1)
#define ROWS 5           /* of a window: seven functions less two nuisances */
#define FIRST_TICKS 1814 /* half a filter on either side of a window; then one window each hop */

static pvid_weak_q31 identifier;
static pvid_weak_config_q31 config;
static pvid_weak_design_q31 design;

static int start_again(void **state)
{
    design = kapitza_design_q31;
    config = kapitza_config_q31;
    config.design = &design;
    return 0;
}

static void start(void)
{
    assert_int_equal(pvid_weak_init_q31(&identifier, &config), PVID_OK);
}

static pvid_reason tick(pvid_weak_q31 *self, plant_state *plant, int32_t zero)
{
    int32_t reading[2];
    plant_reading(plant, zero, reading);
    return pvid_weak_step_q31(self, reading);
}

static pvid_reason step(int32_t y, int32_t phi)
{
    const int32_t reading[2] = {y, phi};
    return pvid_weak_step_q31(&identifier, reading);
}

/* Steps through `ticks` samples of the plant, with the encoder's zero at so many counts. */
static void run(plant_state *plant, int ticks, int32_t zero, int reasons[16])
{
    for (int i = 0; i < ticks; i++) {
        const pvid_reason reason = tick(&identifier, plant, zero);
        if (reasons != NULL) {
            reasons[reason]++;
        }
    }
}

static int judged(const int reasons[16])
{
    return reasons[PVID_UPDATED] + reasons[PVID_MISFIT] + reasons[PVID_HELD_UNCERTAIN];
}

static void assert_near(double value, double truth, double tolerance)
{
    const double error = value - truth;
    assert_true((error < tolerance) && (error > -tolerance));
}

static void the_pendulum_is_identified_with_its_encoders_zero(void **state)
{
    const int32_t zeros[3] = {0, 52, -261}; /* 0.02 and -0.1 rad */
    for (int i = 0; i < 3; i++) {
        start();
        plant_state plant = released_plant();
        int reasons[16] = {0};
        run(&plant, 20000, zeros[i], reasons);
        const pvid_estimate_q31 *estimate = pvid_weak_estimate_q31(&identifier);
        assert_true(identifier.trust.published);
        for (int k = 0; k < 3; k++) { /* a 14-bit encoder, 24 windows */
            assert_near((plant_p_unit[k] * (double)estimate->p[k]) / plant_p[k], 1.0, 5.0e-3);
        }
        assert_near(plant_p_unit[3] * (double)estimate->p[3], zeros[i] * plant_lsb[PLANT_PHI], 2.0e-4);
        assert_int_equal(judged(reasons), WINDOWS(20000));
        assert_int_equal(reasons[PVID_ACCUMULATED] + judged(reasons) + reasons[PVID_WARMING_UP], 20000);
        assert_int_equal(identifier.estimator.counters.rows, ROWS * WINDOWS(20000));
    }
}

static void a_reading_beyond_full_scale_restarts_windows_and_keeps_sums(void **state)
{
    static const int32_t offset[2] = {-7, 40};
    config.offset = offset;
    start();
    const int32_t y_max = kapitza_full_scale_q31[PLANT_Y];
    const int32_t phi_max = kapitza_full_scale_q31[PLANT_PHI];
    const int32_t good[4][2] = {{0, phi_max}, {0, -phi_max}, {y_max, 0}, {-y_max, 0}};
    const int32_t bad[4][2] = {{0, phi_max + 1}, {0, -phi_max - 1}, {y_max + 1, 0}, {-y_max - 1, 0}};
    const int32_t far[4][2] = {{-7, INT32_MIN}, {-7, INT32_MAX}, {INT32_MIN, 40}, {INT32_MAX, 40}};
    for (int i = 0; i < 4; i++) {
        assert_int_equal(step(good[i][0] - 7, good[i][1] + 40), PVID_WARMING_UP);
        assert_int_equal(step(bad[i][0] - 7, bad[i][1] + 40), PVID_REJECTED_SATURATED);
        assert_int_equal(step(far[i][0], far[i][1]), PVID_REJECTED_SATURATED);
    }
    assert_int_equal(identifier.estimator.counters.rejected_saturated, 8);
    start_again(NULL);
    start();
    plant_state plant = released_plant();
    run(&plant, FIRST_TICKS + (6 * HOP) + (HOP / 2), 0, NULL); /* the rows of its last window are in */
    const pvid_information_q31 before = identifier.estimator.information;
    assert_int_equal(step(0, phi_max + 1), PVID_REJECTED_SATURATED);
    assert_memory_equal(&before, &identifier.estimator.information, sizeof before);
    assert_false(identifier.warm);
    int reasons[16] = {0};
    const uint32_t rows = identifier.estimator.counters.rows;
    run(&plant, 8400, 0, reasons);
    assert_int_equal(reasons[PVID_WARMING_UP], FIRST_TICKS - 1);
    assert_int_equal(identifier.estimator.counters.rows - rows, ROWS * WINDOWS(8400));
}

static void a_gap_is_a_reading_beyond_full_scale_without_the_reading(void **state)
{
    static pvid_weak_q31 gapped;
    start();
    plant_state plant = released_plant();
    run(&plant, 4321, 0, NULL);
    gapped = identifier;
    pvid_weak_gap_q31(&gapped);
    (void)step(0, INT32_MAX);
    assert_int_equal(identifier.estimator.counters.rejected_saturated, 1);
    identifier.estimator.counters.rejected_saturated = 0;
    assert_memory_equal(&gapped, &identifier, sizeof gapped);
}

static void start_is_held_with_reason_without_drive(void **state)
{
    start();
    int reasons[16] = {0};
    plant_state plant = released_plant();
    for (int i = 0; i < 10000; i++) { /* the pendulum swings, the pivot stands */
        int32_t reading[2];
        plant_reading(&plant, 0, reading);
        reasons[step(200, reading[PLANT_PHI])]++;
    }
    assert_memory_equal(identifier.estimator.p, config.estimator.start, 4 * sizeof(int32_t));
    assert_int_equal(reasons[PVID_HELD_NOT_EXCITED], WINDOWS(10000));
    assert_int_equal(identifier.estimator.counters.held_not_excited, reasons[PVID_HELD_NOT_EXCITED]);
    assert_int_equal(identifier.estimator.counters.rows, 0);
    assert_int_equal(reasons[PVID_WARMING_UP] + reasons[PVID_ACCUMULATED] + reasons[PVID_HELD_NOT_EXCITED], 10000);
}

/* A mixture of both laws steps once a window, and forgetting keeps fewer rows. */
static void laws_and_forgetting_take_their_settings(void **state)
{
    config.estimator.gain = 1 << 29;
    config.estimator.forgetting_groups = 8;
    start();
    assert_int_equal(identifier.iterations, 1);
    plant_state plant = released_plant();
    run(&plant, 30000, 0, NULL);
    const uint32_t windows = WINDOWS(30000);
    assert_int_equal(identifier.estimator.counters.updates, windows);
    assert_int_equal(identifier.estimator.counters.rows, ROWS * windows);
    pvid_estimate_q31 estimate;
    pvid_estimator_assess_q31(&identifier.estimator, &estimate);
    assert_in_range(estimate.weight, 7 * ROWS, 8 * ROWS + 2); /* rows of eight windows */
    for (int k = 0; k < 3; k++) {
        assert_near((plant_p_unit[k] * (double)identifier.estimator.p[k]) / plant_p[k], 1.0, 0.02);
    }
}

/* While it is frozen every whole window is dropped and nothing moves; then it goes on without warming up again. */
static void frozen_form_keeps_sums_and_resumes_bumplessly(void **state)
{
    config.estimator.forgetting_groups = 8;
    start();
    plant_state plant = released_plant();
    run(&plant, 9000, 0, NULL);
    pvid_weak_freeze_q31(&identifier, true);
    run(&plant, HOP, 0, NULL); /* the window in work is finished */
    const pvid_information_q31 sums = identifier.estimator.information;
    const pvid_counters counters = identifier.estimator.counters;
    const pvid_trust_q31 trust = identifier.trust;
    int reasons[16] = {0};
    run(&plant, 10 * HOP, 0, reasons);
    assert_int_equal(reasons[PVID_HELD_FROZEN], 10);
    assert_int_equal(reasons[PVID_ACCUMULATED], (10 * HOP) - 10);
    assert_memory_equal(&identifier.estimator.information, &sums, sizeof sums);
    assert_memory_equal(&identifier.estimator.counters, &counters, sizeof counters);
    assert_memory_equal(&identifier.trust.estimate, &trust.estimate, offsetof(pvid_estimate_q31, standing));
    assert_int_equal(identifier.trust.groups, trust.groups);
    assert_int_equal(identifier.trust.estimate.standing.age, trust.estimate.standing.age + 10);
    pvid_weak_freeze_q31(&identifier, false);
    int after[16] = {0};
    run(&plant, 2 * HOP, 0, after);
    assert_int_equal(after[PVID_HELD_FROZEN] + after[PVID_WARMING_UP], 0);
    assert_in_range(judged(after), 1, 2);
}

/* Somebody holds the pendulum back for a moment: the windows that hold it are left out, by name, and without the gate
 * they are taken in. */
static void the_gate_keeps_a_jolt_out(void **state)
{
    for (int gated = 0; gated < 2; gated++) {
        start_again(NULL);
        config.gate.sigmas = (gated == 1) ? (4u << 16) : 0u;
        start();
        plant_state plant = released_plant();
        int reasons[16] = {0};
        run(&plant, FIRST_TICKS + (17 * HOP) + (HOP / 2), 0, reasons); /* the rows of its last window are in */
        assert_int_equal(reasons[PVID_REJECTED_OUTLIER], 0);
        const uint32_t rows = identifier.estimator.counters.rows;
        for (int i = 0; i < 4 * HOP; i++) {
            const int32_t shaken = (i < 300) ? (i / 6) : ((i < 600) ? ((600 - i) / 6) : 0);
            reasons[tick(&identifier, &plant, shaken)]++;
        }
        const int refused = reasons[PVID_REJECTED_OUTLIER];
        assert_in_range(refused, (gated == 1) ? 2 : 0, (gated == 1) ? 3 : 0);
        assert_int_equal(identifier.estimator.counters.rejected_outlier, refused);
        assert_int_equal(identifier.estimator.counters.rows - rows, ROWS * (4 - refused));
    }
}

/* Any counts within full scale, a pivot that trembles and one that leaps. */
static void random_counts_keep_every_bound(void **state)
{
    config.drive_min = NULL;
    config.estimator.kappa_min = 0;
    config.estimator.noise_margin = 0;
    start();
    uint32_t generator = 1u;
    for (int i = 0; i < 30000; i++) {
        const int32_t range[2] = {((i / 3000) % 2 == 0) ? 3 : 300, kapitza_full_scale_q31[PLANT_PHI]};
        int32_t reading[2];
        for (int k = 0; k < 2; k++) {
            generator = (generator * 1664525u) + 1013904223u;
            reading[k] = (int32_t)((generator >> 8) % (2u * (uint32_t)range[k] + 1u)) - range[k];
        }
        (void)pvid_weak_step_q31(&identifier, reading);
        for (int k = 0; k < 4; k++) {
            const int32_t p = identifier.estimator.p[k];
            assert_true((p >= config.estimator.lower[k]) && (p <= config.estimator.upper[k]));
        }
    }
    assert_true(identifier.estimator.counters.rows > 0u);
}

/* The stages that a window's work takes are those that init counts with: the last one ends it, not one before. */
static void a_window_takes_the_stages_that_init_counts_with(void **state)
{
    for (uint8_t iterations = 1; iterations <= 3; iterations++) {
        config.iterations = iterations;
        start();
        plant_state plant = released_plant();
        uint32_t most = 0;
        for (int windows = 0; windows < 6;) {
            (void)tick(&identifier, &plant, 0);
            if (!pvid_weak_finish_is_busy_q31(&identifier.finish)) {
                continue;
            }
            windows++;
            uint32_t stages = 0;
            pvid_reason reason = PVID_ACCUMULATED;
            while (pvid_weak_finish_is_busy_q31(&identifier.finish)) {
                stages++;
                pvid_weak_finish_step_q31(&identifier, &reason);
            }
            most = (stages > most) ? stages : most;
        }
        assert_in_range(most, 1, pvid_weak_finish_stages_q31(&identifier));
    }
}

/* By the compensation, the check for noise, or an error of the first kind's own; else it would be computed in vain. */
static void the_noise_is_computed_where_it_is_used(void **state)
{
    static const pvid_scaled_q31 own_error[1] = {{1 << 29, -40}};
    start();
    assert_true(identifier.finish.known.used);
    config.compensation = false;
    start();
    assert_true(identifier.finish.known.used);
    config.estimator.noise_margin = 0;
    start();
    assert_false(identifier.finish.known.used);
    design.error_variance = own_error;
    start();
    assert_true(identifier.finish.known.used);
}

/* Seven harmonics of two half windows are joined one at a tick, or four at a tick where a step is one. */
static void ticks_behind_the_join_are_those_without_harmonics(void **state)
{
    assert_int_equal(pvid_weak_ticks_behind_join_q31(&design), (4 * 23) - 14);
    design.decimation = 1;
    assert_int_equal(pvid_weak_ticks_behind_join_q31(&design), 0);
    design.decimation = 3; /* eight ticks, two at a tick */
    assert_int_equal(pvid_weak_ticks_behind_join_q31(&design), 1);
}

static void a_weight_beyond_its_counter_is_its_end(void **state)
{
    start();
    pvid_information_q31 *information = &identifier.estimator.information;
    pvid_estimate_q31 estimate;
    int64_t *weight = &information->sums[information->n_sums - 1u];
    *weight = ((int64_t)UINT32_MAX << 16) + 65535;
    pvid_estimator_assess_q31(&identifier.estimator, &estimate);
    assert_true(estimate.weight == UINT32_MAX);
    *weight = (int64_t)1 << 50;
    pvid_estimator_assess_q31(&identifier.estimator, &estimate);
    assert_true(estimate.weight == UINT32_MAX);
    *weight = ((int64_t)UINT32_MAX - 1) << 16;
    pvid_estimator_assess_q31(&identifier.estimator, &estimate);
    assert_true(estimate.weight == UINT32_MAX - 1u);
}

/* ---- snapshots ---- */

static uint8_t image[PVID_SNAPSHOT_WEAK_Q31];
static uint8_t again[PVID_SNAPSHOT_WEAK_Q31];

static void a_snapshot_that_does_not_fit_is_not_written_and_one_of_another_is_not_read(void **state)
{
    static pvid_weak_q31 before;
    start();
    plant_state plant = released_plant();
    run(&plant, 2000, 0, NULL);
    before = identifier;
    memset(again, 0x5A, sizeof again);
    memcpy(image, again, sizeof image);
    assert_int_equal(pvid_snapshot_save_weak_q31(&identifier, &config, 3, image, sizeof image - 1u), 0);
    assert_memory_equal(image, again, sizeof image);
    assert_int_equal(pvid_snapshot_save_weak_q31(&identifier, &config, 3, image, sizeof image), sizeof image);
    assert_int_equal(pvid_get_u32(&image[32]), 3);
    config.iterations = 3;
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &config, image, sizeof image),
                     PVID_SNAPSHOT_OTHER_CONFIG);
    config.iterations = 2;
    design.sum_shift++;
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &config, image, sizeof image),
                     PVID_SNAPSHOT_OTHER_DESIGN);
    design.sum_shift--;
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &config, image, sizeof image - 1u),
                     PVID_SNAPSHOT_CUT_SHORT);
    image[1000] ^= 1u;
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &config, image, sizeof image), PVID_SNAPSHOT_DAMAGED);
    assert_memory_equal(&before, &identifier, sizeof before);
    image[1000] ^= 1u;
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &config, image, sizeof image), PVID_SNAPSHOT_RESTORED);
    assert_memory_equal(&before, &identifier, sizeof before);
}

/* From the first sample to the first step: the longest compensator; of signals that need other ticks two at least; of
 * block sums one block more. */
static void the_lead_is_what_the_front_end_needs(void **state)
{
    for (uint16_t half = 0; half < 5u; half++) {
        const pvid_weak_front_q31 plain = {.decimation = 1, .half = half};
        const pvid_weak_front_q31 derived = {.decimation = 1, .half = half, .needs = 1};
        const pvid_weak_front_q31 summed = {.decimation = 6, .half = half, .needs = 1};
        assert_int_equal(pvid_weak_front_lead_q31(&plain), half);
        assert_int_equal(pvid_weak_front_lead_q31(&derived), (half < 2u) ? 2u : half);
        assert_int_equal(pvid_weak_front_lead_q31(&summed), 6u * (half + 1u));
    }
}

/* Of each tick the sum of what the signals are by their definition; a held one needs the tick behind it. */
static void signals_of_several_ticks_are_those_of_their_definition(void **state)
{
    static const int32_t counts[8][2] = {{10, -5}, {13, 2}, {-4, 9}, {8, 8}, {0, -7}, {31, 1}, {-2, 4}, {6, 6}};
    static const int32_t zero[2] = {3, -2};
    static const int32_t full_scale[2] = {100, 100};
    static const uint8_t sources[4] = {PVID_SIGNAL_SAMPLED, PVID_SIGNAL_JUMP, PVID_SIGNAL_LAST, PVID_SIGNAL_HELD};
    for (int held = 0; held < 2; held++) {
        pvid_weak_signal signal[8];
        const uint8_t of_each = (held != 0) ? 4u : 3u;
        for (uint8_t i = 0; i < (2u * of_each); i++) {
            signal[i].sample = (uint8_t)(i / of_each);
            signal[i].source = sources[i % of_each];
        }
        const pvid_weak_model_q31 model = {.samples = 2, .signals = (uint8_t)(2u * of_each), .signal = signal};
        const pvid_weak_design_q31 derived = {.model = &model, .decimation = 1, .full_scale = full_scale};
        pvid_weak_front_q31 front;
        memset(&front, 0, sizeof front);
        front.needs = (held != 0) ? 2u : 1u;
        front.signals = model.signals;
        front.decimation = 1;
        front.offset = zero;
        for (int k = 0; k < 8; k++) {
            memset(front.line, 0, sizeof front.line);
            assert_true(pvid_weak_front_derive_q31(&front, &derived, counts[k]));
            if ((held != 0) && (k == 0)) {
                assert_int_equal(front.wait, 1); /* its signals are not there yet */
                continue;
            }
            for (size_t i = 0; i < model.signals; i++) {
                int32_t x[4]; /* this tick and those before it, before the first one as it */
                for (int back = 0; back < 4; back++) {
                    const int tick = ((k - back) > 0) ? (k - back) : 0;
                    x[back] = counts[tick][signal[i].sample] - zero[signal[i].sample];
                }
                const int32_t *at = &x[held]; /* the tick that is complete */
                const int32_t expected[4] = {at[0], at[0] - at[1], at[1], (13 * (x[2] + x[1])) - (x[3] + x[0])};
                int32_t found = expected[3];
                for (int source = 0; source < 3; source++) {
                    found = (signal[i].source == sources[source]) ? expected[source] : found;
                }
                assert_int_equal(front.line[2u * i], found);
                assert_int_equal(front.line[(2u * i) + 1u], found);
            }
        }
        const int32_t beyond[2] = {103, 99};
        assert_false(pvid_weak_front_derive_q31(&front, &derived, beyond));
    }
}

/* Between windows a tick that ends no step has nothing to do, and costs little: its answer is there. */
static void ticks_without_work_have_their_answer(void **state)
{
    start();
    assert_int_equal(identifier.task, PVID_WARMING_UP);
    plant_state plant = released_plant();
    uint32_t idle = 0;
    for (int i = 0; i < (5 * PLANT_HOP_TICKS); i++) {
        const pvid_reason reason = tick(&identifier, &plant, 0);
        idle += (identifier.task == (uint8_t)PVID_ACCUMULATED) ? 1u : 0u;
        assert_true((reason != PVID_WARMING_UP) || (i < (3 * PLANT_HOP_TICKS)));
    }
    assert_true(idle > (uint32_t)PLANT_HOP_TICKS);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test_setup(the_pendulum_is_identified_with_its_encoders_zero, start_again),
    cmocka_unit_test_setup(a_reading_beyond_full_scale_restarts_windows_and_keeps_sums, start_again),
    cmocka_unit_test_setup(a_gap_is_a_reading_beyond_full_scale_without_the_reading, start_again),
    cmocka_unit_test_setup(start_is_held_with_reason_without_drive, start_again),
    cmocka_unit_test_setup(laws_and_forgetting_take_their_settings, start_again),
    cmocka_unit_test_setup(frozen_form_keeps_sums_and_resumes_bumplessly, start_again),
    cmocka_unit_test_setup(the_gate_keeps_a_jolt_out, start_again),
    cmocka_unit_test_setup(random_counts_keep_every_bound, start_again),
    cmocka_unit_test_setup(a_window_takes_the_stages_that_init_counts_with, start_again),
    cmocka_unit_test_setup(the_noise_is_computed_where_it_is_used, start_again),
    cmocka_unit_test_setup(ticks_behind_the_join_are_those_without_harmonics, start_again),
    cmocka_unit_test_setup(a_weight_beyond_its_counter_is_its_end, start_again),
    cmocka_unit_test_setup(a_snapshot_that_does_not_fit_is_not_written_and_one_of_another_is_not_read, start_again),
    cmocka_unit_test(the_lead_is_what_the_front_end_needs),
    cmocka_unit_test(signals_of_several_ticks_are_those_of_their_definition),
    cmocka_unit_test(ticks_without_work_have_their_answer),
};
RUN(tests)
