#include "pvid/elementary_q31.h"

#include "number/scaled_q31.h"

/* 2^32 / pi: half turns a radian in Q32. */
#define HALF_TURNS INT64_C(1367130551)
#define HALF_TURNS_BITS 32u

#define ANGLE_BITS 30u
/* Below 2^-15 the sine of x differs from x by less than 2^-32 x. */
#define SMALL_EXPONENT (-45)

/* sin(pi y) / y in powers of y^2, Q28: the polynomial of least greatest error, 1.4e-11. */
#define POLYNOMIAL_BITS 28u
static const int32_t polynomial[6] = {-1879182, 22020091, -160859250, 684554113, -1387197326, 843314856};

/* sin(pi h 2^-bits) in Q30, bits 32..62, |h| < 5.3e18. */
static int32_t sine_of_half_turns(int64_t h, uint32_t bits)
{
    const uint32_t half_bits = bits - 1u;
    const uint64_t half = (uint64_t)1 << half_bits;
    const uint64_t from_half = pvid_magnitude_q31(h) + half;
    const uint64_t part = from_half & (((uint64_t)1 << bits) - 1u);
    const int64_t rest = (int64_t)part - (int64_t)half; /* |h| less the nearest integer */
    const int32_t y = (int32_t)pvid_round_shift_q31(rest, bits - ANGLE_BITS);
    const int32_t z = (int32_t)pvid_round_shift_q31(pvid_square_q31(y), ANGLE_BITS);
    int32_t sum = polynomial[0];
    for (size_t k = 1; k < (sizeof polynomial / sizeof polynomial[0]); k++) {
        sum = (int32_t)pvid_round_shift_q31(pvid_product_q31(sum, z), ANGLE_BITS) + polynomial[k];
    }
    const int64_t sine = pvid_round_shift_q31(pvid_product_q31(y, sum), POLYNOMIAL_BITS);
    const int32_t held = (int32_t)pvid_clamp_q31(sine, PVID_ONE_Q30);
    const bool is_odd = ((from_half >> bits) & 1u) != 0u;
    const bool is_negative = h < 0;
    return (is_odd != is_negative) ? -held : held;
}

#if defined(__ARM_ARCH_6M__)
int32_t pvid_fixed_product_q31(int32_t a, int32_t b, uint32_t s)
{
    const int64_t product = pvid_product_in_halves_q31(a, b);
    if (s == 30u) { /* of most */
        return (int32_t)pvid_round_shift_q31(product, 30);
    }
    return (int32_t)pvid_round_shift_q31(product, s);
}
#endif

int32_t pvid_sin_q31(int32_t x, uint32_t bits)
{
    return sine_of_half_turns(x * HALF_TURNS, bits + HALF_TURNS_BITS);
}

int32_t pvid_cos_q31(int32_t x, uint32_t bits)
{
    const int64_t quarter_turn = (int64_t)1 << ((bits + HALF_TURNS_BITS) - 1u);
    return sine_of_half_turns((x * HALF_TURNS) + quarter_turn, bits + HALF_TURNS_BITS);
}

/* 2 / ln 2 in Q26. */
#define TWO_OVER_LN_2 INT32_C(193635251)
#define POWER_BITS 26u
#define POWER_MAX ((int64_t)31 << POWER_BITS) /* 2^-31 is below half a unit */

/* 2^-f in powers of f, 0 <= f < 1, Q30: within 5.1e-9. */
static const int32_t power_of_half[7] = {117454, -1369790, 10286509, -59583045, 257938938, -744260975, 1073741823};

int32_t pvid_tanh_q31(int32_t v, int32_t width)
{
    const int64_t size = (v < 0) ? -(int64_t)v : (int64_t)v;
    const int64_t t = (size * TWO_OVER_LN_2) / width;
    int32_t whole = PVID_ONE_Q30;
    if (t < POWER_MAX) {
        const int32_t f = (int32_t)((uint64_t)t & (((uint64_t)1 << POWER_BITS) - 1u));
        int32_t sum = power_of_half[0];
        for (size_t k = 1; k < (sizeof power_of_half / sizeof power_of_half[0]); k++) {
            sum = (int32_t)pvid_floor_shift_q31(pvid_product_q31(sum, f), POWER_BITS) + power_of_half[k];
        }
        const int32_t e = pvid_floor_shift_32_q31(sum, (uint32_t)pvid_floor_shift_q31(t, POWER_BITS));
        const int64_t above = ((int64_t)PVID_ONE_Q30 - e) * PVID_ONE_Q30;
        whole = (int32_t)(above / ((int64_t)PVID_ONE_Q30 + e));
    }
    return (v < 0) ? -whole : whole;
}

int32_t pvid_sign_q31(int32_t v)
{
    if (v > 0) {
        return PVID_ONE_Q30;
    }
    return (v < 0) ? -PVID_ONE_Q30 : 0;
}

int32_t pvid_soft_sign_q31(int32_t v, int32_t width)
{
    const int64_t below = (int64_t)pvid_fixed_magnitude_q31(v) + width;
    return (int32_t)pvid_clamp_q31(((int64_t)v * PVID_ONE_Q30) / below, PVID_ONE_Q30);
}

bool pvid_within_limits_q31(const int32_t x[], const int32_t limit[], size_t n)
{
    bool within = true;
    for (size_t i = 0; i < n; i++) {
        within = within && (x[i] <= limit[i]) && (x[i] >= -limit[i]);
    }
    return within;
}

pvid_scaled_q31 pvid_scaled_quotient_q31(pvid_scaled_q31 a, pvid_scaled_q31 b)
{
    if (b.m == 0) {
        const pvid_scaled_q31 zero = {0, 0};
        return zero;
    }
    if (b.m < 0) {
        return pvid_scaled_over_q31(pvid_scaled_negated_q31(a), pvid_scaled_negated_q31(b));
    }
    return pvid_scaled_over_q31(a, b);
}

/* The angle with at most 30 bits after the point, -45 <= a.e <= 0; returns them. */
static uint32_t angle_of(pvid_scaled_q31 a, int32_t *x)
{
    const uint32_t bits = (uint32_t)-a.e;
    if (bits <= ANGLE_BITS) {
        *x = a.m;
        return bits;
    }
    *x = (int32_t)pvid_round_shift_q31(a.m, bits - ANGLE_BITS);
    return ANGLE_BITS;
}

pvid_scaled_q31 pvid_scaled_sin_q31(pvid_scaled_q31 a)
{
    if ((a.m == 0) || (a.e < SMALL_EXPONENT)) {
        return a;
    }
    if (a.e > 0) {
        return pvid_scaled_of_q31(0, 0);
    }
    int32_t x;
    const uint32_t bits = angle_of(a, &x);
    return pvid_scaled_of_q31(pvid_sin_q31(x, bits), -30);
}

pvid_scaled_q31 pvid_scaled_cos_q31(pvid_scaled_q31 a)
{
    if ((a.m == 0) || (a.e < SMALL_EXPONENT)) {
        return pvid_scaled_of_q31(1, 0);
    }
    if (a.e > 0) {
        return pvid_scaled_of_q31(0, 0);
    }
    int32_t x;
    const uint32_t bits = angle_of(a, &x);
    return pvid_scaled_of_q31(pvid_cos_q31(x, bits), -30);
}

pvid_scaled_q31 pvid_scaled_sign_q31(pvid_scaled_q31 a)
{
    return pvid_scaled_of_q31(pvid_sign_q31(a.m), -30);
}

pvid_scaled_q31 pvid_scaled_magnitude_q31(pvid_scaled_q31 a)
{
    return (a.m < 0) ? pvid_scaled_negated_q31(a) : a;
}
