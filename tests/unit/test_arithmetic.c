/* pvid/arithmetic.h: this build computes float32 as the twin does. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "pvid/arithmetic.h"

static void test_this_build_has_no_fault(void **state)
{
    (void)state;
    assert_int_equal(pvid_arithmetic_faults_f32(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_this_build_has_no_fault),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
