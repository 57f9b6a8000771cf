/* weak/error_q31: any mean square of residuals on top of any mean, then any share of any variance. */
#include "prove.h"

#include "contracts.h"
#include "pvid/weak_q31.h"
#include "weak/error_q31.h"

#define EXPONENT_BOUND 1100 /* of a variance; those of designs and of what is found lie within 1000 */
#define MEAN_BOUND ((int32_t)1 << 29)

static pvid_scaled_q31 any_number(int32_t least, int32_t bound)
{
    const pvid_scaled_q31 x = {any_i32(least, PVID_ONE_Q30), any_i32(-bound, bound)};
    return x;
}

void main(void)
{
    pvid_weak_error_q31 error = {
        .variance = any_number(0, EXPONENT_BOUND), .mean = any_i32(0, MEAN_BOUND), .windows = (uint8_t)any_u32(0, 16)};
    const pvid_scaled_q31 least = any_number(0, EXPONENT_BOUND);
    (void)pvid_weak_error_take_q31(&error, least, any_number(0, 2000));
    /*@ assert 0 <= error.windows <= 16; */
    error.mean = any_i32(0, MEAN_BOUND);
    const pvid_scaled_q31 share = {any_i32(PVID_ONE_Q30 / 2, PVID_ONE_Q30), any_i32(-2000, 2000)};
    const int32_t left = pvid_weak_error_change_q31(&error, least, share);
    /*@ assert 0 <= left; */
    /*@ assert error.variance.e <= EXPONENT_BOUND; */
}
