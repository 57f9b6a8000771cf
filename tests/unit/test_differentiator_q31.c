/* Integer derivatives: exact on counts, at the window's centre, and a bank that could overflow is refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "pvid/pvid_q31.h"

static pvid_fir_bank_q31 five_points(uint16_t stride)
{
    const pvid_fir_bank_q31 bank = {
        .half = 2,
        .stride = stride,
        .phi_max = 1 << 16,
        .y_max = 1 << 16,
        .centre = PVID_FIVE_POINTS_CENTRE_Q31,
        .weights = pvid_five_points_q31,
    };
    return bank;
}

/* A quartic in the number of a point: five points are exact on it. */
static int64_t quartic(int32_t i)
{
    const int64_t x = i;
    return 5 - (3 * x) + (7 * x * x) - (2 * x * x * x) + (x * x * x * x);
}

static void a_quartic_in_counts_is_differentiated_without_an_error(void **state)
{
    (void)state;
    const pvid_fir_bank_q31 bank = five_points(3);
    pvid_differentiator_q31 self;
    assert_int_equal(pvid_differentiator_init_q31(&self, &bank), PVID_OK);
    for (int32_t tick = 0; tick < 36; tick++) {
        const int32_t x = (tick / 3) - 6; /* three interleaved quartics, one a phase */
        const int32_t own = 1 + (tick % 3);
        int32_t d_phi[PVID_ORDERS];
        int32_t d_y[PVID_Y_ORDERS_Q31];
        const bool ready =
            pvid_differentiator_step_q31(&self, own * (int32_t)quartic(x), -(int32_t)quartic(x), d_phi, d_y);
        assert_int_equal(ready, tick >= 12);
        if (ready) {
            const int32_t c = x - 2;
            const int32_t second = 14 - (12 * c) + (12 * c * c);
            const int32_t third = -12 + (24 * c);
            assert_int_equal(d_phi[0], 12 * own * quartic(c));
            assert_int_equal(d_phi[1], 12 * own * (-3 + (14 * c) - (6 * c * c) + (4 * c * c * c)));
            assert_int_equal(d_phi[2], 12 * own * second);
            assert_int_equal(d_phi[3], 12 * own * third);
            assert_int_equal(d_phi[4], 12 * own * 24);
            assert_int_equal(d_y[0], -12 * second);
            assert_int_equal(d_y[1], -12 * third);
            assert_int_equal(d_y[2], -12 * 24);
        }
    }
}

static void full_scale_in_the_worst_order_stays_within_the_limit(void **state)
{
    (void)state;
    pvid_fir_bank_q31 bank = five_points(1);
    bank.phi_max = 5592405; /* 192 of these are 2^30 - 64 */
    bank.y_max = 5592405;
    pvid_differentiator_q31 self;
    assert_int_equal(pvid_differentiator_init_q31(&self, &bank), PVID_OK);
    int32_t d_phi[PVID_ORDERS];
    int32_t d_y[PVID_Y_ORDERS_Q31];
    bool ready = false;
    for (int32_t tick = 0; tick < 5; tick++) {
        const int32_t counts = ((tick % 2) == 0) ? bank.phi_max : -bank.phi_max;
        ready = pvid_differentiator_step_q31(&self, counts, -counts, d_phi, d_y);
    }
    assert_true(ready);
    assert_int_equal(d_phi[4], 192 * bank.phi_max);
    assert_int_equal(d_y[2], -192 * bank.phi_max);
    assert_true(d_phi[4] <= PVID_DERIVATIVE_LIMIT_Q31);
    bank.phi_max = 5592406; /* beyond 2^30 */
    assert_int_equal(pvid_differentiator_init_q31(&self, &bank), PVID_BAD_SHIFT);
    bank.phi_shift[4] = 1;
    assert_int_equal(pvid_differentiator_init_q31(&self, &bank), PVID_OK);
    bank.y_max = 5592406;
    assert_int_equal(pvid_differentiator_init_q31(&self, &bank), PVID_BAD_SHIFT);
}

static void a_shift_rounds_half_up(void **state)
{
    (void)state;
    pvid_fir_bank_q31 bank = five_points(1);
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        bank.phi_shift[k] = 3;
    }
    pvid_differentiator_q31 self;
    assert_int_equal(pvid_differentiator_init_q31(&self, &bank), PVID_OK);
    const int32_t counts[5] = {0, 1, 3, 2, -4};
    int32_t d_phi[PVID_ORDERS];
    int32_t d_y[PVID_Y_ORDERS_Q31];
    for (size_t i = 0; i < 5u; i++) {
        (void)pvid_differentiator_step_q31(&self, counts[i], 0, d_phi, d_y);
    }
    assert_int_equal(d_phi[0], 5);  /* 36/8 = 4.5 */
    assert_int_equal(d_phi[1], 2);  /* (8 1 + 4) = 12, 1.5 */
    assert_int_equal(d_phi[2], -5); /* 16 (-3) + 10 = -38, -4.75 */
    assert_int_equal(d_phi[3], -4); /* -12 1 + 6 (-4) = -36, -4.5 */
    assert_int_equal(d_phi[4], 3);  /* -48 (-3) + 12 (-10) = 24 */
}

/* The same samples through blocks of three and, as their sums, without. */
static void points_are_sums_of_a_block(void **state)
{
    (void)state;
    pvid_fir_bank_q31 bank = five_points(2);
    pvid_differentiator_q31 single;
    assert_int_equal(pvid_differentiator_init_q31(&single, &bank), PVID_OK);
    bank.block = 3;
    pvid_differentiator_q31 blocks;
    assert_int_equal(pvid_differentiator_init_q31(&blocks, &bank), PVID_OK);
    for (int32_t turn = 0; turn < 2; turn++) {
        int32_t sum = 0;
        for (int32_t tick = 0; tick < 80; tick++) {
            const int32_t phi = (tick * tick * 37) % 1009;
            int32_t d[2][PVID_ORDERS];
            int32_t d_y[2][PVID_Y_ORDERS_Q31];
            const bool complete = (tick % 3) == 2;
            sum = ((tick % 3) == 0) ? phi : (sum + phi);
            const bool ready = pvid_differentiator_step_q31(&blocks, phi, -phi, d[0], d_y[0]);
            assert_int_equal(ready, complete && (tick >= 26));
            if (complete) {
                assert_int_equal(pvid_differentiator_step_q31(&single, sum, -sum, d[1], d_y[1]), ready);
            }
            if (ready) {
                assert_memory_equal(d[0], d[1], sizeof d[0]);
                assert_memory_equal(d_y[0], d_y[1], sizeof d_y[0]);
            }
        }
        pvid_differentiator_reset_q31(&blocks); /* within a block */
        pvid_differentiator_reset_q31(&single);
    }
    bank.phi_max = (PVID_COUNTS_LIMIT_Q31 / 3) + 1; /* times three it is beyond */
    assert_int_equal(pvid_differentiator_init_q31(&blocks, &bank), PVID_BAD_FULL_SCALE);
}

/* With other shifts the general code computes the same. */
static void five_points_written_out_equal_the_loop(void **state)
{
    (void)state;
    pvid_fir_bank_q31 bank = five_points(2);
    pvid_differentiator_q31 written;
    assert_int_equal(pvid_differentiator_init_q31(&written, &bank), PVID_OK);
    bank.phi_shift[1] = 1;
    pvid_differentiator_q31 loop;
    assert_int_equal(pvid_differentiator_init_q31(&loop, &bank), PVID_OK);
    assert_true(written.five_points);
    assert_false(loop.five_points);
    for (int32_t tick = 0; tick < 50; tick++) {
        const int32_t phi = ((tick * 7919) % 4001) - 2000;
        const int32_t y = ((tick * 104729) % 6007) - 3000;
        int32_t d[2][PVID_ORDERS] = {{0}};
        int32_t d_y[2][PVID_Y_ORDERS_Q31] = {{0}};
        (void)pvid_differentiator_step_q31(&written, phi, y, d[0], d_y[0]);
        (void)pvid_differentiator_step_q31(&loop, phi, y, d[1], d_y[1]);
        assert_true((d[0][1] == (2 * d[1][1])) || (d[0][1] == ((2 * d[1][1]) - 1)));
        d[1][1] = d[0][1];
        assert_memory_equal(d[0], d[1], sizeof d[0]);
        assert_memory_equal(d_y[0], d_y[1], sizeof d_y[0]);
    }
}

static void a_reset_forgets_the_window(void **state)
{
    (void)state;
    const pvid_fir_bank_q31 bank = five_points(2);
    pvid_differentiator_q31 used;
    pvid_differentiator_q31 fresh;
    assert_int_equal(pvid_differentiator_init_q31(&used, &bank), PVID_OK);
    assert_int_equal(pvid_differentiator_init_q31(&fresh, &bank), PVID_OK);
    int32_t d[2][PVID_ORDERS];
    int32_t d_y[2][PVID_Y_ORDERS_Q31];
    for (int32_t tick = 0; tick < 23; tick++) {
        (void)pvid_differentiator_step_q31(&used, 1000 - tick, tick, d[0], d_y[0]);
    }
    pvid_differentiator_reset_q31(&used);
    for (int32_t tick = 0; tick < 23; tick++) {
        const bool again = pvid_differentiator_step_q31(&used, tick * tick, -tick, d[0], d_y[0]);
        assert_int_equal(again, pvid_differentiator_step_q31(&fresh, tick * tick, -tick, d[1], d_y[1]));
        if (again) {
            assert_memory_equal(d[0], d[1], sizeof d[0]);
            assert_memory_equal(d_y[0], d_y[1], sizeof d_y[0]);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_quartic_in_counts_is_differentiated_without_an_error),
        cmocka_unit_test(full_scale_in_the_worst_order_stays_within_the_limit),
        cmocka_unit_test(a_shift_rounds_half_up),
        cmocka_unit_test(points_are_sums_of_a_block),
        cmocka_unit_test(five_points_written_out_equal_the_loop),
        cmocka_unit_test(a_reset_forgets_the_window),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
