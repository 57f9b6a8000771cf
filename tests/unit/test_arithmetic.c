/* pvid/arithmetic.h: this build computes float32 as the twin does. */
#include "test.h"

#include <fenv.h>

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

#include "pvid/arithmetic.h"

static void test_this_build_has_no_fault(void **state)
{
    assert_int_equal(pvid_arithmetic_faults_f32(), 0);
}

static uint32_t faults_with(int rounding)
{
    const int before = fegetround();
    assert_int_equal(fesetround(rounding), 0);
    const uint32_t faults = pvid_arithmetic_faults_f32();
    assert_int_equal(fesetround(before), 0);
    return faults;
}

/* Sums that round elsewhere than to the nearest; the product that then ends above its rounded value, as a fused one
 * would; the root of 2, whose nearest float lies below, and a third, whose nearest lies above. */
static void test_another_rounding_is_found(void **state)
{
    assert_int_equal(faults_with(FE_UPWARD), 1 | 4 | 8);
    assert_int_equal(faults_with(FE_DOWNWARD), 4 | 16);
    assert_int_equal(faults_with(FE_TOWARDZERO), 4 | 16);
    assert_int_equal(faults_with(FE_TONEAREST), 0);
}

#if defined(__SSE__)
static void test_flushed_subnormals_are_found(void **state)
{
    const unsigned int before = _mm_getcsr();
    _mm_setcsr(before | 0x8000u);
    const volatile float normal = 1.17549435e-38f;
    const volatile float half = 0.5f;
    const volatile float flushed = normal * half;
    const uint32_t faults = pvid_arithmetic_faults_f32();
    _mm_setcsr(before);
    assert_int_equal(faults, (flushed == 0.0f) ? 2 : 0); /* an emulator may not flush what it is told to */
}
#endif

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_this_build_has_no_fault),
        cmocka_unit_test(test_another_rounding_is_found),
#if defined(__SSE__)
        cmocka_unit_test(test_flushed_subnormals_are_found),
#endif
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
