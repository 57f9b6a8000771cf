#include "pvid/kapitza_q31.h"

#include "solve/cholesky_q31.h"
#include "number/integer_q31.h"
#include "pvid/kapitza.h"

#define BITS PVID_KAPITZA_BITS_Q31
#define D_BITS 30 /* of d1, d2 and L2 in here: below 2^31 in value, so that 61 bits hold them */

static bool scale_is_valid(const pvid_kapitza_scale_q31 *scale)
{
    return (scale->l1 > 0) && (scale->g_multiplier > 0) && (scale->g_shift >= -31) && (scale->g_shift <= 62) &&
           (scale->d1_bits >= 0) && (scale->d1_bits <= 31) && (scale->d2_bits >= 0) && (scale->d2_bits <= 31);
}

/* a b / c, rounded down; 0 <= a < 2^62, 0 <= b < 2^31, c > 0. Saturates at half of PVID_WIDE, so that two add up. */
static int64_t times_over(int64_t a, int32_t b, int64_t c)
{
    const int32_t up =
        (int32_t)pvid_bit_length_q31((uint64_t)PVID_WIDE) - 1 - (int32_t)pvid_bit_length_q31((uint64_t)a);
    const int64_t quotient = pvid_scale_q31(a, -up) / c; /* a 2^up / c */
    const int32_t down = (int32_t)pvid_bit_length_q31((uint64_t)quotient) - 31;
    const int64_t mantissa = pvid_clamp_q31(pvid_scale_q31(quotient, down), (int64_t)1 << 31); /* 31 bits, rounded */
    return pvid_clamp_q31(pvid_scale_q31(mantissa * b, up - down), PVID_WIDE / 2);
}

/* sqrt(x^2 + y^2 + 2 r x y), r in Q30. */
static int64_t combined(int64_t x, int64_t y, int32_t r)
{
    int32_t m[2];
    const int64_t both[2] = {x, y};
    const int32_t exponent = pvid_to_block_q31(2, both, 29, m);
    const int64_t cross = pvid_round_shift_q31((int64_t)m[0] * m[1], 29);
    const int64_t square = ((int64_t)m[0] * m[0]) + ((int64_t)m[1] * m[1]) + (cross * r);
    const pvid_root_q31 root = pvid_root_of_q31((square > 0) ? square : 0, 2 * exponent);
    return pvid_scale_q31(root.r, -root.e);
}

bool pvid_kapitza_physical_q31(const pvid_estimate_q31 *estimate, const pvid_kapitza_scale_q31 *scale,
                               pvid_kapitza_q31 *value, pvid_kapitza_q31 *se)
{
    if (!scale_is_valid(scale)) {
        return false;
    }
    const int64_t d1 = pvid_scale_q31(estimate->p[PVID_KAPITZA_D1], scale->d1_bits - D_BITS);
    const int64_t d2 = pvid_scale_q31(estimate->p[PVID_KAPITZA_D2], scale->d2_bits - D_BITS);
    const int64_t big_l2 = (d1 - d2) - ((int64_t)1 << D_BITS);
    const int32_t w = estimate->p[PVID_KAPITZA_W];
    if ((w <= 0) || (d2 <= 0) || (big_l2 <= 0)) {
        return false;
    }
    const pvid_root_q31 scaled_root = pvid_root_of_q31(big_l2, -D_BITS);
    const int64_t root = pvid_scale_q31(scaled_root.r, -(scaled_root.e + D_BITS)); /* sqrt(L2), D_BITS */
    const int64_t g = pvid_scale_q31((int64_t)w * scale->g_multiplier, scale->g_shift);
    const int64_t l2 = times_over(big_l2, scale->l1, d2);
    const int64_t rho2 = times_over(root, scale->l1, d2);
    if ((g > INT32_MAX) || (l2 > INT32_MAX) || (rho2 > INT32_MAX)) {
        return false;
    }
    /* gradients over (d1, d2), with dL2 = dd1 - dd2, times the standard errors of these */
    const int64_t s1 = pvid_scale_q31(estimate->se[PVID_KAPITZA_D1], scale->d1_bits - D_BITS);
    const int64_t s2 = pvid_scale_q31(estimate->se[PVID_KAPITZA_D2], scale->d2_bits - D_BITS);
    const int32_t r = estimate->correlation[PVID_KAPITZA_D1][PVID_KAPITZA_D2];
    const int64_t l2_1 = times_over(s1, scale->l1, d2);
    const int64_t l2_2 = -(times_over(s2, scale->l1, d2) + times_over(s2, (int32_t)l2, d2));
    /* rho2 falls with d2 twice: through L2 and by itself; a half of rho2/L2 for a unit of L2 */
    const int64_t rho2_1 = times_over(s1, (int32_t)rho2, 2 * big_l2);
    const int64_t rho2_2 = -(times_over(s2, (int32_t)rho2, 2 * big_l2) + times_over(s2, (int32_t)rho2, d2));
    const int64_t g_se = pvid_scale_q31((int64_t)estimate->se[PVID_KAPITZA_W] * scale->g_multiplier, scale->g_shift);
    value->g = (int32_t)g;
    value->l2 = (int32_t)l2;
    value->rho2 = (int32_t)rho2;
    se->g = (int32_t)pvid_clamp_q31(g_se, INT32_MAX);
    se->l2 = (int32_t)pvid_clamp_q31(combined(l2_1, l2_2, r), INT32_MAX);
    se->rho2 = (int32_t)pvid_clamp_q31(combined(rho2_1, rho2_2, r), INT32_MAX);
    return true;
}
