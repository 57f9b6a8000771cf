/* The normal equations of the strong form at the present p, of its repeated moments in integers. */
#include "kapitza_sums_q31.h"

#include "kapitza_integer_q31.h"
#include "number/unroll.h"

enum { W = PVID_KAPITZA_W, D1 = PVID_KAPITZA_D1, D2 = PVID_KAPITZA_D2 };

#define MANTISSA_BITS 28       /* of a moment in a solve; the shift to the present rate makes it grow sixfold at most */
#define FEW ((int32_t)1 << 16) /* of a square after the shift: fewer bits are too few */
#define DELTA_LIMIT ((int32_t)1 << (PVID_KAPITZA_W_BITS - 2)) /* of w - w_r: a quarter */

/* ---- moments of G = u + w_r in a solve ---- */

/* Half the bits that squares, of which these are the bits, have beyond those of a mantissa, rounded up. */
static int32_t half_beyond(uint64_t bits)
{
    const int32_t beyond = (int32_t)pvid_bit_length_q31(bits) - MANTISSA_BITS;
    return (beyond > 0) ? ((beyond + 1) / 2) : 0;
}

/* The power of G in each sum, where A counts as 1 and Y as 2. */
static const uint8_t power_of[PVID_SUM_WEIGHT] = {2, 1, 0, 3, 2, 4, 4, 3, 2, 1, 3, 2, 1, 0, 5, 4, 3, 2, 5,
                                                  4, 3, 2, 1, 4, 3, 2, 1, 0, 6, 5, 4, 3, 2, 6, 5, 4, 3, 2,
                                                  1, 0, 7, 6, 5, 4, 3, 2, 1, 0, 8, 7, 6, 5, 4, 3, 2, 1, 0};

/* The sums by the scales of their two columns. */
enum { OF_AA, OF_AX, OF_AZ, OF_XX, OF_XZ, OF_ZZ, N_FAMILIES };

/* Places where the families begin. */
static const uint8_t first_of[N_FAMILIES + 1] = {PVID_SUM_AA,  PVID_SUM_A2,  PVID_SUM_A0,    PVID_SUM_K22,
                                                 PVID_SUM_K20, PVID_SUM_K00, PVID_SUM_WEIGHT};

/* Right shift of each family, >= 0. Returns whether a multiplication does each. */
static bool shifts_of(const pvid_kapitza_system_q31 *scales, uint32_t shift[N_FAMILIES])
{
    const uint32_t a = (uint32_t)scales->scale_a;
    const uint32_t x = (uint32_t)scales->scale_x;
    const uint32_t z = (uint32_t)scales->scale_z;
    shift[OF_AA] = 2u * a;
    shift[OF_AX] = a + x;
    shift[OF_AZ] = a + z;
    shift[OF_XX] = 2u * x;
    shift[OF_XZ] = x + z;
    shift[OF_ZZ] = 2u * z;
    const uint32_t least = PVID_SHIFT_DOWN_LEAST / 2u;
    const uint32_t most = PVID_SHIFT_DOWN_MOST / 2u;
    return (a >= least) && (x >= least) && (z >= least) && (a <= most) && (x <= most) && (z <= most);
}

PVID_COLD static void take_any(const int64_t sums[], const uint32_t shift[N_FAMILIES], int32_t m[])
{
    for (size_t family = 0; family < N_FAMILIES; family++) {
        for (size_t i = first_of[family]; i < first_of[family + 1u]; i++) {
            m[i] = (int32_t)pvid_round_shift_q31(sums[i], shift[family]);
        }
    }
}

PVID_ALWAYS_INLINE void take_family(const int64_t sums[], size_t count, uint32_t shift, int32_t m[])
{
    const pvid_shift_down_q31 by = pvid_shift_down_by_q31(shift);
    PVID_UNROLL
    for (size_t i = 0; i < count; i++) {
        m[i] = pvid_shifted_down_q31(&by, sums[i]);
    }
}

/* m = sums 2^-shift rounded half up, below 2^28 by the choice of the scales; that of Y Y is not needed. */
PVID_NOINLINE static void take_mantissas(const int64_t sums[], const pvid_kapitza_system_q31 *scales, int32_t m[])
{
    uint32_t shift[N_FAMILIES];
    if (!shifts_of(scales, shift)) {
        take_any(sums, shift, m);
        return;
    }
    take_family(sums, PVID_SUM_YY, shift[OF_AA], m);
    take_family(&sums[PVID_SUM_A2], 12, shift[OF_AX], &m[PVID_SUM_A2]);
    take_family(&sums[PVID_SUM_A0], 15, shift[OF_AZ], &m[PVID_SUM_A0]);
    take_family(&sums[PVID_SUM_K22], 7, shift[OF_XX], &m[PVID_SUM_K22]);
    take_family(&sums[PVID_SUM_K20], 8, shift[OF_XZ], &m[PVID_SUM_K20]);
    take_family(&sums[PVID_SUM_K00], 9, shift[OF_ZZ], &m[PVID_SUM_K00]);
}

/* ---- shift from G to the present rate G + d ---- */

/* binom(r, i) d^i for i = 1..r, at [i - 1], |d| < 1/4, Q30; r = 2..6 */
typedef struct {
    int32_t d;
    int32_t r2[2];
    int32_t r3[3];
    int32_t r4[4];
    int32_t r5[5];
    int32_t r6[6];
} shift_coefficients;

PVID_NOINLINE static void shift_by(int32_t d, shift_coefficients *c)
{
    const int32_t d2 = pvid_part_q31(d, d);
    const int32_t d3 = pvid_part_q31(d2, d);
    const int32_t d4 = pvid_part_q31(d2, d2);
    const int32_t d5 = pvid_part_q31(d4, d);
    c->d = d;
    c->r2[0] = 2 * d;
    c->r2[1] = d2;
    c->r3[0] = 3 * d;
    c->r3[1] = 3 * d2;
    c->r3[2] = d3;
    c->r4[0] = 4 * d;
    c->r4[1] = 6 * d2;
    c->r4[2] = 4 * d3;
    c->r4[3] = d4;
    c->r5[0] = 5 * d;
    c->r5[1] = 10 * d2;
    c->r5[2] = 10 * d3;
    c->r5[3] = 5 * d4;
    c->r5[4] = d5;
    c->r6[0] = 6 * d;
    c->r6[1] = 15 * d2;
    c->r6[2] = 20 * d3;
    c->r6[3] = 15 * d4;
    c->r6[4] = 6 * d5;
    c->r6[5] = pvid_part_q31(d3, d3);
}

/* m[0] + sum of c[i] m[i + 1], Q30. */
PVID_ALWAYS_INLINE int64_t along(const int32_t m[], const int32_t c[], size_t count)
{
    int64_t sum = (int64_t)m[0] * PVID_ONE_Q30;
    PVID_UNROLL
    for (size_t i = 0; i < count; i++) {
        sum += pvid_short_product_q31(m[i + 1u], c[i]);
    }
    return sum;
}

/* <a b G^r> and <a b G^(r+1)> at the present rate. */
typedef struct {
    int32_t low;
    int32_t high;
} shifted_pair;

PVID_ALWAYS_INLINE shifted_pair pair_of(const int32_t m[], const int32_t c[], size_t count, int32_t d)
{
    const int32_t low = pvid_out_q31(along(&m[1], c, count));
    const shifted_pair pair = {low, pvid_out_q31(along(m, c, count) + pvid_short_product_q31(d, low))};
    return pair;
}

/* <a b G^r>, <a b G^(r+1)>, <a b G^(r+2)> at the present rate. */
typedef struct {
    int32_t low;
    int32_t mid;
    int32_t high;
} shifted_triple;

PVID_ALWAYS_INLINE shifted_triple triple_of(const int32_t m[], const int32_t c[], size_t count, int32_t d)
{
    const int32_t low = pvid_out_q31(along(&m[2], c, count));
    const int64_t first = along(&m[1], c, count);
    const int32_t mid = pvid_out_q31(first + pvid_short_product_q31(d, low));
    const int64_t twice = pvid_short_product_q31(d, pvid_out_q31(first)) + pvid_short_product_q31(d, mid);
    const shifted_triple triple = {low, mid, pvid_out_q31(along(m, c, count) + twice)};
    return triple;
}

/* What S and F are made of: A, E, Y alone and times G^r phi'', G^r phi. */
typedef struct {
    int32_t aa;
    int32_t ae;
    int32_t ee;
    int32_t ya;
    int32_t ye;
    shifted_pair a2;
    shifted_pair e2;
    shifted_pair y2;
    shifted_pair a0;
    shifted_pair e0;
    shifted_pair y0;
    shifted_triple k22;
    shifted_triple k20;
    shifted_triple k00;
} shifted_sums;

PVID_NOINLINE static void shift_sums(const int64_t sums[], const pvid_kapitza_system_q31 *scales,
                                     const shift_coefficients *c, shifted_sums *out)
{
    int32_t m[PVID_SUM_WEIGHT];
    take_mantissas(sums, scales, m);
    out->aa = m[PVID_SUM_AA];
    out->ae = m[PVID_SUM_AE];
    out->ee = m[PVID_SUM_EE];
    out->ya = m[PVID_SUM_YA];
    out->ye = m[PVID_SUM_YE];
    out->a2 = pair_of(&m[PVID_SUM_A2], c->r2, 2, c->d);
    out->e2 = pair_of(&m[PVID_SUM_E2], c->r2, 2, c->d);
    out->y2 = pair_of(&m[PVID_SUM_Y2], c->r2, 2, c->d);
    out->a0 = pair_of(&m[PVID_SUM_A0], c->r3, 3, c->d);
    out->e0 = pair_of(&m[PVID_SUM_E0], c->r3, 3, c->d);
    out->y0 = pair_of(&m[PVID_SUM_Y0], c->r3, 3, c->d);
    out->k22 = triple_of(&m[PVID_SUM_K22], c->r4, 4, c->d);
    out->k20 = triple_of(&m[PVID_SUM_K20], c->r5, 5, c->d);
    out->k00 = triple_of(&m[PVID_SUM_K00], c->r6, 6, c->d);
}

/* ---- S and F ---- */

/* d1, 3 d1, d2, 4 d2 in units of the residual, Q30: half at most. */
typedef struct {
    int32_t d1;
    int32_t d1_3;
    int32_t d2;
    int32_t d2_4;
} shape;

/* A positive p 2^exponent in Q30, times `factor` at most half. */
static int32_t as_part(int32_t p, int32_t exponent, int32_t factor)
{
    const int32_t part = pvid_moved_q31(p, exponent + 30);
    const int32_t most = PVID_ONE_Q30 / (2 * factor);
    return (part < most) ? part : most;
}

/* S, F of the shifted sums; d = w - w_r. */
PVID_NOINLINE static void combine(int32_t d, const shape *p, const shifted_sums *m, pvid_kapitza_system_q31 *out)
{
    const int32_t two_d = 2 * d;
    const int32_t dd = pvid_part_q31(d, d);

    /* C^T M C with n_w = (A + 2 d E) + 3 d1 (-G^2 phi'') + 4 d2 (-G^3 phi) */
    const int32_t x_2 = m->a2.low + pvid_part_q31(two_d, m->e2.low);
    const int32_t x_0 = m->a0.low + pvid_part_q31(two_d, m->e0.low);
    const int32_t a_e = m->ae + pvid_part_q31(two_d, m->ee);
    const int32_t x_x = m->aa + pvid_part_q31(two_d, m->ae + a_e);
    const int32_t n_2 =
        x_2 + pvid_out_q31(pvid_short_product_q31(p->d1_3, m->k22.low) + pvid_short_product_q31(p->d2_4, m->k20.low));
    const int32_t n_0 =
        x_0 + pvid_out_q31(pvid_short_product_q31(p->d1_3, m->k20.low) + pvid_short_product_q31(p->d2_4, m->k00.low));
    const int64_t s_ww = pvid_short_product_q31(p->d1_3, x_2) + pvid_short_product_q31(p->d1_3, n_2) +
                         pvid_short_product_q31(p->d2_4, x_0) + pvid_short_product_q31(p->d2_4, n_0);
    const int32_t s_w1 = m->a2.high + pvid_out_q31(pvid_short_product_q31(two_d, m->e2.high) +
                                                   pvid_short_product_q31(p->d1_3, m->k22.mid) +
                                                   pvid_short_product_q31(p->d2_4, m->k20.mid));
    const int32_t s_w2 = m->a0.high + pvid_out_q31(pvid_short_product_q31(two_d, m->e0.high) +
                                                   pvid_short_product_q31(p->d1_3, m->k20.mid) +
                                                   pvid_short_product_q31(p->d2_4, m->k00.mid));
    out->s[0] = x_x + pvid_nearest_q31(s_ww, 30);
    out->s[1] = s_w1;
    out->s[2] = s_w2;
    out->s[3] = m->k22.high;
    out->s[4] = m->k20.high;
    out->s[5] = m->k00.high;

    /* C^T (B - M theta): N^T theta = Q + d1 n_1 + d2 n_2 with Q = d A + d^2 E */
    const int32_t q_a = pvid_out_q31(pvid_short_product_q31(d, m->aa) + pvid_short_product_q31(dd, m->ae));
    const int32_t q_e = pvid_out_q31(pvid_short_product_q31(d, m->ae) + pvid_short_product_q31(dd, m->ee));
    const int32_t q_2 = pvid_out_q31(pvid_short_product_q31(d, m->a2.low) + pvid_short_product_q31(dd, m->e2.low));
    const int32_t q_0 = pvid_out_q31(pvid_short_product_q31(d, m->a0.low) + pvid_short_product_q31(dd, m->e0.low));
    const int64_t one = PVID_ONE_Q30;
    out->f[W] = ((m->ya - q_a) * one) + pvid_short_product_q31(two_d, m->ye - q_e) +
                pvid_short_product_q31(p->d1_3, m->y2.low - q_2) + pvid_short_product_q31(p->d2_4, m->y0.low - q_0) -
                pvid_short_product_q31(p->d1, s_w1) - pvid_product_q31(p->d2, s_w2);
    out->f[D1] = (m->y2.high * one) - pvid_short_product_q31(d, m->a2.high) - pvid_short_product_q31(dd, m->e2.high) -
                 pvid_short_product_q31(p->d1, m->k22.high) - pvid_short_product_q31(p->d2, m->k20.high);
    out->f[D2] = (m->y0.high * one) - pvid_short_product_q31(d, m->a0.high) - pvid_short_product_q31(dd, m->e0.high) -
                 pvid_short_product_q31(p->d1, m->k20.high) - pvid_short_product_q31(p->d2, m->k00.high);
}

/* Exponent of a number: it is below 2^(returned). */
static int32_t length_of(int64_t x, int32_t bits)
{
    return (int32_t)pvid_bit_length_q31((uint64_t)x) - bits;
}

/* The scale of A, E, Y: at least of_a, and such that 3 d1 and 4 d2 in units of the residual are below a half. */
static void relate(int32_t of_a, const int32_t lengths[2], pvid_kapitza_system_q31 *out)
{
    const int32_t of_d1 = out->scale_x + out->time + lengths[0] + 1;
    const int32_t of_d2 = out->scale_z + (2 * out->time) + lengths[1] + 1;
    out->scale_a = pvid_larger_q31(of_a, pvid_larger_q31(of_d1, of_d2));
    out->of_x = (out->scale_x + out->time) - out->scale_a;
    out->of_z = (out->scale_z + (2 * out->time)) - out->scale_a;
}

/* Scales that bring every moment below 2^28. */
static void scale_families(const int64_t sums[], const int32_t lengths[2], pvid_kapitza_system_q31 *out)
{
    const uint64_t of_a = (uint64_t)sums[PVID_SUM_AA] | (uint64_t)sums[PVID_SUM_EE] | (uint64_t)sums[PVID_SUM_YY];
    out->scale_x = half_beyond((uint64_t)sums[PVID_SUM_K22 + 6] | (uint64_t)sums[PVID_SUM_K22]);
    out->scale_z = half_beyond((uint64_t)sums[PVID_SUM_K00 + 8] | (uint64_t)sums[PVID_SUM_K00]);
    relate(half_beyond(of_a), lengths, out);
}

/* ---- far from the reference ---- */

/* There G + d is small beside G or d, and 28 bits of the moments of G are too few: the shift in 64 bits. */

#define FAR_BITS 53 /* of a moment of G: it grows 256-fold at most */
#define FAR_TIME 2  /* from |d| < 1 to a quarter */

/* Half the bits that a square of so many bits has beyond these, rounded up. */
static int32_t half_of(int32_t length, int32_t bits)
{
    return pvid_floor_shift_32_q31((length - bits) + 1, 1);
}

static int32_t length_64(int64_t square)
{
    return (square > 0) ? (int32_t)pvid_bit_length_q31((uint64_t)square) : 0;
}

/* m[0], m[1], m[2] = <a b G^(count - 1)>, .. at the rate G + d; d in Q31. */
PVID_COLD static void shift_64(int64_t m[], size_t count, int32_t d)
{
    for (size_t left = count - 1u; left > 0u; left--) {
        for (size_t i = 0; i < left; i++) {
            m[i] += pvid_times_q31(m[i + 1u], d);
        }
    }
}

PVID_COLD static int32_t out_64(int64_t x, int32_t shift)
{
    return (int32_t)pvid_clamp_q31(pvid_scale_q31(x, shift), (int64_t)1 << MANTISSA_BITS);
}

static shifted_pair out_pair(const int64_t m[], int32_t shift, int32_t power)
{
    const shifted_pair pair = {out_64(m[1], shift + (FAR_TIME * (power - 1))),
                               out_64(m[0], shift + (FAR_TIME * power))};
    return pair;
}

static shifted_triple out_triple(const int64_t m[], int32_t shift, int32_t power)
{
    const shifted_triple triple = {out_64(m[2], shift + (FAR_TIME * (power - 2))),
                                   out_64(m[1], shift + (FAR_TIME * (power - 1))),
                                   out_64(m[0], shift + (FAR_TIME * power))};
    return triple;
}

static int32_t longer(int64_t a, int32_t less_a, int64_t b, int32_t less_b)
{
    return pvid_larger_q31(length_64(a) - less_a, length_64(b) - less_b);
}

/* The moments in units of a time 2^t: scales of their families, then 53 bits of each. */
PVID_COLD static void take_64(const int64_t sums[], int32_t t, pvid_kapitza_system_q31 *scales, int64_t m[])
{
    const int32_t of_a = longer(sums[PVID_SUM_AA], 2 * t, sums[PVID_SUM_YY], 4 * t);
    const int32_t a = half_of(pvid_larger_q31(length_64(sums[PVID_SUM_EE]), of_a), FAR_BITS);
    const int32_t x = half_of(longer(sums[PVID_SUM_K22 + 6], 0, sums[PVID_SUM_K22], 6 * t), FAR_BITS);
    const int32_t z = half_of(longer(sums[PVID_SUM_K00 + 8], 0, sums[PVID_SUM_K00], 8 * t), FAR_BITS);
    const int32_t shift[N_FAMILIES] = {2 * a, a + x, a + z, 2 * x, x + z, 2 * z};
    for (size_t family = 0; family < N_FAMILIES; family++) {
        for (size_t i = first_of[family]; i < first_of[family + 1u]; i++) {
            m[i] = pvid_scale_q31(sums[i], shift[family] + ((int32_t)power_of[i] * t));
        }
    }
    scales->scale_a = a;
    scales->scale_x = x;
    scales->scale_z = z;
}

/* Returns d in the time unit that it chooses, Q30: a quarter at most. */
PVID_COLD static int32_t shift_far(const int64_t sums[], int32_t beyond, const int32_t lengths[2],
                                   pvid_kapitza_system_q31 *scales, shifted_sums *out)
{
    const int32_t length = (int32_t)pvid_bit_length_q31(pvid_magnitude_q31(beyond));
    const int32_t t = pvid_larger_q31(length - PVID_KAPITZA_W_BITS, 0);
    const int32_t d = (int32_t)pvid_clamp_q31(
        pvid_round_shift_q31((int64_t)beyond * ((int64_t)1 << (31 - PVID_KAPITZA_W_BITS)), (uint32_t)t), INT32_MAX);
    int64_t m[PVID_SUM_WEIGHT];
    take_64(sums, t, scales, m);
    for (size_t k = 0; k < 3u; k++) {
        shift_64(&m[PVID_SUM_A2 + (4u * k)], 4, d);
        shift_64(&m[PVID_SUM_A0 + (5u * k)], 5, d);
    }
    shift_64(&m[PVID_SUM_K22], 7, d);
    shift_64(&m[PVID_SUM_K20], 8, d);
    shift_64(&m[PVID_SUM_K00], 9, d);

    const int32_t of_ay = longer(m[PVID_SUM_AA], 2 * FAR_TIME, m[PVID_SUM_YY], 4 * FAR_TIME);
    const int32_t more_a = half_of(pvid_larger_q31(length_64(m[PVID_SUM_EE]), of_ay), MANTISSA_BITS);
    const int32_t of_x =
        half_of(longer(m[PVID_SUM_K22 + 2], 4 * FAR_TIME, m[PVID_SUM_K22], 6 * FAR_TIME), MANTISSA_BITS);
    const int32_t of_z =
        half_of(longer(m[PVID_SUM_K00 + 2], 6 * FAR_TIME, m[PVID_SUM_K00], 8 * FAR_TIME), MANTISSA_BITS);
    const int32_t x = pvid_larger_q31(of_x, -scales->scale_x); /* no finer than the sums are */
    const int32_t z = pvid_larger_q31(of_z, -scales->scale_z);
    const int32_t before = scales->scale_a;
    scales->time = t + FAR_TIME;
    scales->scale_x += x;
    scales->scale_z += z;
    relate(pvid_larger_q31(before + more_a, 0), lengths, scales);
    const int32_t a = scales->scale_a - before;
    out->aa = out_64(m[PVID_SUM_AA], (2 * a) + (2 * FAR_TIME));
    out->ae = out_64(m[PVID_SUM_AE], (2 * a) + FAR_TIME);
    out->ee = out_64(m[PVID_SUM_EE], 2 * a);
    out->ya = out_64(m[PVID_SUM_YA], (2 * a) + (3 * FAR_TIME));
    out->ye = out_64(m[PVID_SUM_YE], (2 * a) + (2 * FAR_TIME));
    out->a2 = out_pair(&m[PVID_SUM_A2], a + x, 4);
    out->e2 = out_pair(&m[PVID_SUM_E2], a + x, 3);
    out->y2 = out_pair(&m[PVID_SUM_Y2], a + x, 5);
    out->a0 = out_pair(&m[PVID_SUM_A0], a + z, 5);
    out->e0 = out_pair(&m[PVID_SUM_E0], a + z, 4);
    out->y0 = out_pair(&m[PVID_SUM_Y0], a + z, 6);
    out->k22 = out_triple(&m[PVID_SUM_K22], 2 * x, 6);
    out->k20 = out_triple(&m[PVID_SUM_K20], x + z, 7);
    out->k00 = out_triple(&m[PVID_SUM_K00], 2 * z, 8);
    return (int32_t)pvid_round_shift_q31(d, FAR_TIME + 1u);
}

void pvid_kapitza_project_q31(const pvid_kapitza_estimator_q31 *self, pvid_kapitza_system_q31 *system)
{
    const int32_t beyond = self->p[W] - self->reference; /* w - w_r */
    const int32_t lengths[2] = {length_of(3 * (int64_t)self->p[D1], self->bits[0]),
                                length_of(4 * (int64_t)self->p[D2], self->bits[1])};
    shift_coefficients c;
    shifted_sums shifted;
    bool is_near = false;
    int32_t d = 0; /* w - w_r, Q30 */
    system->time = 0;
    if ((beyond < DELTA_LIMIT) && (beyond > -DELTA_LIMIT)) {
        d = beyond * (int32_t)((uint32_t)1 << (30u - PVID_KAPITZA_W_BITS));
        scale_families(self->sums, lengths, system);
        shift_by(d, &c);
        shift_sums(self->sums, system, &c, &shifted);
        is_near = (shifted.k22.high >= FEW) && (shifted.k00.high >= FEW);
    }
    if (!is_near) {
        d = shift_far(self->sums, beyond, lengths, system, &shifted);
    }
    const int32_t d1 = as_part(self->p[D1], system->of_x - self->bits[0], 3);
    const int32_t d2 = as_part(self->p[D2], system->of_z - self->bits[1], 4);
    const shape p = {d1, 3 * d1, d2, 4 * d2};
    combine(d, &p, &shifted, system);
}

void pvid_kapitza_exponents_q31(const pvid_kapitza_estimator_q31 *self, const pvid_kapitza_system_q31 *system,
                                int32_t of[PVID_KAPITZA_P])
{
    const int32_t t = system->time;
    of[W] = (system->scale_a + t) - PVID_KAPITZA_W_BITS;
    of[D1] = (system->scale_x + (3 * t)) - self->bits[0];
    of[D2] = (system->scale_z + (4 * t)) - self->bits[1];
}
