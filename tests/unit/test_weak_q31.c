/* The fixed-point weak form, whole: that it identifies, what it refuses, that it survives, that it can be saved. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "plant.h"
#include "pvid/little_endian.h"
#include "pvid/pvid_q31.h"
#include "weak_table_q31.h"

#define PHI_LSB 3.834951969714103e-4 /* rad, of weak_table_q31.toml */
#define Y_LSB 5.0e-6                 /* m */
#define FUNCTIONS 6
#define WINDOW 53
#define DECIMATION 24
#define HOP_TICKS (((WINDOW - 1) / 2) * DECIMATION)
#define FIRST_TICKS (71 + ((WINDOW - 1) * DECIMATION) + 11) /* taps, a window, the filter's job; then one each hop */
#define WINDOWS(ticks) ((((ticks) - FIRST_TICKS) / HOP_TICKS) + 1)

static pvid_weak_q31 identifier;
static pvid_weak_config_q31 config;

static int start_again(void **state)
{
    (void)state;
    config = weak_unit;
    return 0;
}

static void start(void)
{
    assert_int_equal(pvid_weak_init_q31(&identifier, &config), PVID_OK);
}

static int32_t counts_of(double x, double lsb)
{
    return (int32_t)floor((x / lsb) + 0.5);
}

static pvid_reason tick(pvid_weak_q31 *self, plant_state *plant, int32_t zero)
{
    double phi;
    double y;
    plant_step(plant, &phi, &y);
    return pvid_weak_step_q31(self, counts_of(phi, PHI_LSB) + zero, counts_of(y, Y_LSB));
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

/* What the integers of p count, from the table's banner. */
static const double unit[4] = {4.0421986745463477e-07, 5.9604644775390625e-08, 2.9802322387695312e-08,
                               1.4629180792671596e-09};

static void assert_near(double value, double truth, double tolerance)
{
    const double error = value - truth;
    assert_true((error < tolerance) && (error > -tolerance));
}

static void the_pendulum_is_identified_with_its_encoders_zero(void **state)
{
    (void)state;
    const int32_t zeros[3] = {0, 52, -261}; /* 0.02 and -0.1 rad */
    for (int i = 0; i < 3; i++) {
        start();
        plant_state plant = released_plant();
        int reasons[16] = {0};
        run(&plant, 20000, zeros[i], reasons);
        const pvid_estimate_q31 *estimate = pvid_weak_estimate_q31(&identifier);
        assert_true(identifier.trust.published);
        for (int k = 0; k < 3; k++) {
            /* 32 windows of a 14-bit encoder with half the functions of a real design */
            assert_near((unit[k] * (double)estimate->p[k]) / plant_p[k], 1.0, 5.0e-3);
        }
        assert_near(unit[3] * (double)estimate->p[3], zeros[i] * PHI_LSB, 2.0e-4);
        const int windows = reasons[PVID_UPDATED] + reasons[PVID_MISFIT] + reasons[PVID_HELD_UNCERTAIN];
        assert_int_equal(windows, WINDOWS(20000));
        assert_int_equal(reasons[PVID_ACCUMULATED] + windows + reasons[PVID_WARMING_UP], 20000);
        assert_in_range(reasons[PVID_HELD_UNCERTAIN], 1, 5);
        assert_int_equal(identifier.estimator.counters.updates, 3 * windows);
        assert_int_equal(identifier.estimator.counters.rows, FUNCTIONS * windows);
    }
}

static void a_zeroed_encoder_needs_five_entries(void **state)
{
    (void)state;
    config.zero_unknown = false;
    start();
    plant_state plant = released_plant();
    run(&plant, 15000, 0, NULL);
    assert_int_equal(identifier.estimator.model->n_theta, PVID_KAPITZA_ZEROED_THETA);
    for (int k = 0; k < 3; k++) {
        assert_near((unit[k] * (double)identifier.estimator.p[k]) / plant_p[k], 1.0, 5.0e-3);
    }
}

/* The first window's mean is where c starts, whichever sign it has, and no further than c may go. */
static void the_first_window_places_the_zero(void **state)
{
    (void)state;
    const int32_t angles[5] = {0, 700, -700, 1304, -1304};
    for (int i = 0; i < 5; i++) {
        start_again(NULL);
        config.drive_min = 0;
        config.estimator.kappa_min = 1; /* nothing moves: no step */
        start();
        while (!identifier.warm) {
            (void)pvid_weak_step_q31(&identifier, angles[i], 0);
        }
        const double placed = unit[3] * (double)identifier.estimator.p[3];
        assert_near(placed, angles[i] * PHI_LSB, 1.0e-3 * PHI_LSB);
        assert_int_equal(identifier.trust.estimate.p[3], identifier.estimator.p[3]);
        config.estimator.upper[3] = 1 << 20;
        config.estimator.lower[3] = -(1 << 20);
        start();
        while (!identifier.warm) {
            (void)pvid_weak_step_q31(&identifier, angles[i], 0);
        }
        assert_int_equal(identifier.estimator.p[3], (i == 0) ? 0 : (((i % 2) == 1) ? (1 << 20) : -(1 << 20)));
    }
}

static void sample_beyond_full_scale_restarts_windows_and_keeps_sums(void **state)
{
    (void)state;
    config.phi_offset = 40;
    config.y_offset = -7;
    start();
    const int32_t phi_max = weak_unit_design.phi_max;
    const int32_t y_max = weak_unit_design.y_max;
    const int32_t good[4][2] = {{phi_max, 0}, {-phi_max, 0}, {0, y_max}, {0, -y_max}};
    const int32_t bad[4][2] = {{phi_max + 1, 0}, {-phi_max - 1, 0}, {0, y_max + 1}, {0, -y_max - 1}};
    const int32_t far[4][2] = {{INT32_MIN, -7}, {INT32_MAX, -7}, {40, INT32_MIN}, {40, INT32_MAX}};
    for (int i = 0; i < 4; i++) {
        assert_int_equal(pvid_weak_step_q31(&identifier, good[i][0] + 40, good[i][1] - 7), PVID_WARMING_UP);
        assert_int_equal(pvid_weak_step_q31(&identifier, bad[i][0] + 40, bad[i][1] - 7), PVID_REJECTED_SATURATED);
        assert_int_equal(pvid_weak_step_q31(&identifier, far[i][0], far[i][1]), PVID_REJECTED_SATURATED);
    }
    assert_int_equal(identifier.estimator.counters.rejected_saturated, 8);
    start_again(NULL);
    start();
    plant_state plant = released_plant();
    run(&plant, 6200, 0, NULL); /* the rows of its last window are in */
    const pvid_information_q31 before = identifier.estimator.information;
    assert_int_equal(pvid_weak_step_q31(&identifier, phi_max + 1, 0), PVID_REJECTED_SATURATED);
    assert_memory_equal(&before, &identifier.estimator.information, sizeof before);
    assert_false(identifier.warm);
    int reasons[16] = {0};
    const uint32_t rows = identifier.estimator.counters.rows;
    run(&plant, 8000, 0, reasons);
    assert_int_equal(reasons[PVID_WARMING_UP], FIRST_TICKS - 1);
    assert_int_equal(identifier.estimator.counters.rows - rows, FUNCTIONS * WINDOWS(8000));
}

static void a_gap_is_a_sample_beyond_full_scale_without_the_sample(void **state)
{
    (void)state;
    static pvid_weak_q31 gapped;
    start();
    plant_state plant = released_plant();
    run(&plant, 4321, 0, NULL);
    gapped = identifier;
    pvid_weak_gap_q31(&gapped);
    (void)pvid_weak_step_q31(&identifier, INT32_MAX, 0);
    assert_int_equal(identifier.estimator.counters.rejected_saturated, 1);
    identifier.estimator.counters.rejected_saturated = 0;
    assert_memory_equal(&gapped, &identifier, sizeof gapped);
}

/* The pivot leaps from one end of its travel to the other at the rate that the smoothing filter lets through best: no
 * such acceleration is within u_max. */
/* Gap after gap before any window has come round: sums that went on from one to the next would overflow in the end, by
 * the square of a second difference of F after little more than an hour. */
static void gap_stops_the_running_sums(void **state)
{
    (void)state;
    pvid_weak_design_q31 design = weak_unit_design;
    design.lag = 1;
    config.design = &design;
    start();
    int64_t curvatures = 0;
    int64_t squares = 0;
    for (int turn = 0; turn < 5; turn++) {
        for (int i = 0; i < HOP_TICKS; i++) {
            const int32_t angle = (((i / DECIMATION) % 2) == 0) ? design.phi_max : -design.phi_max;
            (void)pvid_weak_step_q31(&identifier, angle, (i * i) / 4096);
        }
        const pvid_weak_window_q31 *half_way = &identifier.window[1];
        assert_false(half_way->whole);
        assert_true((half_way->curvature_square_sum > 0) && (half_way->u_square_sum > 0));
        curvatures = (turn == 0) ? half_way->curvature_square_sum : curvatures;
        squares = (turn == 0) ? half_way->u_square_sum : squares;
        assert_true((half_way->curvature_square_sum == curvatures) && (half_way->u_square_sum == squares));
        pvid_weak_gap_q31(&identifier);
    }
}

/* A table of which init knows no more than that its entries fit, and whose matrix has no Cholesky factor: a row with
 * nine entries that come out as 1, whose squares an int64 in Q60 cannot hold. */
static void a_gram_table_without_a_factor_is_noticed_whatever_it_holds(void **state)
{
    (void)state;
    enum { MANY = 10, TRIANGLE = (MANY * (MANY + 1)) / 2 };
    static int16_t chi[3 * MANY * WINDOW];
    static int32_t gram[6 * TRIANGLE];
    for (int row = 0; row < MANY; row++) {
        const int start = (row * (row + 1)) / 2;
        gram[start + row] = (int32_t)1 << 26;
        for (int j = 0; (row == MANY - 1) && (j < row); j++) {
            gram[start + j] = (int32_t)1 << 28;
        }
    }
    pvid_weak_design_q31 design = weak_unit_design;
    design.functions = MANY;
    design.chi = chi;
    design.gram = gram;
    for (int i = 0; i < PVID_WEAK_GRAMS; i++) {
        design.gram_bits[i] = (int8_t)((i == 0) ? -128 : 127);
    }
    config.design = &design;
    start();
    plant_state plant = released_plant();
    bool noticed = false;
    for (int i = 0; i < FIRST_TICKS + HOP_TICKS; i++) {
        (void)tick(&identifier, &plant, 0);
        noticed = noticed || ((i > FIRST_TICKS) && !identifier.finish.whitened);
    }
    assert_true(noticed);
}

static void an_acceleration_beyond_its_range_is_refused(void **state)
{
    (void)state;
    start();
    uint32_t refused = 0;
    for (int i = 0; i < 40 * DECIMATION; i++) {
        const int32_t y = (((i / 36) % 2) == 0) ? weak_unit_design.y_max : -weak_unit_design.y_max;
        refused += (pvid_weak_step_q31(&identifier, 0, y) == PVID_REJECTED_SATURATED) ? 1u : 0u;
    }
    assert_true(refused >= 1u);
    assert_int_equal(identifier.estimator.counters.rejected_saturated, refused);
}

static void start_is_held_with_reason_without_drive(void **state)
{
    (void)state;
    start();
    int reasons[16] = {0};
    plant_state plant = released_plant();
    for (int i = 0; i < 10000; i++) { /* the pendulum swings, the pivot stands */
        double phi;
        double y;
        plant_step(&plant, &phi, &y);
        reasons[pvid_weak_step_q31(&identifier, counts_of(phi, PHI_LSB), 200)]++;
    }
    assert_memory_equal(identifier.estimator.p, config.estimator.start, 4 * sizeof(int32_t));
    assert_int_equal(reasons[PVID_HELD_NOT_EXCITED], WINDOWS(10000));
    assert_int_equal(identifier.estimator.counters.held_not_excited, reasons[PVID_HELD_NOT_EXCITED]);
    assert_int_equal(identifier.estimator.counters.rows, 0);
    assert_int_equal(reasons[PVID_WARMING_UP] + reasons[PVID_ACCUMULATED] + reasons[PVID_HELD_NOT_EXCITED], 10000);
}

/* The paper's law and a mixture of both step once a window, and forgetting keeps fewer rows. */
static void laws_and_forgetting_take_their_settings(void **state)
{
    (void)state;
    const int32_t gains[2] = {0, 1 << 29};
    for (int i = 0; i < 2; i++) {
        start_again(NULL);
        config.estimator.gain = gains[i];
        config.estimator.forgetting_groups = 8;
        config.trust.renewal = 0; /* the paper's law never settles here */
        start();
        plant_state plant = released_plant();
        run(&plant, 30000, 0, NULL);
        const uint32_t windows = WINDOWS(30000);
        assert_int_equal(identifier.estimator.counters.rows, FUNCTIONS * windows);
        assert_int_equal(identifier.estimator.counters.updates, windows);
        pvid_estimate_q31 estimate;
        pvid_estimator_assess_q31(&identifier.estimator, &estimate);
        assert_in_range(estimate.weight, 25, 33); /* eight windows of four free rows each */
        for (int k = 0; k < 3; k++) {
            assert_near((unit[k] * (double)identifier.estimator.p[k]) / plant_p[k], 1.0, (i == 0) ? 0.3 : 0.02);
        }
    }
}

/* While it is frozen every whole window is dropped and nothing moves; then it goes on without warming up again. */
static void frozen_form_keeps_sums_and_resumes_bumplessly(void **state)
{
    (void)state;
    config.estimator.forgetting_groups = 8;
    start();
    plant_state plant = released_plant();
    run(&plant, 9000, 0, NULL);
    pvid_weak_freeze_q31(&identifier, true);
    run(&plant, HOP_TICKS, 0, NULL); /* the window in work is finished */
    const pvid_information_q31 sums = identifier.estimator.information;
    const pvid_counters counters = identifier.estimator.counters;
    const pvid_trust_q31 trust = identifier.trust;
    int reasons[16] = {0};
    run(&plant, 10 * HOP_TICKS, 0, reasons);
    assert_int_equal(reasons[PVID_HELD_FROZEN], 10);
    assert_int_equal(reasons[PVID_ACCUMULATED], (10 * HOP_TICKS) - 10);
    assert_memory_equal(&identifier.estimator.information, &sums, sizeof sums);
    assert_memory_equal(&identifier.estimator.counters, &counters, sizeof counters);
    assert_memory_equal(&identifier.trust, &trust, sizeof trust);
    pvid_weak_freeze_q31(&identifier, false);
    int after[16] = {0};
    run(&plant, 2 * HOP_TICKS, 0, after);
    assert_int_equal(after[PVID_HELD_FROZEN] + after[PVID_WARMING_UP], 0);
    assert_true((identifier.estimator.counters.rows - counters.rows) >= FUNCTIONS);
    assert_in_range(after[PVID_UPDATED] + after[PVID_MISFIT] + after[PVID_HELD_UNCERTAIN], 1, 2);
}

/* Somebody holds the pendulum back for a moment: the windows that hold it are left out, by name, and without the gate
 * they are taken in. */
static void the_gate_keeps_a_jolt_out(void **state)
{
    (void)state;
    for (int gated = 0; gated < 2; gated++) {
        start_again(NULL);
        config.gate.sigmas = (gated == 1) ? (4u << 16) : 0u;
        start();
        plant_state plant = released_plant();
        int reasons[16] = {0};
        run(&plant, 15000, 0, reasons);
        assert_int_equal(reasons[PVID_REJECTED_OUTLIER], 0);
        const uint32_t rows = identifier.estimator.counters.rows;
        for (int i = 0; i < 4 * HOP_TICKS; i++) {
            const int32_t shaken = (i < 300) ? (i / 6) : ((i < 600) ? ((600 - i) / 6) : 0);
            reasons[tick(&identifier, &plant, shaken)]++;
        }
        const int refused = reasons[PVID_REJECTED_OUTLIER];
        assert_in_range(refused, (gated == 1) ? 2 : 0, (gated == 1) ? 3 : 0);
        assert_int_equal(identifier.estimator.counters.rejected_outlier, refused);
        assert_int_equal(identifier.estimator.counters.rows - rows, FUNCTIONS * (4 - refused));
    }
}

static void random_counts_keep_every_bound(void **state)
{
    (void)state;
    config.drive_min = 0;
    config.estimator.kappa_min = 0;
    config.estimator.noise_margin = 0;
    start();
    uint32_t generator = 1u;
    for (int i = 0; i < 30000; i++) {
        int32_t sample[2];
        const int32_t range[2] = {weak_unit_design.phi_max, ((i / 3000) % 2 == 0) ? 3 : 300};
        for (int k = 0; k < 2; k++) {
            generator = (generator * 1664525u) + 1013904223u;
            sample[k] = (int32_t)((generator >> 8) % (2u * (uint32_t)range[k] + 1u)) - range[k];
        }
        (void)pvid_weak_step_q31(&identifier, sample[0], sample[1]);
        for (int k = 0; k < 4; k++) {
            const int32_t p = identifier.estimator.p[k];
            assert_true((p >= config.estimator.lower[k]) && (p <= config.estimator.upper[k]));
        }
    }
    assert_true(identifier.estimator.counters.rows > 0u);
}

/* ---- snapshots ---- */

static uint8_t image[PVID_SNAPSHOT_WEAK_Q31];
static uint8_t again[PVID_SNAPSHOT_WEAK_Q31];

static void a_restored_run_continues_bit_for_bit_from_every_tick(void **state)
{
    (void)state;
    static pvid_weak_q31 restored;
    start();
    plant_state plant = released_plant();
    run(&plant, 5000, 0, NULL);
    for (int i = 0; i < HOP_TICKS; i++) {
        assert_int_equal(pvid_snapshot_save_weak_q31(&identifier, &config, 1, image, sizeof image), sizeof image);
        assert_int_equal(pvid_weak_init_q31(&restored, &config), PVID_OK);
        assert_int_equal(pvid_snapshot_restore_weak_q31(&restored, &config, image, sizeof image),
                         PVID_SNAPSHOT_RESTORED);
        plant_state other = plant;
        const pvid_reason reason = tick(&identifier, &plant, 0);
        assert_int_equal(tick(&restored, &other, 0), reason);
        assert_memory_equal(&restored, &identifier, sizeof restored);
    }
}

static void a_snapshot_that_does_not_fit_is_not_written_and_one_of_another_is_not_read(void **state)
{
    (void)state;
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
    config.iterations = 2;
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &config, image, sizeof image),
                     PVID_SNAPSHOT_OTHER_CONFIG);
    config.iterations = 3;
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &config, image, sizeof image - 1u),
                     PVID_SNAPSHOT_CUT_SHORT);
    image[1000] ^= 1u;
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &config, image, sizeof image), PVID_SNAPSHOT_DAMAGED);
    assert_memory_equal(&before, &identifier, sizeof before);
    image[1000] ^= 1u;
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &config, image, sizeof image), PVID_SNAPSHOT_RESTORED);
    assert_memory_equal(&before, &identifier, sizeof before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_pendulum_is_identified_with_its_encoders_zero, start_again),
        cmocka_unit_test_setup(a_zeroed_encoder_needs_five_entries, start_again),
        cmocka_unit_test_setup(the_first_window_places_the_zero, start_again),
        cmocka_unit_test_setup(sample_beyond_full_scale_restarts_windows_and_keeps_sums, start_again),
        cmocka_unit_test_setup(a_gap_is_a_sample_beyond_full_scale_without_the_sample, start_again),
        cmocka_unit_test_setup(gap_stops_the_running_sums, start_again),
        cmocka_unit_test_setup(a_gram_table_without_a_factor_is_noticed_whatever_it_holds, start_again),
        cmocka_unit_test_setup(an_acceleration_beyond_its_range_is_refused, start_again),
        cmocka_unit_test_setup(start_is_held_with_reason_without_drive, start_again),
        cmocka_unit_test_setup(laws_and_forgetting_take_their_settings, start_again),
        cmocka_unit_test_setup(frozen_form_keeps_sums_and_resumes_bumplessly, start_again),
        cmocka_unit_test_setup(the_gate_keeps_a_jolt_out, start_again),
        cmocka_unit_test_setup(random_counts_keep_every_bound, start_again),
        cmocka_unit_test_setup(a_restored_run_continues_bit_for_bit_from_every_tick, start_again),
        cmocka_unit_test_setup(a_snapshot_that_does_not_fit_is_not_written_and_one_of_another_is_not_read, start_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
