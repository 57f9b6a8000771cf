/* The fixed-point strong form: rows against their formulas in wide integers, and the identifier's edges. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pvid/pvid_q31.h"

/* Shifts of 0: what fits is exact. */
static void a_row_is_the_formula(void **state)
{
    (void)state;
    const pvid_strong_row_q31 exact = {0};
    const int32_t phi[PVID_ORDERS] = {7, 1000, -11, 13, 17};
    const int32_t u[PVID_Y_ORDERS_Q31] = {-5, 3, 19};
    int32_t y;
    int32_t n[PVID_KAPITZA_STRONG_THETA];
    assert_true(pvid_kapitza_strong_row_q31(&exact, phi, u, &y, n));
    /* Y = u^2 phi4 - 2 u u' phi3 + (2 u'^2 - u u'') phi2 */
    assert_int_equal(y, (25 * 17) + (2 * 5 * 3 * 13) + ((18 + 95) * -11));
    /* N_1 = -2 u phi4 + 2 u' phi3 + u'' phi2 */
    assert_int_equal(n[0], (10 * 17) + (6 * 13) + (19 * -11));
    const int32_t rest[10] = {-17, 125 * -11, -25 * -11, 5 * -11, 11, -625 * 7, 125 * 7, -25 * 7, 5 * 7, -7};
    for (size_t i = 0; i < 10u; i++) {
        assert_int_equal(n[i + 1u], rest[i]);
    }
}

static void shifts_round_half_up(void **state)
{
    (void)state;
    const pvid_strong_row_q31 shifts = {
        .n_a = 2, .n_e = 1, .n_phi2 = {1, 1, 1, 1}, .n_phi0 = {2, 0, 0, 0, 0}, .part = 1, .y = 3};
    const int32_t phi[PVID_ORDERS] = {10, 0, 3, 0, 5};
    const int32_t u[PVID_Y_ORDERS_Q31] = {3, 1, 1};
    int32_t y;
    int32_t n[PVID_KAPITZA_STRONG_THETA];
    assert_true(pvid_kapitza_strong_row_q31(&shifts, phi, u, &y, n));
    /* bracket 3 - 15 = -12, a = -6; b = 3/2 -> 2; Y = (4 + 18)/8 = 2.75 -> 3; N_1 = (-12 - 15)/4 = -6.75 -> -7 */
    assert_int_equal(y, 3);
    assert_int_equal(n[0], -7);
    assert_int_equal(n[1], -2);  /* -2.5 */
    assert_int_equal(n[5], -1);  /* -1.5 */
    assert_int_equal(n[4], -1);  /* 3 (-1)/2 = -1.5 */
    assert_int_equal(n[10], -2); /* -2.5 */
    assert_int_equal(n[6], -2 * 81);
}

static void a_row_that_does_not_fit_is_refused(void **state)
{
    (void)state;
    pvid_strong_row_q31 shifts = {0};
    int32_t phi[PVID_ORDERS] = {0, 0, 0, 0, PVID_ROW_LIMIT_Q31};
    int32_t u[PVID_Y_ORDERS_Q31] = {0, 0, 0};
    int32_t y;
    int32_t n[PVID_KAPITZA_STRONG_THETA];
    assert_true(pvid_kapitza_strong_row_q31(&shifts, phi, u, &y, n));
    phi[4]++;
    assert_false(pvid_kapitza_strong_row_q31(&shifts, phi, u, &y, n));
    phi[4] = 0;
    phi[0] = 1 << 8;
    u[0] = 1 << 5; /* u^4 phi = 2^28 */
    assert_true(pvid_kapitza_strong_row_q31(&shifts, phi, u, &y, n));
    phi[0]++;
    assert_false(pvid_kapitza_strong_row_q31(&shifts, phi, u, &y, n));
    /* every derivative at its limit: no product overflows, and the row is refused */
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        phi[k] = ((k % 2u) == 0u) ? PVID_DERIVATIVE_LIMIT_Q31 : -PVID_DERIVATIVE_LIMIT_Q31;
    }
    for (size_t k = 0; k < PVID_Y_ORDERS_Q31; k++) {
        u[k] = (k == 1u) ? -PVID_DERIVATIVE_LIMIT_Q31 : PVID_DERIVATIVE_LIMIT_Q31;
    }
    assert_false(pvid_kapitza_strong_row_q31(&shifts, phi, u, &y, n));
}

/* theta and C are polynomials of p: with formats of whole numbers, their integers are exact up to their formats. */
static void theta_and_its_jacobian_are_those_of_the_model(void **state)
{
    (void)state;
    const pvid_model_q31 *model = &pvid_kapitza_strong_q31;
    const int8_t p_bits[3] = {26, 27, 27};
    const double p[3] = {14.5, 8.75, 5.5};
    const int32_t fixed[3] = {(int32_t)(p[0] * 67108864.0), (int32_t)(p[1] * 134217728.0),
                              (int32_t)(p[2] * 134217728.0)};
    int16_t theta_bits[PVID_KAPITZA_STRONG_THETA];
    int16_t c_bits[18];
    int64_t theta[PVID_KAPITZA_STRONG_THETA];
    int64_t c[18];
    model->formats(p_bits, theta_bits, c_bits);
    model->theta(fixed, theta);
    model->jacobian(fixed, c);
    const double w = p[0];
    const double expected[PVID_KAPITZA_STRONG_THETA] = {
        w,
        w * w,
        p[1],
        3 * p[1] * w,
        3 * p[1] * w * w,
        p[1] * w * w * w,
        p[2],
        4 * p[2] * w,
        6 * p[2] * w * w,
        4 * p[2] * w * w * w,
        p[2] * w * w * w * w,
    };
    for (size_t i = 0; i < PVID_KAPITZA_STRONG_THETA; i++) {
        const double ratio = (double)theta[i] / (expected[i] * (double)((int64_t)1 << theta_bits[i]));
        assert_true((ratio > 1.0 - 1e-7) && (ratio < 1.0 + 1e-7));
    }
    const double entries[18] = {
        1,
        2 * w,
        3 * p[1],
        6 * p[1] * w,
        3 * p[1] * w * w,
        4 * p[2],
        12 * p[2] * w,
        12 * p[2] * w * w,
        4 * p[2] * w * w * w,
        1,
        3 * w,
        3 * w * w,
        w * w * w,
        1,
        4 * w,
        6 * w * w,
        4 * w * w * w,
        w * w * w * w,
    };
    for (size_t k = 0; k < 18u; k++) {
        const double ratio = (double)c[k] / (entries[k] * (double)((int64_t)1 << c_bits[k]));
        assert_true((ratio > 1.0 - 1e-7) && (ratio < 1.0 + 1e-7));
    }
    /* p at the end of its type: nothing wraps, all stays below 2^60 */
    const int32_t largest[3] = {INT32_MAX, INT32_MAX, INT32_MAX};
    model->theta(largest, theta);
    model->jacobian(largest, c);
    for (size_t i = 0; i < PVID_KAPITZA_STRONG_THETA; i++) {
        assert_true((theta[i] > 0) && (theta[i] < ((int64_t)1 << 60)));
    }
    for (size_t k = 0; k < 18u; k++) {
        assert_true((c[k] > 0) && (c[k] < ((int64_t)1 << 60)));
    }
}

static pvid_strong_config_q31 settings(void)
{
    const pvid_strong_config_q31 config = {
        .bank =
            {.half = 2, .stride = 1, .phi_max = 80000, .y_max = 6000, .centre = 12, .weights = pvid_five_points_q31},
        .row = {.n_a = 21, .n_phi2 = {0, 21, 28, 28}, .n_phi0 = {0, 24, 28, 28, 27}, .part = 20, .y = 29},
        .u_multiplier = 1563749871,
        .u_shift = 16,
        .drive_ticks = 50,
        .estimator =
            {
                .start = {45256288, 165558848, 190184304},
                .start_sd = {22628144, 82779424, 95092152},
                .lower = {2806045, 4194304, 5033165},
                .upper = {1122418085, 1677721600, 2013265920},
                .p_bits = {32, 24, 25},
                .n_bits = {13, 0, 25, 19, 13, 0, 29, 22, 16, 10, 0},
                .y_bits = 19,
                .row_sd = 331350,
                .gain = 1 << 30,
                .correlation = 131072u,
                .row_weight = 65536u,
                .step_limit = 19661u,
                .kappa_min = 10737,
                .divider = 1,
            },
    };
    return config;
}

static void limits_of_a_run_are_reported(void **state)
{
    (void)state;
    pvid_strong_config_q31 config = settings();
    config.phi_offset = -100;
    config.y_offset = 7;
    static pvid_strong_q31 self;
    assert_int_equal(pvid_strong_init_q31(&self, &config), PVID_OK);
    for (int32_t i = 0; i < 4; i++) {
        assert_int_equal(pvid_strong_step_q31(&self, i - 100, 7), PVID_WARMING_UP);
    }
    /* full scale about the offsets is taken in, one count more is not, and empties the window */
    assert_int_equal(pvid_strong_step_q31(&self, 80001 - 100, 7), PVID_REJECTED_SATURATED);
    assert_int_equal(pvid_strong_step_q31(&self, 80000 - 100, 7 - 6000), PVID_WARMING_UP);
    assert_int_equal(pvid_strong_step_q31(&self, INT32_MIN, 7), PVID_REJECTED_SATURATED);
    assert_int_equal(pvid_strong_step_q31(&self, -100, INT32_MAX), PVID_REJECTED_SATURATED);
    assert_int_equal(self.estimator.counters.rejected_saturated, 3);
    for (int32_t i = 0; i < 4; i++) {
        assert_int_equal(pvid_strong_step_q31(&self, -100, 7), PVID_WARMING_UP);
    }
    /* a pivot that jumps by full scale accelerates beyond the expected range: the row is refused, the window stays */
    assert_int_equal(pvid_strong_step_q31(&self, -100, 7 + 6000), PVID_REJECTED_SATURATED);
    pvid_strong_gap_q31(&self);
    assert_int_equal(pvid_strong_step_q31(&self, -100, 7), PVID_WARMING_UP);
}

static void a_still_pivot_is_no_drive(void **state)
{
    (void)state;
    pvid_strong_config_q31 config = settings();
    config.drive_min = 1 << 20;
    static pvid_strong_q31 self;
    assert_int_equal(pvid_strong_init_q31(&self, &config), PVID_OK);
    uint32_t held = 0;
    for (int32_t i = 0; i < 200; i++) {
        const pvid_reason reason = pvid_strong_step_q31(&self, (i * 37) % 900, (i % 3 == 0) ? 1 : 0);
        assert_true((reason == PVID_WARMING_UP) || (reason == PVID_HELD_NOT_EXCITED));
        held += (reason == PVID_HELD_NOT_EXCITED) ? 1u : 0u;
    }
    assert_int_equal(held, 196);
    assert_int_equal(self.estimator.counters.held_not_excited, 196);
    assert_int_equal(self.estimator.counters.rows, 0);
    assert_memory_equal(self.estimator.p, config.estimator.start, 3 * sizeof(int32_t));
}

/* Frozen, it takes no row in but keeps its window filled; then it goes on with the next sample. */
static void frozen_form_accepts_no_row(void **state)
{
    (void)state;
    const pvid_strong_config_q31 config = settings();
    static pvid_strong_q31 self;
    assert_int_equal(pvid_strong_init_q31(&self, &config), PVID_OK);
    for (int32_t i = 0; i < 50; i++) {
        (void)pvid_strong_step_q31(&self, (i * 37) % 900, i % 40);
    }
    const uint32_t rows = self.estimator.counters.rows;
    assert_true(rows > 0u);
    const pvid_estimator_q31 before = self.estimator;
    pvid_strong_freeze_q31(&self, true);
    for (int32_t i = 50; i < 100; i++) {
        assert_int_equal(pvid_strong_step_q31(&self, (i * 37) % 900, i % 40), PVID_HELD_FROZEN);
    }
    assert_memory_equal(&self.estimator, &before, sizeof before);
    pvid_strong_freeze_q31(&self, false);
    for (int32_t i = 100; i < 150; i++) {
        assert_int_not_equal(pvid_strong_step_q31(&self, (i * 37) % 900, i % 40), PVID_WARMING_UP);
    }
    assert_true(self.estimator.counters.rows > rows);
}

/* A snapshot at every tick, from before the window is full on: both go on alike. */
static void a_restored_run_continues_bit_for_bit(void **state)
{
    (void)state;
    pvid_strong_config_q31 config = settings();
    config.gate.sigmas = 4u << 16;
    static pvid_strong_q31 self;
    static pvid_strong_q31 restored;
    static uint8_t image[PVID_SNAPSHOT_STRONG_Q31];
    assert_int_equal(pvid_strong_init_q31(&self, &config), PVID_OK);
    for (int32_t i = 0; i < 300; i++) {
        assert_int_equal(pvid_snapshot_save_strong_q31(&self, &config, 1, image, sizeof image), sizeof image);
        assert_int_equal(pvid_strong_init_q31(&restored, &config), PVID_OK);
        assert_int_equal(pvid_snapshot_restore_strong_q31(&restored, &config, image, sizeof image),
                         PVID_SNAPSHOT_RESTORED);
        assert_memory_equal(&restored, &self, sizeof self);
        const pvid_reason reason = pvid_strong_step_q31(&self, (i * 37) % 900, i % 40);
        assert_int_equal(pvid_strong_step_q31(&restored, (i * 37) % 900, i % 40), reason);
        assert_memory_equal(&restored, &self, sizeof self);
    }
    assert_int_equal(pvid_snapshot_save_strong_q31(&self, &config, 1, image, sizeof image - 1u), 0);
    config.row.part++;
    assert_int_equal(pvid_snapshot_restore_strong_q31(&restored, &config, image, sizeof image),
                     PVID_SNAPSHOT_OTHER_CONFIG);
    config.row.part--;
    image[100] ^= 4u;
    assert_int_equal(pvid_snapshot_restore_strong_q31(&restored, &config, image, sizeof image), PVID_SNAPSHOT_DAMAGED);
    assert_memory_equal(&restored, &self, sizeof self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_row_is_the_formula),
        cmocka_unit_test(shifts_round_half_up),
        cmocka_unit_test(a_row_that_does_not_fit_is_refused),
        cmocka_unit_test(theta_and_its_jacobian_are_those_of_the_model),
        cmocka_unit_test(limits_of_a_run_are_reported),
        cmocka_unit_test(a_still_pivot_is_no_drive),
        cmocka_unit_test(frozen_form_accepts_no_row),
        cmocka_unit_test(a_restored_run_continues_bit_for_bit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
