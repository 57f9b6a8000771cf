/* scaled_q31 on top of pvid_scaled_of_q31: sums at every distance of the two exponents (of which nothing but the distance
 * counts), products and quotients of any two. */
#include "prove.h"

#include "contracts.h"

static pvid_scaled_q31 any_scaled(int32_t lowest, int32_t highest)
{
    const pvid_scaled_q31 x = {any_i32(-PVID_ONE_Q30, PVID_ONE_Q30), any_i32(lowest, highest)};
    return x;
}

void main(void)
{
    for (int32_t apart = 0; apart <= 64; apart++) {
        (void)pvid_scaled_plus_q31(any_scaled(0, 0), any_scaled(-apart, -apart));
        (void)pvid_scaled_plus_q31(any_scaled(-apart, -apart), any_scaled(0, 0));
    }
    (void)pvid_scaled_plus_q31(any_scaled(0, 10000), any_scaled(-10000, -65));
    (void)pvid_scaled_plus_q31(any_scaled(-10000, -65), any_scaled(0, 10000));
    (void)pvid_scaled_times_q31(any_scaled(-10000, 10000), any_scaled(-10000, 10000));
    pvid_scaled_q31 positive = any_scaled(-10000, 10000);
    positive.m = any_i32(1, PVID_ONE_Q30);
    (void)pvid_scaled_over_q31(any_scaled(-10000, 10000), positive);
    (void)pvid_scaled_shifted_q31(any_scaled(-10000, 10000), any_i32(-10000, 10000));
}
