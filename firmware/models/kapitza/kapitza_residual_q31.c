/* The residual sum of squares of the strong form at the present p, in 64 bits. */
#include "kapitza_sums_q31.h"

#include "kapitza_integer_q31.h"
#include "number/scaled_q31.h"

enum { W = PVID_KAPITZA_W, D1 = PVID_KAPITZA_D1, D2 = PVID_KAPITZA_D2 };

/* Place of the product of the entries i <= j of N in the sums. */
static size_t place_of(size_t i, size_t j)
{
    const bool i_is_x = (i >= PVID_ROW_X) && (i < PVID_ROW_Z);
    const bool j_is_x = (j >= PVID_ROW_X) && (j < PVID_ROW_Z);
    if (j < PVID_ROW_X) {
        return (i + j) + PVID_SUM_AA;
    }
    if (i < PVID_ROW_X) {
        const size_t first = j_is_x ? PVID_SUM_A2 : PVID_SUM_A0;
        const size_t count = j_is_x ? 4u : 5u;
        return first + (i * count) + (j - (j_is_x ? (size_t)PVID_ROW_X : (size_t)PVID_ROW_Z));
    }
    if (j_is_x) {
        return ((i - PVID_ROW_X) + (j - PVID_ROW_X)) + PVID_SUM_K22;
    }
    return i_is_x ? (((i - PVID_ROW_X) + (j - PVID_ROW_Z)) + PVID_SUM_K20)
                  : (((i - PVID_ROW_Z) + (j - PVID_ROW_Z)) + PVID_SUM_K00);
}

static size_t place_of_y(size_t i)
{
    if (i < PVID_ROW_X) {
        return i + PVID_SUM_YA;
    }
    return (i < PVID_ROW_Z) ? ((i - PVID_ROW_X) + PVID_SUM_Y2) : ((i - PVID_ROW_Z) + PVID_SUM_Y0);
}

/* theta_i = mantissa[i] 2^(returned - 31), with d = w - w_r in place of w. */
static int32_t theta_of(const pvid_kapitza_estimator_q31 *self, int32_t mantissa_of[PVID_KAPITZA_STRONG_THETA])
{
    static const uint8_t binomial[PVID_KAPITZA_STRONG_THETA] = {1, 1, 1, 3, 3, 1, 1, 4, 6, 4, 1};
    const pvid_scaled_q31 d = pvid_scaled_of_q31((int64_t)self->p[W] - self->reference, -PVID_KAPITZA_W_BITS);
    pvid_scaled_q31 theta[PVID_KAPITZA_STRONG_THETA];
    theta[0] = d;
    theta[1] = pvid_scaled_times_q31(d, d);
    theta[PVID_ROW_X] = pvid_scaled_of_q31(self->p[D1], -(int32_t)self->bits[0]);
    theta[PVID_ROW_Z] = pvid_scaled_of_q31(self->p[D2], -(int32_t)self->bits[1]);
    for (size_t i = PVID_ROW_X + 1; i < PVID_KAPITZA_STRONG_THETA; i++) {
        if (i != PVID_ROW_Z) {
            theta[i] = pvid_scaled_times_q31(theta[i - 1u], d);
        }
    }
    int32_t largest = 0;
    for (size_t i = 0; i < PVID_KAPITZA_STRONG_THETA; i++) {
        theta[i] = pvid_scaled_times_q31(theta[i], pvid_scaled_of_q31(binomial[i], 0));
        largest = pvid_larger_q31(largest, (theta[i].m != 0) ? (theta[i].e + 31) : 0);
    }
    for (size_t i = 0; i < PVID_KAPITZA_STRONG_THETA; i++) {
        mantissa_of[i] = (int32_t)pvid_clamp_q31(pvid_scaled_fixed_q31(theta[i], 31 - largest), INT32_MAX);
    }
    return largest;
}

#define GUARD_BITS 5u /* eleven products add up */

int64_t pvid_kapitza_residual_q31(const pvid_kapitza_estimator_q31 *self)
{
    int32_t theta[PVID_KAPITZA_STRONG_THETA];
    const uint32_t exponent = (uint32_t)theta_of(self, theta);
    const int64_t *sums = self->sums;
    /* in units of 4^exponent */
    int64_t residual = pvid_round_shift_q31(sums[PVID_SUM_YY], (2u * exponent) + GUARD_BITS);
    for (size_t i = 0; i < PVID_KAPITZA_STRONG_THETA; i++) {
        int64_t known = 0;
        for (size_t j = 0; j < PVID_KAPITZA_STRONG_THETA; j++) {
            const int64_t moment = sums[(i < j) ? place_of(i, j) : place_of(j, i)];
            known += pvid_times_q31(pvid_round_shift_q31(moment, GUARD_BITS), theta[j]);
        }
        const int64_t of_y = pvid_round_shift_q31(sums[place_of_y(i)], exponent + GUARD_BITS);
        residual += pvid_times_q31(pvid_clamp_q31(known - (2 * of_y), PVID_WIDE / 8), theta[i]);
    }
    const int64_t found = pvid_scale_q31(pvid_clamp_q31(residual, PVID_WIDE), -(int32_t)((2u * exponent) + GUARD_BITS));
    return (found > 0) ? found : 0;
}
