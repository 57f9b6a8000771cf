/* Derivatives of polynomials are exact, at the window's centre, whatever the stride. */
#include "test.h"

#include "pvid/pvid.h"

static const double coefficients[5] = {0.7, -1.3, 2.1, 0.9, -0.4}; /* of t^k / k! */

static double polynomial(int order, double t)
{
    double sum = 0.0;
    double term = 1.0;
    for (int k = order; k < 5; k++) {
        sum += coefficients[k] * term;
        term *= t / (double)(k - order + 1);
    }
    return sum;
}

static void quartic_is_differentiated_exactly_at_the_centre(void **state)
{
    for (uint16_t stride = 1; stride <= 8; stride++) {
        const float rate = 64.0f; /* a power of two: sample times are exact */
        const pvid_fir_bank_f32 bank = {.half = 2, .stride = stride, .weights = pvid_five_points_f32};
        pvid_differentiator_f32 self;
        assert_int_equal(pvid_differentiator_init_f32(&self, &bank, rate), PVID_OK);
        const int delay = 2 * stride;
        for (int tick = 0; tick < 100; tick++) {
            const double t = (tick - 50) / 64.0;
            float out[PVID_ORDERS];
            const bool ready = pvid_differentiator_step_f32(&self, (float)polynomial(0, t), out);
            assert_int_equal(ready, tick >= 2 * delay);
            for (int order = 0; ready && (order < PVID_ORDERS); order++) {
                const double h = stride / 64.0;
                double expected = polynomial(order, t - (delay / 64.0));
                double scale = 1.0;
                for (int k = 0; k < order; k++) {
                    scale /= h;
                }
                /* samples of size 2 are rounded to 2^-24 of it; the bank's gain is at most 16 / h^order */
                const double error = (double)out[order] - expected;
                assert_true((error < 4.0e-6 * scale) && (error > -4.0e-6 * scale));
            }
        }
    }
}

static void constant_has_no_derivative_not_even_by_rounding(void **state)
{
    const pvid_fir_bank_f32 bank = {.half = 2, .stride = 3, .weights = pvid_five_points_f32};
    pvid_differentiator_f32 self;
    assert_int_equal(pvid_differentiator_init_f32(&self, &bank, 1000.0f), PVID_OK);
    float out[PVID_ORDERS] = {0.0f};
    for (int tick = 0; tick < 40; tick++) {
        (void)pvid_differentiator_step_f32(&self, 0.1f, out);
    }
    assert_true(out[0] >= 0.1f && out[0] <= 0.1f);
    for (int order = 1; order < PVID_ORDERS; order++) {
        assert_true(out[order] >= 0.0f && out[order] <= 0.0f);
    }
}

static void reset_equals_a_fresh_start(void **state)
{
    const pvid_fir_bank_f32 bank = {.half = 2, .stride = 2, .weights = pvid_five_points_f32};
    pvid_differentiator_f32 used;
    pvid_differentiator_f32 fresh;
    assert_int_equal(pvid_differentiator_init_f32(&used, &bank, 100.0f), PVID_OK);
    assert_int_equal(pvid_differentiator_init_f32(&fresh, &bank, 100.0f), PVID_OK);
    float a[PVID_ORDERS];
    float b[PVID_ORDERS];
    for (int tick = 0; tick < 13; tick++) {
        (void)pvid_differentiator_step_f32(&used, (float)(tick * tick), a);
    }
    pvid_differentiator_reset_f32(&used);
    for (int tick = 0; tick < 30; tick++) {
        const float x = (float)((tick * 7) % 11);
        const bool ready = pvid_differentiator_step_f32(&used, x, a);
        assert_int_equal(ready, pvid_differentiator_step_f32(&fresh, x, b));
        if (ready) {
            assert_memory_equal(a, b, sizeof a);
        }
    }
}

/* A point of a block is its sum in order, whatever came before; there is a result for each block. */
static void blocks_are_the_points_of_a_slower_window(void **state)
{
    enum { HALF = 4, BLOCK = 9, STRIDE = 2, WINDOW = (2 * HALF * STRIDE) + 1, POINTS = 100000 };
    float weights[PVID_ORDERS * HALF];
    for (int i = 0; i < PVID_ORDERS * HALF; i++) {
        weights[i] = (float)((i % 7) - 3);
    }
    pvid_fir_bank_f32 bank = {.half = HALF, .stride = STRIDE, .block = BLOCK, .weights = weights};
    static pvid_differentiator_f32 of_samples;
    static pvid_differentiator_f32 of_sums;
    assert_int_equal(pvid_differentiator_init_f32(&of_samples, &bank, 1000.0f), PVID_OK);
    bank.block = 1;
    assert_int_equal(pvid_differentiator_init_f32(&of_sums, &bank, 1000.0f / (float)BLOCK), PVID_OK);
    uint32_t generator = 1u;
    for (int point = 0; point < POINTS; point++) {
        float a[PVID_ORDERS];
        float b[PVID_ORDERS];
        float sum = 0.0f;
        for (int i = 0; i < BLOCK; i++) {
            generator = (generator * 1664525u) + 1013904223u;
            const float sample = 1000.0f + (((float)(generator >> 8) / 8388608.0f) - 1.0f);
            sum = (i == 0) ? sample : (sum + sample);
            const bool ready = pvid_differentiator_step_f32(&of_samples, sample, a);
            assert_int_equal(ready, (i == (BLOCK - 1)) && (point >= (WINDOW - 1)));
        }
        if (pvid_differentiator_step_f32(&of_sums, sum, b)) {
            for (int k = 0; k < PVID_ORDERS; k++) { /* the factors alone differ, by their rounding */
                assert_true(fabsf(a[k] - (b[k] / (float)BLOCK)) <= (1.0e-6f * fabsf(a[k])));
            }
        }
    }
}

static void the_longest_window_is_taken_and_no_longer_one(void **state)
{
    static float weights[PVID_ORDERS * PVID_MAX_WINDOW];
    pvid_differentiator_f32 self;
    const uint16_t most = (PVID_MAX_WINDOW - 1) / 2;
    const pvid_fir_bank_f32 whole = {.half = most, .stride = 1, .weights = weights};
    const pvid_fir_bank_f32 wide = {.half = 2, .stride = most / 2u, .weights = weights};
    const pvid_fir_bank_f32 wider = {.half = 2, .stride = (most / 2u) + 1u, .weights = weights};
    const pvid_fir_bank_f32 longer = {.half = most + 1u, .stride = 1, .weights = weights};
    assert_int_equal(pvid_differentiator_init_f32(&self, &whole, 100.0f), PVID_OK);
    assert_int_equal(pvid_differentiator_init_f32(&self, &wide, 100.0f), PVID_OK);
    assert_int_equal(pvid_differentiator_init_f32(&self, &wider, 100.0f), PVID_BAD_STRIDE);
    assert_int_equal(pvid_differentiator_init_f32(&self, &longer, 100.0f), PVID_BAD_HALF);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(quartic_is_differentiated_exactly_at_the_centre),
    cmocka_unit_test(constant_has_no_derivative_not_even_by_rounding),
    cmocka_unit_test(reset_equals_a_fresh_start),
    cmocka_unit_test(blocks_are_the_points_of_a_slower_window),
    cmocka_unit_test(the_longest_window_is_taken_and_no_longer_one),
};
RUN(tests)
