/* The fixed-point strong form's verdict on itself: blocks, what they are held against, what nothing is said of, ends of
 * the range. */
#include <math.h>
#include <stdint.h>

#include "misfit_cases.h"
#include "judge/misfit_q31.h"
#include "pvid/pvid_q31.h"
#include "number/scaled_q31.h"

#define UNIT 1000000 /* of e and of what is told */

static pvid_misfit_q31 misfit;

/* e and told [UNIT] */
static bool block(double e, double sensitivity)
{
    const int64_t innovation = (int64_t)(e * UNIT);
    for (unsigned rows = misfit.block; rows > 1u; rows--) {
        assert_false(pvid_misfit_add_q31(&misfit, innovation * innovation,
                                         pvid_misfit_signal_q31((int64_t)(sensitivity * UNIT))));
    }
    assert_true(
        pvid_misfit_add_q31(&misfit, innovation * innovation, pvid_misfit_signal_q31(-(int64_t)(sensitivity * UNIT))));
    return pvid_misfit_judge_q31(&misfit);
}

static int start_again(void **state)
{
    pvid_misfit_init_q31(&misfit, 50, 0); /* 200 rows: eight, and three times 64 */
    return 0;
}

static void a_block_is_four_seconds_of_rows(void **state)
{
    assert_int_equal(misfit.block, 200);
    pvid_misfit_init_q31(&misfit, 16383, 0);
    assert_int_equal(misfit.block, 65532);
    pvid_misfit_init_q31(&misfit, 16384, 0);
    assert_int_equal(misfit.block, 65535);
    pvid_misfit_init_q31(&misfit, (uint32_t)1 << 30, 0);
    assert_int_equal(misfit.block, 65535);
    pvid_misfit_init_q31(&misfit, 1, 0);
    assert_int_equal(misfit.block, 4);
}

static void the_squares_of_a_block_add_up(void **state)
{
    for (int i = 1; i < 200; i++) {
        assert_false(pvid_misfit_add_q31(&misfit, 9, pvid_misfit_signal_q31(80)));
    }
    assert_int_equal(pvid_scaled_fixed_q31(misfit.rss, 0), 9 * 136); /* the first eight, and 64 twice */
    assert_int_equal(misfit.few_rss, 9 * 63);
    assert_true(pvid_misfit_add_q31(&misfit, 9, pvid_misfit_signal_q31(-80)));
    assert_int_equal(pvid_scaled_fixed_q31(misfit.rss, 0), 9 * 200);
    assert_int_equal(pvid_scaled_fixed_q31(misfit.signal, 0), 6400 * 200);
    (void)pvid_misfit_judge_q31(&misfit);
    assert_int_equal(misfit.left, 200);
    assert_int_equal(pvid_scaled_fixed_q31(misfit.least_rss, 0), 9 * 200);
    assert_int_equal(misfit.rss.m, 0);
    assert_int_equal(misfit.few_rss, 0);
    assert_int_equal(misfit.few_signal, 0);
}

static void reference_fades_with_the_sums(void **state)
{
    pvid_misfit_init_q31(&misfit, 50, 500); /* 1.1 a block */
    grows_by_a_tenth_a_block();
    pvid_misfit_init_q31(&misfit, 50, 4);
    assert_int_equal(pvid_scaled_fixed_q31(misfit.growth, 20), 2 << 20);
    pvid_misfit_init_q31(&misfit, 50, 0);
    assert_int_equal(pvid_scaled_fixed_q31(misfit.growth, 20), 1 << 20);
}

static void growing_scale_stays_in_range(void **state)
{
    pvid_misfit_init_q31(&misfit, 1, 4);
    misfit.growth = pvid_scaled_of_q31(2, 0);
    (void)block(200.0, 0.01);
    for (int i = 0; i < 400; i++) {
        (void)block(200.0, 0.01);
    }
    assert_false(pvid_scaled_exceeds_q31(misfit.least_rss, pvid_scaled_of_q31(1, 120)));
    misfit.least_rss = pvid_scaled_of_q31(1, 120);
    misfit.least_part = misfit.least_rss;
    assert_false(block(200.0, 0.01)); /* there is no measure yet */
    assert_true(block(200.0, 0.01));
}

/* The largest rows there are, and what is told of them beyond what is held. */
static void the_largest_rows_do_not_overflow(void **state)
{
    pvid_misfit_init_q31(&misfit, (uint32_t)1 << 30, 0);
    const int64_t row_max = PVID_ROW_LIMIT_Q31;
    for (int rows = 1; rows < 65535; rows++) {
        const int64_t signal = pvid_misfit_signal_q31(((rows % 2) == 0) ? INT64_MAX / 2 : -(INT64_MAX / 2));
        assert_false(pvid_misfit_add_q31(&misfit, 8 * (row_max * row_max), 8 * signal)); /* of eight kinds: clamped */
    }
    assert_true(pvid_misfit_add_q31(&misfit, row_max * row_max, pvid_misfit_signal_q31((int64_t)1 << 31)));
    const pvid_scaled_q31 rss = pvid_scaled_of_q31(65535, 56);
    assert_int_equal(misfit.rss.e, rss.e);
    assert_in_range(misfit.rss.m, rss.m - 1200, rss.m); /* 1024 sums, each rounded */
    assert_int_equal(misfit.signal.e, rss.e + 6);       /* 8^2 of it: held at 2^31 */
    assert_false(pvid_misfit_judge_q31(&misfit));
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test_setup(a_block_is_four_seconds_of_rows, start_again),
    cmocka_unit_test_setup(the_squares_of_a_block_add_up, start_again),
    cmocka_unit_test_setup(reference_fades_with_the_sums, start_again),
    cmocka_unit_test_setup(growing_scale_stays_in_range, start_again),
    cmocka_unit_test_setup(the_largest_rows_do_not_overflow, start_again),
    MISFIT_CASES,
};
RUN(tests)
