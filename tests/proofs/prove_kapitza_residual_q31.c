/* The residual sum of squares of the strong form: any sums, any p, any formats that init takes. */
#include "prove.h"

#include "contracts.h"
#include "kapitza_sums_q31.h"

static pvid_kapitza_estimator_q31 estimator;

void main(void)
{
    for (size_t i = 0; i < PVID_KAPITZA_SUMS_Q31; i++) {
        estimator.sums[i] = any_i64(-((int64_t)1 << 61), (int64_t)1 << 61);
    }
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        estimator.p[a] = any_i32(1, INT32_MAX);
    }
    estimator.reference = any_i32(0, 2 * PVID_KAPITZA_RATE_LIMIT_Q31);
    estimator.bits[0] = (int8_t)any_i32(0, 60);
    estimator.bits[1] = (int8_t)any_i32(0, 60);
    const int64_t residual = pvid_kapitza_residual_q31(&estimator);
    /*@ assert 0 <= residual <= 0x4000000000000000; */
}
