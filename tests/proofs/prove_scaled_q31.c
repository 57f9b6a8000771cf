/* scaled_q31 on top of pvid_scaled_of_q31: sums at every distance of the two exponents (of which nothing but the
 * distance counts), products and quotients, the exponents (which are but added) at their ends and in the middle; of
 * numbers of either sign and of 0. */
#include "prove.h"

#include "contracts.h"

#define EXPONENT_MAX 10000

typedef enum { NEGATIVE, ZERO, POSITIVE, SIGNS } sign;

static pvid_scaled_q31 any_scaled(sign of, int32_t lowest, int32_t highest)
{
    pvid_scaled_q31 x = {0, any_i32(lowest, highest)};
    if (of != ZERO) {
        x.m = (of == POSITIVE) ? any_i32(1, PVID_ONE_Q30) : any_i32(-PVID_ONE_Q30, -1);
    }
    return x;
}

static void any_pair(sign of_a, sign of_b)
{
    for (int32_t apart = 0; apart <= 64; apart++) {
        (void)pvid_scaled_plus_q31(any_scaled(of_a, 0, 0), any_scaled(of_b, -apart, -apart));
        (void)pvid_scaled_plus_q31(any_scaled(of_a, -apart, -apart), any_scaled(of_b, 0, 0));
    }
    for (int32_t e = -EXPONENT_MAX; e <= EXPONENT_MAX; e += EXPONENT_MAX) {
        const pvid_scaled_q31 a = any_scaled(of_a, e, e);
        const pvid_scaled_q31 b = any_scaled(of_b, -e, -e);
        (void)pvid_scaled_plus_q31(a, b);
        (void)pvid_scaled_times_q31(a, any_scaled(of_b, e, e));
        (void)pvid_scaled_times_q31(a, b);
        if (of_b == POSITIVE) {
            (void)pvid_scaled_over_q31(a, any_scaled(of_b, e, e));
            (void)pvid_scaled_over_q31(a, b);
        }
    }
    if ((of_a != ZERO) && (of_b != ZERO)) {
        const pvid_scaled_q31 more = any_scaled(of_a, EXPONENT_MAX, EXPONENT_MAX);
        const pvid_scaled_q31 less = any_scaled(of_b, -EXPONENT_MAX, EXPONENT_MAX - 65);
        (void)pvid_scaled_plus_q31(more, less);
        (void)pvid_scaled_plus_q31(less, more);
    }
}

void main(void)
{
    for (sign of_a = NEGATIVE; of_a < SIGNS; of_a++) {
        for (sign of_b = NEGATIVE; of_b < SIGNS; of_b++) {
            any_pair(of_a, of_b);
        }
    }
    (void)pvid_scaled_shifted_q31(any_scaled(POSITIVE, -EXPONENT_MAX, EXPONENT_MAX),
                                  any_i32(-EXPONENT_MAX, EXPONENT_MAX));
    const pvid_scaled_q31 positive = {any_i32(PVID_ONE_Q30 / 2, PVID_ONE_Q30), any_i32(-10000, 10000)};
    (void)pvid_inverse_root_q31(positive);
}
