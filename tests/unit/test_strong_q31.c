/* The fixed-point strong form: rows against their formulas in wide integers, and the identifier's edges. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "pvid/pvid_q31.h"

#define RATE(x) ((x) * (1 << PVID_KAPITZA_RATE_BITS))

static const pvid_strong_row_q31 exact = {.phi3 = 1 << 30, .reference = 0};

/* Rates that are whole numbers: what fits is exact. */
static void a_row_is_the_formula(void **state)
{
    (void)state;
    const int32_t phi[PVID_ORDERS] = {7, 1000, -11, 13, 17};
    const int32_t u[PVID_Y_ORDERS_Q31] = {RATE(-5), RATE(3), RATE(19)};
    int32_t row[PVID_KAPITZA_ROW_Q31];
    assert_true(pvid_kapitza_strong_row_q31(&exact, phi, u, row));
    /* Y = G^2 phi4 - 2 G u' phi3 + (2 u'^2 - G u'') phi2 */
    assert_int_equal(row[PVID_KAPITZA_ROW_Y], (25 * 17) + (2 * 5 * 3 * 13) + ((18 + 95) * -11));
    /* N_1 = -2 G phi4 + 2 u' phi3 + u'' phi2 */
    assert_int_equal(row[0], (10 * 17) + (6 * 13) + (19 * -11));
    const int32_t rest[10] = {-17, 125 * -11, -25 * -11, 5 * -11, 11, -625 * 7, 125 * 7, -25 * 7, 5 * 7, -7};
    for (size_t i = 0; i < 10u; i++) {
        assert_int_equal(row[i + 1u], rest[i]);
    }
    assert_int_equal(row[PVID_KAPITZA_ROW_G], RATE(-5));
}

/* The reference of w moves u, the units shift each family, and phi3 has a factor. */
static void a_row_has_its_formats(void **state)
{
    (void)state;
    const pvid_strong_row_q31 formats = {
        .phi_shift = {1, 0, 2, -1, 3}, .finer = {-1, 5}, .phi3 = 3 << 28, .reference = RATE(7)};
    const int32_t phi[PVID_ORDERS] = {7, 1000, -11, 16, 17};
    const int32_t u[PVID_Y_ORDERS_Q31] = {RATE(-5), RATE(3), RATE(19)};
    int32_t row[PVID_KAPITZA_ROW_Q31];
    assert_true(pvid_kapitza_strong_row_q31(&formats, phi, u, row));
    assert_int_equal(row[PVID_KAPITZA_ROW_G], RATE(2));
    assert_int_equal(row[0], (-4 * 136) + (6 * 6) + (19 * -44));
    assert_int_equal(row[1], -136);
    const int32_t rest[9] = {8 * 22, 4 * 22, 2 * 22, 22, -16 * 14, -8 * 14, -4 * 14, -2 * 14, -14};
    for (size_t i = 0; i < 9u; i++) {
        assert_int_equal(row[i + 2u], rest[i]);
    }
}

static void a_row_that_does_not_fit_is_refused(void **state)
{
    (void)state;
    int32_t phi[PVID_ORDERS] = {0, 0, 0, 0, PVID_ROW_LIMIT_Q31 - 1};
    int32_t u[PVID_Y_ORDERS_Q31] = {0, 0, 0};
    int32_t row[PVID_KAPITZA_ROW_Q31];
    assert_true(pvid_kapitza_strong_row_q31(&exact, phi, u, row));
    phi[4]++;
    assert_false(pvid_kapitza_strong_row_q31(&exact, phi, u, row));
    phi[4] = 0;
    phi[0] = 1 << 8;
    u[0] = RATE(1 << 5); /* G^4 phi = 2^28 */
    assert_true(pvid_kapitza_strong_row_q31(&exact, phi, u, row));
    phi[0]++;
    assert_false(pvid_kapitza_strong_row_q31(&exact, phi, u, row));
    /* every derivative at its limit: no product overflows, and the row is refused */
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        phi[k] = ((k % 2u) == 0u) ? PVID_DERIVATIVE_LIMIT_Q31 : -PVID_DERIVATIVE_LIMIT_Q31;
    }
    u[0] = PVID_KAPITZA_RATE_LIMIT_Q31;
    u[1] = -PVID_DERIVATIVE_LIMIT_Q31;
    u[2] = PVID_DERIVATIVE_LIMIT_Q31;
    assert_false(pvid_kapitza_strong_row_q31(&exact, phi, u, row));
}

static const pvid_estimator_config_q31 of_estimator = {
    .start = {3 << 25, 6 << 24, 5 << 24},
    .start_sd = {1 << 25, 4 << 24, 2 << 24},
    .lower = {1 << 22, 1 << 22, 1 << 22},
    .upper = {60 << 25, 100 << 24, 100 << 24},
    .p_bits = {PVID_KAPITZA_W_BITS, 24, 24},
    .row_sd = 256,
    .gain = 1 << 30,
    .correlation = 65536u,
    .row_weight = 65536u,
    .step_limit = 19661u,
    .kappa_min = 10737,
    .divider = 1,
};
static const pvid_strong_row_q31 near_two = {.phi3 = 1 << 30, .reference = RATE(2) + (RATE(1) / 8)};

/* Without a row nothing is known. Then rows that obey w = 2, d1 = 8, d2 = 4: p ends there, and its errors are small. */
static void rows_of_a_model_identify_it(void **state)
{
    (void)state;
    static pvid_kapitza_estimator_q31 self;
    pvid_estimate_q31 estimate;
    assert_int_equal(pvid_kapitza_estimator_init_q31(&self, &of_estimator, &near_two), PVID_OK);
    pvid_kapitza_estimator_assess_q31(&self, &estimate);
    for (size_t a = 0; a < 3u; a++) {
        const int32_t sd = of_estimator.start_sd[a];
        assert_in_range((uintmax_t)estimate.se[a], (uintmax_t)(sd - (sd / 100)), (uintmax_t)(sd + (sd / 100)));
    }
    uint32_t random = 1;
    for (uint32_t i = 0; i < 400u; i++) {
        int32_t drawn[3];
        for (size_t k = 0; k < 3u; k++) {
            random = (random * 1664525u) + 1013904223u;
            drawn[k] = (int32_t)(random >> 16) - 32768;
        }
        const int32_t u = drawn[2] * 256;                     /* |u| < 1/2 */
        const double g = ((double)u / (double)RATE(1)) + 2.0; /* u + w; u' = u'' = 0 */
        const double phi4 = -((8.0 * g * 8.0 * drawn[0]) + (4.0 * g * g * 8.0 * drawn[1]));
        const int32_t phi[PVID_ORDERS] = {drawn[1] * 8, 0, drawn[0] * 8, 0, (int32_t)phi4};
        const int32_t rates[PVID_Y_ORDERS_Q31] = {u, 0, 0};
        int32_t row[PVID_KAPITZA_ROW_Q31];
        int32_t gradient[PVID_KAPITZA_P];
        int32_t e;
        assert_true(pvid_kapitza_strong_row_q31(&near_two, phi, rates, row));
        assert_true(pvid_kapitza_estimator_innovate_q31(&self, row, &e, gradient));
        (void)pvid_kapitza_estimator_take_q31(&self, row, e, gradient);
    }
    pvid_kapitza_estimator_assess_q31(&self, &estimate);
    const int32_t truth[3] = {2 << 25, 8 << 24, 4 << 24};
    for (size_t a = 0; a < 3u; a++) {
        const int32_t most = truth[a] / 30000; /* mantissas of 28 bits */
        assert_in_range((uintmax_t)estimate.p[a], (uintmax_t)(truth[a] - most), (uintmax_t)(truth[a] + most));
        assert_in_range((uintmax_t)estimate.se[a], 0, (uintmax_t)most);
    }
    assert_int_equal(estimate.weight, 400);
}

/* ---- rows and innovations of any size against double ---- */

static uint32_t drawn = 1;

/* Of a random length up to `bits`, with a random sign. */
static int32_t any(uint32_t bits)
{
    drawn = (drawn * 1664525u) + 1013904223u;
    const uint32_t length = (drawn >> 8) % (bits + 1u);
    drawn = (drawn * 1664525u) + 1013904223u;
    const int32_t size = (length == 0u) ? 0 : (int32_t)((drawn >> 2) >> (30u - length));
    drawn = (drawn * 1664525u) + 1013904223u;
    return ((drawn >> 31) == 0u) ? size : -size;
}

/* Whether every number is below its limit: 1 surely, 0 surely not, -1 near a limit. */
static int fits(const double x[], const double limit[], size_t n)
{
    int all = 1;
    for (size_t i = 0; i < n; i++) {
        const double part = fabs(x[i]) / limit[i];
        if (part > 1.001) {
            return 0;
        }
        all = (part > 0.999) ? -1 : all;
    }
    return all;
}

static void a_row_of_any_size_is_the_formula_or_refused(void **state)
{
    (void)state;
    const double rate = (double)RATE(1);
    int count[2] = {0, 0};
    for (int i = 0; i < 60000; i++) {
        const int32_t phi[PVID_ORDERS] = {any(30), any(30), any(30), any(30), any(30)};
        const int32_t u[PVID_Y_ORDERS_Q31] = {any(29), any(30), any(30)};
        int32_t row[PVID_KAPITZA_ROW_Q31];
        const double g = (double)u[0] / rate;
        const double bracket =
            (((double)u[2] * (double)phi[2]) + (2.0 * (double)u[1] * (double)phi[3])) / rate - (g * (double)phi[4]);
        const double u1_phi2 = (double)phi[2] * (double)u[1] / rate;
        double entry[12] = {bracket - (g * (double)phi[4]), -(double)phi[4]};
        for (int k = 0; k < 4; k++) {
            entry[2 + k] = -(double)phi[2] * pow(g, (double)(3 - k));
        }
        for (int k = 0; k < 5; k++) {
            entry[6 + k] = -(double)phi[0] * pow(g, (double)(4 - k));
        }
        entry[11] = (2.0 * (double)u[1] * u1_phi2 / rate) - (g * bracket);
        const double limit = (double)PVID_ROW_LIMIT_Q31;
        const double of[15] = {bracket,  u1_phi2,  entry[0], entry[1], entry[2],  entry[3],  entry[4],      entry[5],
                               entry[6], entry[7], entry[8], entry[9], entry[10], entry[11], (double)phi[3]};
        const double most[15] = {4.0 * limit, 4.0 * limit, limit, limit, limit, limit, limit, limit,
                                 limit,       limit,       limit, limit, limit, limit, limit};
        const int wanted = fits(of, most, 15);
        const bool fitted = pvid_kapitza_strong_row_q31(&exact, phi, u, row);
        assert_true((wanted < 0) || (fitted == (wanted == 1)));
        count[fitted ? 1 : 0]++;
        /* each factor of a product is rounded: half a unit times |G|^k or |u'| */
        const double off = 1.0 + (fabs(g) * (1.0 + fabs(g)) * (1.0 + fabs(g))) + (2.0 * fabs((double)u[1]) / rate);
        for (int k = 0; fitted && (k < 11); k++) {
            assert_true(fabs((double)row[k] - entry[k]) <= off);
        }
        assert_true(!fitted || (fabs((double)row[PVID_KAPITZA_ROW_Y] - entry[11]) <= off));
    }
    assert_true((count[0] > 5000) && (count[1] > 5000));
}

static void an_innovation_of_any_size_is_the_formula_or_refused(void **state)
{
    (void)state;
    static pvid_kapitza_estimator_q31 self;
    const double rate = (double)RATE(1);
    int count[2] = {0, 0};
    assert_int_equal(pvid_kapitza_estimator_init_q31(&self, &of_estimator, &exact), PVID_OK);
    for (int i = 0; i < 60000; i++) {
        int32_t row[PVID_KAPITZA_ROW_Q31];
        for (int k = 0; k < PVID_KAPITZA_ROW_Q31; k++) {
            row[k] = any(28);
        }
        row[PVID_KAPITZA_ROW_G] = any(30);
        self.p[0] = (int32_t)((uint32_t)any(30) & ~1u); /* whole in the unit of a rate */
        self.p[1] = abs(any(30));
        self.p[2] = abs(any(30));
        const double d = (double)self.p[0] / (2.0 * rate);
        const double g = ((double)row[PVID_KAPITZA_ROW_G] / rate) + d;
        const double d1 = (double)self.p[1] / (double)(1 << 24);
        const double d2 = (double)self.p[2] / (double)(1 << 24);
        const double x = (double)row[5];
        const double z = (double)row[10];
        const double of_e = (double)row[1] * d;
        const double inner = (double)row[0] + of_e;
        const double of_w = inner * d;
        const double of_d1 = d1 * x * g * g * g;
        const double of_d2 = d2 * z * g * g * g * g;
        const double slopes[2] = {3.0 * d1 * x * g * g, 4.0 * d2 * z * g * g * g};
        const double rest = (double)row[PVID_KAPITZA_ROW_Y] - (of_w + of_d1 + of_d2);
        const double slope = inner + of_e + slopes[0] + slopes[1];
        const double limit = (double)PVID_ROW_LIMIT_Q31;
        const double of[16] = {
            g,    g * x, g * g * x, g * g * g * x, g * z,     g * g * z, g * g * g * z, g * g * g * g * z,
            of_e, of_w,  of_d1,     of_d2,         slopes[0], slopes[1], rest,          slope};
        const double most[16] = {64.0,        limit,       limit,       limit,       limit,       limit,
                                 limit,       limit,       2.0 * limit, 2.0 * limit, 2.0 * limit, 2.0 * limit,
                                 2.0 * limit, 2.0 * limit, limit,       4.0 * limit};
        int32_t e = 0;
        int32_t gradient[PVID_KAPITZA_P] = {0, 0, 0};
        const int wanted = fits(of, most, 16);
        const bool fitted = pvid_kapitza_estimator_innovate_q31(&self, row, &e, gradient);
        assert_true((wanted < 0) || (fitted == (wanted == 1)));
        count[fitted ? 1 : 0]++;
        const double powers = 1.0 + (fabs(g) * (1.0 + fabs(g)) * (1.0 + fabs(g)));
        const double off = 3.0 + fabs(d) + (powers * ((4.0 * d1) + (5.0 * d2)));
        if (fitted) {
            assert_true(fabs((double)e - rest) <= off);
            assert_true(fabs((double)gradient[0] - slope) <= off);
            assert_true(fabs((double)gradient[1] - (g * g * g * x)) <= powers);
            assert_true(fabs((double)gradient[2] - (g * g * g * g * z)) <= (powers * (1.0 + fabs(g))));
        }
    }
    assert_true((count[0] > 5000) && (count[1] > 5000));
}

static void wrong_formats_are_refused(void **state)
{
    (void)state;
    pvid_kapitza_estimator_q31 self;
    pvid_estimator_config_q31 config = of_estimator;
    config.p_bits[0]++;
    assert_int_equal(pvid_kapitza_estimator_init_q31(&self, &config, &near_two), PVID_BAD_FORMAT);
    config = of_estimator;
    config.p_bits[2] = 61;
    assert_int_equal(pvid_kapitza_estimator_init_q31(&self, &config, &near_two), PVID_BAD_FORMAT);
    assert_int_equal(pvid_kapitza_estimator_init_q31(&self, &of_estimator, NULL), PVID_BAD_POINTER);
    pvid_strong_row_q31 rows = near_two;
    rows.phi3 = 0;
    assert_int_equal(pvid_kapitza_estimator_init_q31(&self, &of_estimator, &rows), PVID_BAD_SHIFT);
    rows = near_two;
    rows.phi_shift[4] = 32;
    assert_int_equal(pvid_kapitza_estimator_init_q31(&self, &of_estimator, &rows), PVID_BAD_SHIFT);
    rows = near_two;
    rows.reference = PVID_KAPITZA_RATE_LIMIT_Q31 + 1;
    assert_int_equal(pvid_kapitza_estimator_init_q31(&self, &of_estimator, &rows), PVID_BAD_SHIFT);
}

static pvid_strong_config_q31 settings(void)
{
    const pvid_strong_config_q31 config = {
        .bank =
            {.half = 2, .stride = 1, .phi_max = 80000, .y_max = 6000, .centre = 12, .weights = pvid_five_points_q31},
        .row = {.phi_shift = {4, 0, 3, 6, 9}, .finer = {4, 7}, .phi3 = 1 << 30, .reference = 14030227},
        .u_multiplier = {1563749871, 1563749871, 1563749871},
        .u_shift = {20, 17, 14},
        .drive_ticks = 50,
        .estimator =
            {
                .start = {28060454, 83886080, 100663296},
                .start_sd = {14030227, 41943040, 50331648},
                .lower = {1403023, 4194304, 5033165},
                .upper = {561209043, 1677721600, 2013265920},
                .p_bits = {25, 24, 25},
                .row_sd = 3134227,
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
    const pvid_kapitza_estimator_q31 before = self.estimator;
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
    config.row.finer[0]++;
    assert_int_equal(pvid_snapshot_restore_strong_q31(&restored, &config, image, sizeof image),
                     PVID_SNAPSHOT_OTHER_CONFIG);
    config.row.finer[0]--;
    image[100] ^= 4u;
    assert_int_equal(pvid_snapshot_restore_strong_q31(&restored, &config, image, sizeof image), PVID_SNAPSHOT_DAMAGED);
    assert_memory_equal(&restored, &self, sizeof self);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_row_of_any_size_is_the_formula_or_refused),
        cmocka_unit_test(an_innovation_of_any_size_is_the_formula_or_refused),
        cmocka_unit_test(a_row_is_the_formula),
        cmocka_unit_test(a_row_has_its_formats),
        cmocka_unit_test(a_row_that_does_not_fit_is_refused),
        cmocka_unit_test(rows_of_a_model_identify_it),
        cmocka_unit_test(wrong_formats_are_refused),
        cmocka_unit_test(limits_of_a_run_are_reported),
        cmocka_unit_test(a_still_pivot_is_no_drive),
        cmocka_unit_test(frozen_form_accepts_no_row),
        cmocka_unit_test(a_restored_run_continues_bit_for_bit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
