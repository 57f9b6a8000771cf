/* The strong form of Kapitza's pendulum (MATH.md 2): row, theta, C, and its two economies.
 *
 * Products repeat. With A = N_1, E = N_2, the entries 3..6 are -u^k phi'' and 7..11 are -u^k phi,
 * so M holds only the sums of A^2, AE, E^2, of A and E times each of those nine, and of
 * phi''^2 u^k (k <= 6), phi'' phi u^k (k <= 7), phi^2 u^k (k <= 8): 45 of 66.
 *
 * C is a shift. N^T C = (n_w, n_1, n_2) with G = u + w and n_1 = -G^3 phi'', n_2 = -G^4 phi, so each
 * entry of C^T M C is a few sums of the kind <a b G^r> = sum_k binom(r, k) w^(r-k) <a b u^k>.
 */
#include "pvid/kapitza.h"

#include <stddef.h>

#include "unroll.h"

enum { W = PVID_KAPITZA_W, D1 = PVID_KAPITZA_D1, D2 = PVID_KAPITZA_D2 };

/* Places among the moments; a sequence stands by descending powers of u, as in N. */
enum {
    AA = 0,
    AE = 1,
    EE = 2,
    A_PHI2 = 3,     /* 4: A (-u^k phi'') */
    E_PHI2 = 7,     /* 4 */
    A_PHI0 = 11,    /* 5: A (-u^k phi) */
    E_PHI0 = 16,    /* 5 */
    PHI2_PHI2 = 21, /* 7 */
    PHI2_PHI0 = 28, /* 8 */
    PHI0_PHI0 = 36, /* 9 */
    MOMENTS = 45,
    B = 45,         /* 11: N Y */
    YY = 56,
    WEIGHT = 57
};

/* Places in N and theta; the powers of u descend there, as in the paper. */
enum { N_A = 0, N_E = 1, N_PHI2 = 2, N_PHI0 = 6 };

void pvid_kapitza_strong_row_f32(const float phi[5], const float u[3], float *y, float n[PVID_KAPITZA_STRONG_THETA])
{
    const float u0 = u[0];
    const float u1 = u[1];
    const float u2 = u[2];
    const float two_u0 = 2.0f * u0;
    const float two_u1 = 2.0f * u1;
    *y = (((u0 * u0) * phi[4]) - ((two_u0 * u1) * phi[3])) + (((two_u1 * u1) - (u0 * u2)) * phi[2]);
    n[N_A] = ((two_u1 * phi[3]) - (two_u0 * phi[4])) + (u2 * phi[2]);
    n[N_E] = -phi[4];
    n[5] = -phi[2];
    n[4] = u0 * n[5];
    n[3] = u0 * n[4];
    n[2] = u0 * n[3];
    n[10] = -phi[0];
    n[9] = u0 * n[10];
    n[8] = u0 * n[9];
    n[7] = u0 * n[8];
    n[6] = u0 * n[7];
}

static void theta_of(const float p[], float theta[])
{
    const float w = p[W];
    const float w2 = w * w;
    const float w3 = w2 * w;
    theta[0] = w;
    theta[1] = w2;
    theta[2] = p[D1];
    theta[3] = 3.0f * (p[D1] * w);
    theta[4] = 3.0f * (p[D1] * w2);
    theta[5] = p[D1] * w3;
    theta[6] = p[D2];
    theta[7] = 4.0f * (p[D2] * w);
    theta[8] = 6.0f * (p[D2] * w2);
    theta[9] = 4.0f * (p[D2] * w3);
    theta[10] = p[D2] * (w3 * w);
}

static const uint8_t c_row[18] = {0, 1, 3, 4, 5, 7, 8, 9, 10, 2, 3, 4, 5, 6, 7, 8, 9, 10};
static const uint8_t c_column[18] = {W, W, W, W, W, W, W, W, W, D1, D1, D1, D1, D2, D2, D2, D2, D2};

static void jacobian_of(const float p[], float c[])
{
    const float w = p[W];
    const float w2 = w * w;
    const float w3 = w2 * w;
    c[0] = 1.0f;
    c[1] = 2.0f * w;
    c[2] = 3.0f * p[D1];
    c[3] = 6.0f * (p[D1] * w);
    c[4] = 3.0f * (p[D1] * w2);
    c[5] = 4.0f * p[D2];
    c[6] = 12.0f * (p[D2] * w);
    c[7] = 12.0f * (p[D2] * w2);
    c[8] = 4.0f * (p[D2] * w3);
    c[9] = 1.0f;
    c[10] = 3.0f * w;
    c[11] = 3.0f * w2;
    c[12] = w3;
    c[13] = 1.0f;
    c[14] = 4.0f * w;
    c[15] = 6.0f * w2;
    c[16] = 4.0f * w3;
    c[17] = w3 * w;
}

/* A stretch of `count` sums, a constant wherever this is called: low[i] += a x[i]. */
static inline void stretch(size_t at, float a, const float *restrict x, size_t count, const float *restrict high,
                           float *restrict low, float *restrict sums)
{
    PVID_UNROLL
    for (size_t i = 0; i < count; i++) {
        low[at + i] += a * x[i];
        sums[at + i] = high[at + i] + low[at + i];
    }
}

static void accumulate_of(const float n[], float y, const float high[], float low[], float sums[])
{
    const float one = 1.0f;
    const float a = n[N_A];
    const float e = n[N_E];
    const float *phi2 = &n[N_PHI2]; /* u^3 .. u^0 */
    const float *phi0 = &n[N_PHI0]; /* u^4 .. u^0 */
    stretch(AA, a, n, 2, high, low, sums);
    stretch(EE, e, &n[N_E], 1, high, low, sums);
    stretch(A_PHI2, a, phi2, 4, high, low, sums);
    stretch(E_PHI2, e, phi2, 4, high, low, sums);
    stretch(A_PHI0, a, phi0, 5, high, low, sums);
    stretch(E_PHI0, e, phi0, 5, high, low, sums);
    stretch(PHI2_PHI2, phi2[0], phi2, 4, high, low, sums);         /* u^6 .. u^3 */
    stretch(PHI2_PHI2 + 4, phi2[3], &phi2[1], 3, high, low, sums); /* u^2 .. u^0 */
    stretch(PHI2_PHI0, phi0[0], phi2, 4, high, low, sums);         /* u^7 .. u^4 */
    stretch(PHI2_PHI0 + 4, phi2[3], &phi0[1], 4, high, low, sums); /* u^3 .. u^0 */
    stretch(PHI0_PHI0, phi0[0], phi0, 5, high, low, sums);         /* u^8 .. u^4 */
    stretch(PHI0_PHI0 + 5, phi0[4], &phi0[1], 4, high, low, sums); /* u^3 .. u^0 */
    stretch(B, y, n, PVID_KAPITZA_STRONG_THETA, high, low, sums);
    stretch(YY, y, &y, 1, high, low, sums);
    stretch(WEIGHT, one, &one, 1, high, low, sums);
}

/* binom(r, i) w^i for i = 1..r, at [i - 1]; r = 2..6 */
typedef struct {
    float r2[2];
    float r3[3];
    float r4[4];
    float r5[5];
    float r6[6];
} shift_coefficients;

static inline void shift_by(float w, shift_coefficients *c)
{
    const float w2 = w * w;
    const float w3 = w2 * w;
    const float w4 = w2 * w2;
    const float w5 = w4 * w;
    c->r2[0] = 2.0f * w;
    c->r2[1] = w2;
    c->r3[0] = 3.0f * w;
    c->r3[1] = 3.0f * w2;
    c->r3[2] = w3;
    c->r4[0] = 4.0f * w;
    c->r4[1] = 6.0f * w2;
    c->r4[2] = 4.0f * w3;
    c->r4[3] = w4;
    c->r5[0] = 5.0f * w;
    c->r5[1] = 10.0f * w2;
    c->r5[2] = 10.0f * w3;
    c->r5[3] = 5.0f * w4;
    c->r5[4] = w5;
    c->r6[0] = 6.0f * w;
    c->r6[1] = 15.0f * w2;
    c->r6[2] = 20.0f * w3;
    c->r6[3] = 15.0f * w4;
    c->r6[4] = 6.0f * w5;
    c->r6[5] = w3 * w3;
}

/* <a b G^r> and <a b G^(r+1)> from m[i] = <a b u^(r+1-i)>, i = 0..r+1, and the coefficients c of r. */
typedef struct {
    float low;
    float high;
} shifted_pair;

static inline shifted_pair shift_pair(const float m[], const float c[], size_t r, float w)
{
    float s1 = m[0];
    float s0 = m[1];
    PVID_UNROLL
    for (size_t i = 1; i <= r; i++) {
        s1 += c[i - 1u] * m[i];
        s0 += c[i - 1u] * m[i + 1];
    }
    const shifted_pair pair = {s0, s1 + (w * s0)};
    return pair;
}

/* <a b G^r>, <a b G^(r+1)>, <a b G^(r+2)> from m[i] = <a b u^(r+2-i)>, i = 0..r+2. */
typedef struct {
    float low;
    float mid;
    float high;
} shifted_triple;

static inline shifted_triple shift_triple(const float m[], const float c[], size_t r, float w)
{
    float s2 = m[0];
    float s1 = m[1];
    float s0 = m[2];
    PVID_UNROLL
    for (size_t i = 1; i <= r; i++) {
        s2 += c[i - 1u] * m[i];
        s1 += c[i - 1u] * m[i + 1];
        s0 += c[i - 1u] * m[i + 2];
    }
    const float mid = s1 + (w * s0);
    const shifted_triple triple = {s0, mid, (s2 + (w * s1)) + (w * mid)};
    return triple;
}

static float project_of(const float p[], const float m[], const float b[], float s[][PVID_MAX_P], float f[])
{
    const float w = p[W];
    const float w2 = w * w;
    const float two_w = 2.0f * w;
    const float d1 = p[D1];
    const float d2 = p[D2];
    const float three_d1 = 3.0f * d1;
    const float four_d2 = 4.0f * d2;
    shift_coefficients c;
    shift_by(w, &c);
    const shifted_pair a2 = shift_pair(&m[A_PHI2], c.r2, 2, w); /* G^2, G^3 */
    const shifted_pair e2 = shift_pair(&m[E_PHI2], c.r2, 2, w);
    const shifted_pair y2 = shift_pair(&b[N_PHI2], c.r2, 2, w);
    const shifted_pair a0 = shift_pair(&m[A_PHI0], c.r3, 3, w); /* G^3, G^4 */
    const shifted_pair e0 = shift_pair(&m[E_PHI0], c.r3, 3, w);
    const shifted_pair y0 = shift_pair(&b[N_PHI0], c.r3, 3, w);
    const shifted_triple k22 = shift_triple(&m[PHI2_PHI2], c.r4, 4, w); /* G^4, G^5, G^6 */
    const shifted_triple k20 = shift_triple(&m[PHI2_PHI0], c.r5, 5, w); /* G^5, G^6, G^7 */
    const shifted_triple k00 = shift_triple(&m[PHI0_PHI0], c.r6, 6, w); /* G^6, G^7, G^8 */

    /* C^T M C with n_w = (A + 2 w E) + 3 d1 (-G^2 phi'') + 4 d2 (-G^3 phi) */
    const float x_2 = a2.low + (two_w * e2.low);
    const float x_0 = a0.low + (two_w * e0.low);
    const float x_x = (m[AA] + (two_w * m[AE])) + (two_w * (m[AE] + (two_w * m[EE])));
    const float n_2 = x_2 + ((three_d1 * k22.low) + (four_d2 * k20.low));
    const float n_0 = x_0 + ((three_d1 * k20.low) + (four_d2 * k00.low));
    const float s_ww = x_x + ((three_d1 * (x_2 + n_2)) + (four_d2 * (x_0 + n_0)));
    const float s_w1 = (a2.high + (two_w * e2.high)) + ((three_d1 * k22.mid) + (four_d2 * k20.mid));
    const float s_w2 = (a0.high + (two_w * e0.high)) + ((three_d1 * k20.mid) + (four_d2 * k00.mid));
    s[W][W] = s_ww;
    s[W][D1] = s_w1;
    s[W][D2] = s_w2;
    s[D1][D1] = k22.high;
    s[D1][D2] = k20.high;
    s[D2][D2] = k00.high;

    /* C^T (b - M theta): N^T theta = Q + d1 n_1 + d2 n_2 with Q = w A + w^2 E */
    const float q_a = (w * m[AA]) + (w2 * m[AE]);
    const float q_e = (w * m[AE]) + (w2 * m[EE]);
    const float q_2 = (w * a2.low) + (w2 * e2.low);
    const float q_0 = (w * a0.low) + (w2 * e0.low);
    const float q_w = (q_a + (two_w * q_e)) + ((three_d1 * q_2) + (four_d2 * q_0));
    const float q_n1 = (w * a2.high) + (w2 * e2.high);
    const float q_n2 = (w * a0.high) + (w2 * e0.high);
    const float y_w = (b[N_A] + (two_w * b[N_E])) + ((three_d1 * y2.low) + (four_d2 * y0.low));
    const float t_1 = q_n1 + ((d1 * k22.high) + (d2 * k20.high)); /* <n_1 N^T theta> */
    const float t_2 = q_n2 + ((d1 * k20.high) + (d2 * k00.high));
    f[W] = (y_w - q_w) - ((d1 * s_w1) + (d2 * s_w2));
    f[D1] = y2.high - t_1;
    f[D2] = y0.high - t_2;

    /* theta^T M theta - 2 theta^T b */
    const float q_q = (w * q_a) + (w2 * q_e);
    const float q_b = (w * b[N_A]) + (w2 * b[N_E]);
    const float along_1 = (q_n1 + t_1) - (2.0f * y2.high);
    const float along_2 = (q_n2 + t_2) - (2.0f * y0.high);
    return (q_q - (2.0f * q_b)) + ((d1 * along_1) + (d2 * along_2));
}

static float innovate_of(const float p[], const float n[], float y, float gradient[])
{
    const float w = p[W];
    const float d1 = p[D1];
    const float d2 = p[D2];
    const float two_w = 2.0f * w;
    const float w2 = w * w;
    /* -G^2 phi'', -G^3 phi, and from them n_1 = -G^3 phi'', n_2 = -G^4 phi: G x = u x + w x */
    const float g2_low = (n[3] + (two_w * n[4])) + (w2 * n[5]);
    const float g2_high = (n[2] + (two_w * n[3])) + (w2 * n[4]);
    const float g3_low = ((n[7] + (w * n[8])) + (two_w * (n[8] + (w * n[9])))) + (w2 * (n[9] + (w * n[10])));
    const float g3_high = ((n[6] + (w * n[7])) + (two_w * (n[7] + (w * n[8])))) + (w2 * (n[8] + (w * n[9])));
    const float n_1 = g2_high + (w * g2_low);
    const float n_2 = g3_high + (w * g3_low);
    gradient[W] = (n[N_A] + (two_w * n[N_E])) + (((3.0f * d1) * g2_low) + ((4.0f * d2) * g3_low));
    gradient[D1] = n_1;
    gradient[D2] = n_2;
    return (y - (w * (n[N_A] + (w * n[N_E])))) - ((d1 * n_1) + (d2 * n_2));
}

const pvid_model_f32 pvid_kapitza_strong_f32 = {
    .n_theta = PVID_KAPITZA_STRONG_THETA,
    .n_p = PVID_KAPITZA_P,
    .n_moments = MOMENTS,
    .n_c = 18,
    .positive = 7u,
    .c_row = c_row,
    .c_column = c_column,
    .theta = theta_of,
    .jacobian = jacobian_of,
    .accumulate = accumulate_of,
    .project = project_of,
    .innovate = innovate_of,
};
