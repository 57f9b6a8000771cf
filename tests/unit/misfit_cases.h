/* What both verdicts of the strong form must say, of blocks of rows that are all alike: included by the tests of each,
 * which say what a block is. */
#include "test.h"

#ifndef MISFIT_CASES_H
#define MISFIT_CASES_H

/* A block of rows with residuals e, which say `told` of p[0]: whether it is a misfit. */
static bool block(double e, double sensitivity);

/* Prepares the verdict to forget nothing. */
static int start_again(void **state);

static void first_block_sets_the_reference(void **state)
{
    assert_false(block(1.0, 1.0)); /* q = 1 */
    assert_true(block(1.0, 1.0));
}

static void misfit_beyond_the_upper_limit(void **state)
{
    (void)block(0.0632, 1.0); /* q = 0.003994 */
    assert_false(block(0.0632, 1.0));
    assert_false(block(0.062, 1.0));
    assert_true(block(0.065, 1.0));
    assert_true(block(0.0633, 1.0));  /* 0.004007 */
    assert_false(block(0.0632, 1.0)); /* over with the block */
}

static void three_times_the_quietest_in_both_is_a_misfit(void **state)
{
    (void)block(0.01, 1.0);
    assert_false(block(0.0170, 1.0));
    assert_false(block(0.01732, 1.0)); /* 2.9998 times */
    assert_true(block(0.01733, 1.0));  /* 3.003 times */
    assert_true(block(0.0176, 1.0));
    assert_true(block(0.0176, 1.0));  /* the quietest stays the quietest */
    assert_false(block(0.0176, 1.1)); /* 3.1 times the residual, 2.6 times the part */
    assert_false(block(0.0170, 0.5)); /* 2.9 times the residual, 11.6 times the part */
    assert_false(block(0.1, 10.0));   /* a larger drive: the part is the same */
}

static void a_quieter_block_becomes_the_reference(void **state)
{
    (void)block(0.05, 1.0);
    assert_false(block(0.02, 1.0));
    assert_true(block(0.05, 1.0));
}

static void no_misfit_below_the_lower_limit(void **state)
{
    (void)block(1.0e-6, 1.0);
    assert_false(block(4.4e-3, 1.0));
    assert_false(block(4.472e-3, 1.0)); /* q = 1.99988e-5 */
    assert_true(block(4.473e-3, 1.0));  /* 2.0008e-5 */
    assert_true(block(4.6e-3, 1.0));
}

static void no_signal_gives_no_verdict(void **state)
{
    assert_false(block(0.0, 0.0));
    assert_false(block(1.0, 0.0));
    assert_false(block(0.01, 1.0)); /* still the first that teaches */
    assert_false(block(0.0, 0.0));
    assert_false(block(0.01, 0.4)); /* the quietest is not silence: 1 times the residual */
}

/* Of a verdict whose measure grows by 1.1 a block. */
static void grows_by_a_tenth_a_block(void)
{
    (void)block(0.01, 1.0);
    unsigned blocks = 0;
    while (block(0.02, 1.0)) { /* 4 times */
        blocks++;
        assert_true(blocks < 10u);
    }
    assert_int_equal(blocks, 4); /* before the fifth it is 1.1^4 = 1.46 times as large: 4 < 3 * 1.46 */
}

#define MISFIT_CASES                                                                                                   \
    cmocka_unit_test_setup(first_block_sets_the_reference, start_again),                                               \
        cmocka_unit_test_setup(misfit_beyond_the_upper_limit, start_again),                                            \
        cmocka_unit_test_setup(three_times_the_quietest_in_both_is_a_misfit, start_again),                             \
        cmocka_unit_test_setup(a_quieter_block_becomes_the_reference, start_again),                                    \
        cmocka_unit_test_setup(no_misfit_below_the_lower_limit, start_again),                                          \
        cmocka_unit_test_setup(no_signal_gives_no_verdict, start_again)

#endif
