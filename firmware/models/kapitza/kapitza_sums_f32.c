#include "number/uncontracted.h"

/* The sums of the strong form (theory.md 2) and C^T M C from them, with its two economies.
 *
 * Products repeat. With A = N_1, E = N_2, the entries 3..6 are -u^k phi'' and 7..11 are -u^k phi,
 * so M holds only the sums of A^2, AE, E^2, of A and E times each of those nine, and of
 * phi''^2 u^k (k <= 6), phi'' phi u^k (k <= 7), phi^2 u^k (k <= 8): 45 of 66.
 *
 * C is a shift. N^T C = (n_w, n_1, n_2) with G = u + w and n_1 = -G^3 phi'', n_2 = -G^4 phi, so each
 * entry of C^T M C is a few sums of the kind <a b G^r> = sum_k binom(r, k) w^(r-k) <a b u^k>.
 */
#include "kapitza_sums_f32.h"

#include <stddef.h>

#include "kapitza_row_f32.h"
#include "kapitza_shift_f32.h"
#include "number/unroll.h"

enum { W = PVID_KAPITZA_W, D1 = PVID_KAPITZA_D1, D2 = PVID_KAPITZA_D2 };

/* Indices of the moments; sequences are in descending powers of u, as in N. */
enum {
    AA = 0,
    AE = 1,
    EE = 2,
    A_PHI2 = 3,                      /* 4: A (-u^k phi'') */
    E_PHI2 = 7,                      /* 4 */
    A_PHI0 = 11,                     /* 5: A (-u^k phi) */
    E_PHI0 = 16,                     /* 5 */
    PHI2_PHI2 = 21,                  /* 7 */
    PHI2_PHI0 = 28,                  /* 8 */
    PHI0_PHI0 = 36,                  /* 9 */
    B = PVID_KAPITZA_STRONG_MOMENTS, /* 11: N Y */
    YY = 56,
    WEIGHT = 57
};

/* Adds a product to a sum and returns the new sum. */
static inline float plus(const float *restrict high, float *restrict low, float product)
{
    const float sum = *low + product;
    *low = sum;
    return *high + sum;
}

/* Stretches of 3, 4 and 5 sums: low[i] += a x[i]. Written out, so that the values stay in registers. */
static inline void plus_3(float a, const float x[], const float high[], float low[], float sums[])
{
    sums[0] = plus(&high[0], &low[0], a * x[0]);
    sums[1] = plus(&high[1], &low[1], a * x[1]);
    sums[2] = plus(&high[2], &low[2], a * x[2]);
}

static inline void plus_4(float a, const float x[], const float high[], float low[], float sums[])
{
    plus_3(a, x, high, low, sums);
    sums[3] = plus(&high[3], &low[3], a * x[3]);
}

static inline void plus_5(float a, const float x[], const float high[], float low[], float sums[])
{
    plus_4(a, x, high, low, sums);
    sums[4] = plus(&high[4], &low[4], a * x[4]);
}

/* The products of a factor with all of -u^k phi'' (of -u^k phi), at the place `at` of the sums. */
static inline void add_to_phi2(size_t at, float a, const float n[], const float high[], float low[], float sums[4])
{
    plus_4(a, &n[PVID_N_PHI2], &high[at], &low[at], sums);
}

static inline void add_to_phi0(size_t at, float a, const float n[], const float high[], float low[], float sums[5])
{
    plus_5(a, &n[PVID_N_PHI0], &high[at], &low[at], sums);
}

/* u^6 .. u^3, then u^2 .. u^0 */
static inline void add_phi2_phi2(const float n[], const float high[], float low[], float sums[7])
{
    const float *x = &n[PVID_N_PHI2];
    plus_4(x[0], x, &high[PHI2_PHI2], &low[PHI2_PHI2], sums);
    plus_3(x[3], &x[1], &high[PHI2_PHI2 + 4], &low[PHI2_PHI2 + 4], &sums[4]);
}

/* u^7 .. u^4, then u^3 .. u^0 */
static inline void add_phi2_phi0(const float n[], const float high[], float low[], float sums[8])
{
    const float *x = &n[PVID_N_PHI2];
    const float *z = &n[PVID_N_PHI0];
    plus_4(z[0], x, &high[PHI2_PHI0], &low[PHI2_PHI0], sums);
    plus_4(x[3], &z[1], &high[PHI2_PHI0 + 4], &low[PHI2_PHI0 + 4], &sums[4]);
}

/* u^8 .. u^4, then u^3 .. u^0 */
static inline void add_phi0_phi0(const float n[], const float high[], float low[], float sums[9])
{
    const float *z = &n[PVID_N_PHI0];
    plus_5(z[0], z, &high[PHI0_PHI0], &low[PHI0_PHI0], sums);
    plus_4(z[4], &z[1], &high[PHI0_PHI0 + 5], &low[PHI0_PHI0 + 5], &sums[5]);
}

/* A^2, A E, E^2 */
static inline void add_quadratic(const float n[], const float high[], float low[], float sums[3])
{
    sums[0] = plus(&high[AA], &low[AA], n[PVID_N_A] * n[PVID_N_A]);
    sums[1] = plus(&high[AE], &low[AE], n[PVID_N_A] * n[PVID_N_E]);
    sums[2] = plus(&high[EE], &low[EE], n[PVID_N_E] * n[PVID_N_E]);
}

/* Y A, Y E */
static inline void add_linear(const float n[], float y, const float high[], float low[], float sums[2])
{
    sums[0] = plus(&high[B + PVID_N_A], &low[B + PVID_N_A], y * n[PVID_N_A]);
    sums[1] = plus(&high[B + PVID_N_E], &low[B + PVID_N_E], y * n[PVID_N_E]);
}

static inline void add_yy_and_weight(float y, float low[])
{
    low[YY] += y * y;
    low[WEIGHT] += 1.0f;
}

void pvid_kapitza_accumulate_f32(const float n[], float y, const float high[], float low[], float sums[])
{
    add_quadratic(n, high, low, &sums[AA]);
    add_to_phi2(A_PHI2, n[PVID_N_A], n, high, low, &sums[A_PHI2]);
    add_to_phi2(E_PHI2, n[PVID_N_E], n, high, low, &sums[E_PHI2]);
    add_to_phi0(A_PHI0, n[PVID_N_A], n, high, low, &sums[A_PHI0]);
    add_to_phi0(E_PHI0, n[PVID_N_E], n, high, low, &sums[E_PHI0]);
    add_phi2_phi2(n, high, low, &sums[PHI2_PHI2]);
    add_phi2_phi0(n, high, low, &sums[PHI2_PHI0]);
    add_phi0_phi0(n, high, low, &sums[PHI0_PHI0]);
    add_linear(n, y, high, low, &sums[B]);
    add_to_phi2(B + PVID_N_PHI2, y, n, high, low, &sums[B + PVID_N_PHI2]);
    add_to_phi0(B + PVID_N_PHI0, y, n, high, low, &sums[B + PVID_N_PHI0]);
    add_yy_and_weight(y, low);
    sums[YY] = high[YY] + low[YY];
    sums[WEIGHT] = high[WEIGHT] + low[WEIGHT];
}

void pvid_kapitza_add_f32(const float n[], float y, const float high[], float low[])
{
    float sums[PVID_MAX_SUMS];
    pvid_kapitza_accumulate_f32(n, y, high, low, sums);
}

/* What C^T M C and C^T (b - M theta) are made of, with X_k for -G^k phi'' or -G^k phi. */
typedef struct {
    float aa;
    float ae;
    float ee;
    float y_a;
    float y_e;
    shifted_pair a2; /* A, E, Y times -G^2 phi'' and -G^3 phi'' */
    shifted_pair e2;
    shifted_pair y2;
    shifted_pair a0; /* A, E, Y times -G^3 phi and -G^4 phi */
    shifted_pair e0;
    shifted_pair y0;
    shifted_triple k22; /* phi''^2 G^4, G^5, G^6 */
    shifted_triple k20; /* phi'' phi G^5, G^6, G^7 */
    shifted_triple k00; /* phi^2 G^6, G^7, G^8 */
} shifted_sums;

/* From the sums m and b. */
PVID_ALWAYS_INLINE void shift_sums(float w, const float m[], const float b[], shifted_sums *out)
{
    shift_coefficients c;
    shift_by(w, &c);
    out->aa = m[AA];
    out->ae = m[AE];
    out->ee = m[EE];
    out->y_a = b[PVID_N_A];
    out->y_e = b[PVID_N_E];
    out->a2 = shift_2(&m[A_PHI2], c.r2, w);
    out->e2 = shift_2(&m[E_PHI2], c.r2, w);
    out->y2 = shift_2(&b[PVID_N_PHI2], c.r2, w);
    out->a0 = shift_3(&m[A_PHI0], c.r3, w);
    out->e0 = shift_3(&m[E_PHI0], c.r3, w);
    out->y0 = shift_3(&b[PVID_N_PHI0], c.r3, w);
    out->k22 = shift_4(&m[PHI2_PHI2], c.r4, w);
    out->k20 = shift_5(&m[PHI2_PHI0], c.r5, w);
    out->k00 = shift_6(&m[PHI0_PHI0], c.r6, w);
}

/* The same with a row added on the way: each sum is shifted where it has just been formed, in a register. */
PVID_ALWAYS_INLINE void add_and_shift(float w, const float n[], float y, const float high[], float low[],
                                      shifted_sums *out)
{
    shift_coefficients c;
    shift_by(w, &c);
    float k22[7];
    add_phi2_phi2(n, high, low, k22);
    out->k22 = shift_4(k22, c.r4, w);
    float k20[8];
    add_phi2_phi0(n, high, low, k20);
    out->k20 = shift_5(k20, c.r5, w);
    float k00[9];
    add_phi0_phi0(n, high, low, k00);
    out->k00 = shift_6(k00, c.r6, w);
    float q[3];
    add_quadratic(n, high, low, q);
    out->aa = q[0];
    out->ae = q[1];
    out->ee = q[2];
    float l[2];
    add_linear(n, y, high, low, l);
    out->y_a = l[0];
    out->y_e = l[1];
    add_yy_and_weight(y, low);
    float a2[4];
    add_to_phi2(A_PHI2, n[PVID_N_A], n, high, low, a2);
    out->a2 = shift_2(a2, c.r2, w);
    float e2[4];
    add_to_phi2(E_PHI2, n[PVID_N_E], n, high, low, e2);
    out->e2 = shift_2(e2, c.r2, w);
    float y2[4];
    add_to_phi2(B + PVID_N_PHI2, y, n, high, low, y2);
    out->y2 = shift_2(y2, c.r2, w);
    float a0[5];
    add_to_phi0(A_PHI0, n[PVID_N_A], n, high, low, a0);
    out->a0 = shift_3(a0, c.r3, w);
    float e0[5];
    add_to_phi0(E_PHI0, n[PVID_N_E], n, high, low, e0);
    out->e0 = shift_3(e0, c.r3, w);
    float y0[5];
    add_to_phi0(B + PVID_N_PHI0, y, n, high, low, y0);
    out->y0 = shift_3(y0, c.r3, w);
}

/* S, F and the returned number of model.h from the shifted sums. */
PVID_ALWAYS_INLINE float combine(const float p[], const shifted_sums *m, float s[][PVID_MAX_P], float f[])
{
    const float w = p[W];
    const float w2 = w * w;
    const float two_w = 2.0f * w;
    const float d1 = p[D1];
    const float d2 = p[D2];
    const float three_d1 = 3.0f * d1;
    const float four_d2 = 4.0f * d2;

    /* C^T M C with n_w = (A + 2 w E) + 3 d1 (-G^2 phi'') + 4 d2 (-G^3 phi) */
    const float x_2 = m->a2.low + (two_w * m->e2.low);
    const float x_0 = m->a0.low + (two_w * m->e0.low);
    const float x_x = (m->aa + (two_w * m->ae)) + (two_w * (m->ae + (two_w * m->ee)));
    const float n_2 = x_2 + ((three_d1 * m->k22.low) + (four_d2 * m->k20.low));
    const float n_0 = x_0 + ((three_d1 * m->k20.low) + (four_d2 * m->k00.low));
    const float s_ww = x_x + ((three_d1 * (x_2 + n_2)) + (four_d2 * (x_0 + n_0)));
    const float s_w1 = (m->a2.high + (two_w * m->e2.high)) + ((three_d1 * m->k22.mid) + (four_d2 * m->k20.mid));
    const float s_w2 = (m->a0.high + (two_w * m->e0.high)) + ((three_d1 * m->k20.mid) + (four_d2 * m->k00.mid));
    s[W][W] = s_ww;
    s[W][D1] = s_w1;
    s[W][D2] = s_w2;
    s[D1][D1] = m->k22.high;
    s[D1][D2] = m->k20.high;
    s[D2][D2] = m->k00.high;

    /* C^T (b - M theta): N^T theta = Q + d1 n_1 + d2 n_2 with Q = w A + w^2 E */
    const float q_a = (w * m->aa) + (w2 * m->ae);
    const float q_e = (w * m->ae) + (w2 * m->ee);
    const float q_2 = (w * m->a2.low) + (w2 * m->e2.low);
    const float q_0 = (w * m->a0.low) + (w2 * m->e0.low);
    const float q_w = (q_a + (two_w * q_e)) + ((three_d1 * q_2) + (four_d2 * q_0));
    const float q_n1 = (w * m->a2.high) + (w2 * m->e2.high);
    const float q_n2 = (w * m->a0.high) + (w2 * m->e0.high);
    const float y_w = (m->y_a + (two_w * m->y_e)) + ((three_d1 * m->y2.low) + (four_d2 * m->y0.low));
    const float t_1 = q_n1 + ((d1 * m->k22.high) + (d2 * m->k20.high)); /* <n_1 N^T theta> */
    const float t_2 = q_n2 + ((d1 * m->k20.high) + (d2 * m->k00.high));
    f[W] = (y_w - q_w) - ((d1 * s_w1) + (d2 * s_w2));
    f[D1] = m->y2.high - t_1;
    f[D2] = m->y0.high - t_2;

    /* theta^T M theta - 2 theta^T b */
    const float q_q = (w * q_a) + (w2 * q_e);
    const float q_b = (w * m->y_a) + (w2 * m->y_e);
    const float along_1 = (q_n1 + t_1) - (2.0f * m->y2.high);
    const float along_2 = (q_n2 + t_2) - (2.0f * m->y0.high);
    return (q_q - (2.0f * q_b)) + ((d1 * along_1) + (d2 * along_2));
}

float pvid_kapitza_project_f32(const float p[], const float m[], const float b[], float s[][PVID_MAX_P], float f[])
{
    shifted_sums shifted;
    shift_sums(p[W], m, b, &shifted);
    return combine(p, &shifted, s, f);
}

/* restrict: the sums are not the row, which then stays in registers. */
void pvid_kapitza_absorb_f32(const float p[restrict], const float n[restrict], float y, const float high[restrict],
                             float low[restrict], float s[restrict][PVID_MAX_P], float f[restrict])
{
    shifted_sums shifted;
    add_and_shift(p[W], n, y, high, low, &shifted);
    (void)combine(p, &shifted, s, f);
}
