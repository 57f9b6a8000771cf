/* When the strong form says that its estimate is not to be believed. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "misfit_f32.h"

static pvid_misfit_f32 misfit;

/* A block of rows with residuals e, which say `told` of p[0]. */
static bool block(float e, float told)
{
    for (unsigned rows = misfit.block; rows > 1u; rows--) {
        assert_false(pvid_misfit_take_f32(&misfit, e, told));
    }
    assert_true(pvid_misfit_take_f32(&misfit, e, told));
    return pvid_misfit_judge_f32(&misfit);
}

static int start_again(void **state)
{
    (void)state;
    pvid_misfit_init_f32(&misfit, 10.0f, 0.0f);
    return 0;
}

static void a_block_is_four_seconds_of_rows(void **state)
{
    (void)state;
    assert_int_equal(misfit.block, 40);
    pvid_misfit_init_f32(&misfit, 1.0e6f, 0.0f);
    assert_int_equal(misfit.block, 65535);
    pvid_misfit_init_f32(&misfit, 1.0e-3f, 0.0f);
    assert_int_equal(misfit.block, 1);
}

static void the_first_block_only_teaches(void **state)
{
    (void)state;
    assert_false(block(1.0f, 1.0f)); /* q = 1 */
    assert_true(block(1.0f, 1.0f));
}

static void beyond_the_most_is_a_misfit_however_it_was_before(void **state)
{
    (void)state;
    (void)block(0.062f, 1.0f); /* q = 0.0038 */
    assert_false(block(0.062f, 1.0f));
    assert_true(block(0.065f, 1.0f)); /* 0.0042 */
    assert_false(block(0.062f, 1.0f)); /* over with the block */
}

static void three_times_the_quietest_in_both_is_a_misfit(void **state)
{
    (void)state;
    (void)block(0.01f, 1.0f);
    assert_false(block(0.0170f, 1.0f)); /* 2.9 times */
    assert_true(block(0.0176f, 1.0f));  /* 3.1 times */
    assert_true(block(0.0176f, 1.0f));  /* the quietest stays the quietest */
    assert_false(block(0.0176f, 1.1f)); /* 3.1 times the energy, 2.6 times the part */
    assert_false(block(0.0170f, 0.5f)); /* 2.9 times the energy, 11.6 times the part */
    assert_false(block(0.1f, 10.0f));   /* a larger drive: the part is the same */
}

static void a_quieter_block_becomes_the_measure(void **state)
{
    (void)state;
    (void)block(0.05f, 1.0f);
    assert_false(block(0.02f, 1.0f));
    assert_true(block(0.05f, 1.0f));
}

static void below_the_least_nothing_is_a_misfit(void **state)
{
    (void)state;
    (void)block(1.0e-6f, 1.0f);
    assert_false(block(4.4e-3f, 1.0f)); /* q = 1.9e-5 */
    assert_true(block(4.6e-3f, 1.0f));  /* 2.1e-5 */
}

static void a_measure_is_forgotten_with_the_sums(void **state)
{
    (void)state;
    pvid_misfit_init_f32(&misfit, 10.0f, 10.0f); /* 1.1 a block */
    (void)block(0.01f, 1.0f);
    unsigned blocks = 0;
    while (block(0.02f, 1.0f)) { /* 4 times */
        blocks++;
        assert_true(blocks < 10u);
    }
    assert_int_equal(blocks, 4); /* before the fifth it is 1.1^4 = 1.46 times as large: 4 < 3 * 1.46 */
    pvid_misfit_init_f32(&misfit, 10.0f, 1.0e-3f);
    assert_true(misfit.growth == 2.0f);
}

static void rows_that_are_no_numbers_are_a_misfit_and_teach_nothing_wrong(void **state)
{
    (void)state;
    (void)block(0.01f, 1.0f);
    assert_true(block(NAN, 1.0f));
    assert_true(block(INFINITY, 1.0f));
    assert_true(block(1.0f, NAN));
    assert_true(block(1.0e30f, 1.0f));
    assert_true(misfit.least_part < 1.1e-4f);
    assert_false(block(0.01f, 1.0f));
    assert_true(block(0.02f, 1.0f));
}

static void where_nothing_moves_nothing_is_said(void **state)
{
    (void)state;
    assert_false(block(0.0f, 0.0f));
    assert_false(block(1.0f, 0.0f));
    assert_false(block(0.01f, 1.0f)); /* still the first that teaches */
    assert_false(block(0.0f, 0.0f));
    assert_false(block(0.01f, 0.4f)); /* the quietest is not silence: 1 times the energy */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_block_is_four_seconds_of_rows, start_again),
        cmocka_unit_test_setup(the_first_block_only_teaches, start_again),
        cmocka_unit_test_setup(beyond_the_most_is_a_misfit_however_it_was_before, start_again),
        cmocka_unit_test_setup(three_times_the_quietest_in_both_is_a_misfit, start_again),
        cmocka_unit_test_setup(a_quieter_block_becomes_the_measure, start_again),
        cmocka_unit_test_setup(below_the_least_nothing_is_a_misfit, start_again),
        cmocka_unit_test_setup(a_measure_is_forgotten_with_the_sums, start_again),
        cmocka_unit_test_setup(rows_that_are_no_numbers_are_a_misfit_and_teach_nothing_wrong, start_again),
        cmocka_unit_test_setup(where_nothing_moves_nothing_is_said, start_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
