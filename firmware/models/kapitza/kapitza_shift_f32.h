/* Sums of powers of G = u + w from sums of powers of u. Private to the core, inlined.
 *
 *   <a b G^r> = sum_i binom(r, i) w^i <a b u^(r-i)>
 *
 * for neighbouring r at once; written out without loops, so that no sum leaves the registers. */
#ifndef PVID_KAPITZA_SHIFT_F32_H
#define PVID_KAPITZA_SHIFT_F32_H

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

static inline shifted_pair pair_of(float s0, float s1, float w)
{
    const shifted_pair pair = {s0, s1 + (w * s0)};
    return pair;
}

static inline shifted_pair shift_2(const float m[4], const float c[2], float w)
{
    return pair_of((m[1] + (c[0] * m[2])) + (c[1] * m[3]), (m[0] + (c[0] * m[1])) + (c[1] * m[2]), w);
}

static inline shifted_pair shift_3(const float m[5], const float c[3], float w)
{
    return pair_of(((m[1] + (c[0] * m[2])) + (c[1] * m[3])) + (c[2] * m[4]),
                   ((m[0] + (c[0] * m[1])) + (c[1] * m[2])) + (c[2] * m[3]), w);
}

/* <a b G^r>, <a b G^(r+1)>, <a b G^(r+2)> from m[i] = <a b u^(r+2-i)>, i = 0..r+2. */
typedef struct {
    float low;
    float mid;
    float high;
} shifted_triple;

static inline shifted_triple triple_of(float s0, float s1, float s2, float w)
{
    const float mid = s1 + (w * s0);
    const shifted_triple triple = {s0, mid, (s2 + (w * s1)) + (w * mid)};
    return triple;
}

/* m[0] + sum of c[i] m[i + 1], for r = 4, 5, 6. */
static inline float along_4(const float m[5], const float c[4])
{
    return (((m[0] + (c[0] * m[1])) + (c[1] * m[2])) + (c[2] * m[3])) + (c[3] * m[4]);
}

static inline float along_5(const float m[6], const float c[5])
{
    return along_4(m, c) + (c[4] * m[5]);
}

static inline float along_6(const float m[7], const float c[6])
{
    return along_5(m, c) + (c[5] * m[6]);
}

static inline shifted_triple shift_4(const float m[7], const float c[4], float w)
{
    return triple_of(along_4(&m[2], c), along_4(&m[1], c), along_4(m, c), w);
}

static inline shifted_triple shift_5(const float m[8], const float c[5], float w)
{
    return triple_of(along_5(&m[2], c), along_5(&m[1], c), along_5(m, c), w);
}

static inline shifted_triple shift_6(const float m[9], const float c[6], float w)
{
    return triple_of(along_6(&m[2], c), along_6(&m[1], c), along_6(m, c), w);
}

#endif
