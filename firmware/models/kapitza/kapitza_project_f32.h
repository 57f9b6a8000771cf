/* C^T M C and C^T (B - M theta) from the sums: C is a shift of u to G = u + w,
 *
 *   <a b G^r> = sum_i binom(r, i) w^i <a b u^(r-i)>
 *
 * for neighbouring r at once. Private to the core, inlined into its one caller, so that no sum leaves the registers. */
#ifndef PVID_KAPITZA_PROJECT_F32_H
#define PVID_KAPITZA_PROJECT_F32_H

#include <stddef.h>

#include "kapitza_places.h"
#include "number/unroll.h"
#include "pvid/detail/strong_state.h"

static inline float pvid_kapitza_sum_f32(const pvid_strong_sums_f32 *self, size_t i)
{
    return self->high[i] + self->low[i];
}

/* m[n] = the values of the n sums at `first`. */
PVID_ALWAYS_INLINE void pvid_kapitza_family_f32(const pvid_strong_sums_f32 *self, size_t first, size_t n, float m[])
{
    PVID_UNROLL
    for (size_t i = 0; i < n; i++) {
        m[i] = pvid_kapitza_sum_f32(self, first + i);
    }
}

/* <a b G^r> and <a b G^(r+1)>. */
typedef struct {
    float low;
    float high;
} pvid_shifted_pair;

/* <a b G^r>, <a b G^(r+1)>, <a b G^(r+2)>. */
typedef struct {
    float low;
    float mid;
    float high;
} pvid_shifted_triple;

/* r = 2: A, E or Y times -G^2 phi'' and -G^3 phi''. */
PVID_ALWAYS_INLINE pvid_shifted_pair pvid_kapitza_pair_2_f32(const pvid_strong_sums_f32 *self, size_t first, float w)
{
    float m[4];
    pvid_kapitza_family_f32(self, first, 4, m);
    const float c1 = 2.0f * w;
    const float c2 = w * w;
    const float low = (m[1] + (c1 * m[2])) + (c2 * m[3]);
    const pvid_shifted_pair pair = {low, ((m[0] + (c1 * m[1])) + (c2 * m[2])) + (w * low)};
    return pair;
}

/* r = 3: A, E or Y times -G^3 phi and -G^4 phi. */
PVID_ALWAYS_INLINE pvid_shifted_pair pvid_kapitza_pair_0_f32(const pvid_strong_sums_f32 *self, size_t first, float w)
{
    float m[5];
    pvid_kapitza_family_f32(self, first, 5, m);
    const float w2 = w * w;
    const float c1 = 3.0f * w;
    const float c2 = 3.0f * w2;
    const float c3 = w2 * w;
    const float low = ((m[1] + (c1 * m[2])) + (c2 * m[3])) + (c3 * m[4]);
    const pvid_shifted_pair pair = {low, (((m[0] + (c1 * m[1])) + (c2 * m[2])) + (c3 * m[3])) + (w * low)};
    return pair;
}

/* The triple with the coefficients c[i] = binom(n, i + 1) w^(i + 1) of its lowest power, n = 4 .. 6, from the n + 3
 * sums at `first`. */
PVID_ALWAYS_INLINE pvid_shifted_triple pvid_kapitza_triple_f32(const pvid_strong_sums_f32 *self, size_t first,
                                                               const float c[], size_t n, float w)
{
    float s2 = pvid_kapitza_sum_f32(self, first);
    float s1 = pvid_kapitza_sum_f32(self, first + 1u);
    float s0 = pvid_kapitza_sum_f32(self, first + 2u);
    float m1 = s1;
    float m2 = s0;
    PVID_UNROLL
    for (size_t i = 0; i < n; i++) {
        const float m3 = pvid_kapitza_sum_f32(self, first + i + 3u);
        s2 += c[i] * m1;
        s1 += c[i] * m2;
        s0 += c[i] * m3;
        m1 = m2;
        m2 = m3;
    }
    const float mid = s1 + (w * s0);
    const pvid_shifted_triple triple = {s0, mid, (s2 + (w * s1)) + (w * mid)};
    return triple;
}

/* s = C^T M C, upper triangle by rows, and force = C^T (B - M theta) at p. */
PVID_ALWAYS_INLINE void pvid_kapitza_project_f32(const pvid_strong_sums_f32 *self, const float p[3], float s[6],
                                                 float force[3])
{
    const float w = p[0];
    const float d1 = p[1];
    const float d2 = p[2];
    const float w2 = w * w;
    const float two_w = 2.0f * w;
    const float three_d1 = 3.0f * d1;
    const float four_d2 = 4.0f * d2;
    const float w3 = w2 * w;
    const float w4 = w2 * w2;
    const float of_k22[4] = {4.0f * w, 6.0f * w2, 4.0f * w3, w4};                  /* phi''^2 G^4 .. G^6 */
    const float of_k20[5] = {5.0f * w, 10.0f * w2, 10.0f * w3, 5.0f * w4, w4 * w}; /* phi'' phi G^5 .. */
    const float of_k00[6] = {6.0f * w, 15.0f * w2, 20.0f * w3, 15.0f * w4, 6.0f * (w4 * w), w3 * w3}; /* phi^2 G^6 .. */
    const pvid_shifted_triple k22 = pvid_kapitza_triple_f32(self, PVID_SUM_K22, of_k22, 4, w);
    const pvid_shifted_triple k20 = pvid_kapitza_triple_f32(self, PVID_SUM_K20, of_k20, 5, w);
    const pvid_shifted_triple k00 = pvid_kapitza_triple_f32(self, PVID_SUM_K00, of_k00, 6, w);
    const pvid_shifted_pair a2 = pvid_kapitza_pair_2_f32(self, PVID_SUM_A2, w);
    const pvid_shifted_pair e2 = pvid_kapitza_pair_2_f32(self, PVID_SUM_E2, w);
    const pvid_shifted_pair a0 = pvid_kapitza_pair_0_f32(self, PVID_SUM_A0, w);
    const pvid_shifted_pair e0 = pvid_kapitza_pair_0_f32(self, PVID_SUM_E0, w);
    const float aa = pvid_kapitza_sum_f32(self, PVID_SUM_AA);
    const float ae = pvid_kapitza_sum_f32(self, PVID_SUM_AE);
    const float ee = pvid_kapitza_sum_f32(self, PVID_SUM_EE);

    /* C^T M C with n_w = (A + 2 w E) + 3 d1 (-G^2 phi'') + 4 d2 (-G^3 phi) */
    const float x_2 = a2.low + (two_w * e2.low);
    const float x_0 = a0.low + (two_w * e0.low);
    const float x_x = (aa + (two_w * ae)) + (two_w * (ae + (two_w * ee)));
    const float n_2 = x_2 + ((three_d1 * k22.low) + (four_d2 * k20.low));
    const float n_0 = x_0 + ((three_d1 * k20.low) + (four_d2 * k00.low));
    s[0] = x_x + ((three_d1 * (x_2 + n_2)) + (four_d2 * (x_0 + n_0)));
    s[1] = (a2.high + (two_w * e2.high)) + ((three_d1 * k22.mid) + (four_d2 * k20.mid));
    s[2] = (a0.high + (two_w * e0.high)) + ((three_d1 * k20.mid) + (four_d2 * k00.mid));
    s[3] = k22.high;
    s[4] = k20.high;
    s[5] = k00.high;

    /* C^T (B - M theta): N^T theta = Q + d1 n_1 + d2 n_2 with Q = w A + w^2 E */
    const pvid_shifted_pair y2 = pvid_kapitza_pair_2_f32(self, PVID_SUM_Y2, w);
    const pvid_shifted_pair y0 = pvid_kapitza_pair_0_f32(self, PVID_SUM_Y0, w);
    const float ya = pvid_kapitza_sum_f32(self, PVID_SUM_YA);
    const float ye = pvid_kapitza_sum_f32(self, PVID_SUM_YE);
    const float q_a = (w * aa) + (w2 * ae);
    const float q_e = (w * ae) + (w2 * ee);
    const float q_2 = (w * a2.low) + (w2 * e2.low);
    const float q_0 = (w * a0.low) + (w2 * e0.low);
    const float q_w = (q_a + (two_w * q_e)) + ((three_d1 * q_2) + (four_d2 * q_0));
    const float y_w = (ya + (two_w * ye)) + ((three_d1 * y2.low) + (four_d2 * y0.low));
    const float r_1 = y2.high - ((w * a2.high) + (w2 * e2.high)); /* <n_1 (Y - Q)> */
    const float r_2 = y0.high - ((w * a0.high) + (w2 * e0.high));
    force[0] = (y_w - q_w) - ((d1 * s[1]) + (d2 * s[2]));
    force[1] = r_1 - ((d1 * s[3]) + (d2 * s[4]));
    force[2] = r_2 - ((d1 * s[4]) + (d2 * s[5]));
}

#endif
