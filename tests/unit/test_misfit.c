/* When the strong form says that its estimate is not to be believed. */
#include <math.h>
#include <stdint.h>

#include "misfit_cases.h"
#include "judge/misfit_f32.h"

static pvid_misfit_f32 misfit;

static bool block(double e, double sensitivity)
{
    const float square = (float)e * (float)e;
    const float signal = (float)sensitivity * (float)sensitivity;
    for (unsigned rows = misfit.block; rows > 0u; rows--) {
        assert_int_equal(pvid_misfit_add_f32(&misfit, square, signal), rows - 1u);
    }
    return pvid_misfit_judge_f32(&misfit);
}

static int start_again(void **state)
{
    pvid_misfit_init_f32(&misfit, 10.0f, 0.0f);
    return 0;
}

static void a_block_is_four_seconds_of_rows(void **state)
{
    assert_int_equal(misfit.block, 40);
    pvid_misfit_init_f32(&misfit, 1.0e6f, 0.0f);
    assert_int_equal(misfit.block, 65535);
    pvid_misfit_init_f32(&misfit, 1.0e-3f, 0.0f);
    assert_int_equal(misfit.block, 1);
}

static void reference_fades_with_the_sums(void **state)
{
    pvid_misfit_init_f32(&misfit, 10.0f, 10.0f); /* 1.1 a block */
    grows_by_a_tenth_a_block();
    pvid_misfit_init_f32(&misfit, 10.0f, 1.0e-3f);
    assert_true(misfit.growth == 2.0f);
}

static void nan_rows_are_a_misfit_and_keep_the_reference(void **state)
{
    (void)block(0.01, 1.0);
    assert_true(block((double)NAN, 1.0));
    assert_true(block((double)INFINITY, 1.0));
    assert_true(block(1.0, (double)NAN));
    assert_true(block(1.0e30, 1.0));
    assert_true(misfit.least_part < 1.1e-4f);
    assert_false(block(0.01, 1.0));
    assert_true(block(0.02, 1.0));
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test_setup(a_block_is_four_seconds_of_rows, start_again),
    cmocka_unit_test_setup(reference_fades_with_the_sums, start_again),
    cmocka_unit_test_setup(nan_rows_are_a_misfit_and_keep_the_reference, start_again),
    MISFIT_CASES,
};
RUN(tests)
