/* The sums of the strong form: any row within its limit on top of any sums that the end of a row leaves, at any age. */
#include "prove.h"

#include "kapitza_sums_q31.h"

#define SUM_BOUND ((int64_t)1 << 61) /* the squares end at 2^60, the others at twice that */

static pvid_kapitza_estimator_q31 estimator;

void main(void)
{
    int32_t row[PVID_KAPITZA_ROW_Q31];
    for (size_t i = 0; i < PVID_KAPITZA_ROW_Q31; i++) {
        row[i] = any_i32(-PVID_ROW_LIMIT_Q31, PVID_ROW_LIMIT_Q31);
    }
    for (size_t i = 0; i < PVID_KAPITZA_SUMS_Q31; i++) {
        estimator.sums[i] = any_i64(-SUM_BOUND, SUM_BOUND);
    }
    estimator.retention = any_i32(1, INT32_MAX);
    estimator.block = (uint16_t)any_u32(1, 64);
    estimator.age = (uint16_t)any_u32(0, 63);
    estimator.exponent = (uint8_t)any_u32(0, 30);
    pvid_kapitza_add_q31(&estimator, row);
    pvid_kapitza_end_row_q31(&estimator);
}
