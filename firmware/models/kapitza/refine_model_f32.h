/* The pendulum's full equations for the refinement (pvid/refine_shape.h), in float32.
 *
 * With lam = l2/l1, sig = (rho2/l2)^2, f = a2 - a1, vr = v2 - v1, G = w + u and A = lam a2'' they are divided such that
 * nothing is small:
 *
 *   b1 = lam sin f v2^2 - G sin a1 - k1 v1 + k2 vr        a1'' = ((1 + sig) b1 - cos f b2) / (sig + sin^2 f)
 *   b2 = -sin f v1^2 - G sin a2 - (k2 / lam) vr              A = (b2 - cos f b1) / (sig + sin^2 f)
 *
 * The columns of the motion are those of log w, log lam, log sig, k1, k2; the chart turns them to log w, log d1, log
 * d2.
 */
#ifndef PVID_REFINE_MODEL_F32_H
#define PVID_REFINE_MODEL_F32_H

#include <stdbool.h>
#include <stdint.h>

#include "number/sincos_f32.h"
#include "number/unroll.h"
#include "pvid/refine_shape.h"

/* Steps of an entry of r: 1: of its logarithm, 0: of itself. */
static const uint8_t pvid_refine_logarithmic[PVID_REFINE_PARAMETERS] = {1, 1, 1, 0, 0, 0, 0};

#define PVID_REFINE_HAS_CHART 1

enum { REFINE_W, REFINE_LAM, REFINE_SIG, REFINE_K1, REFINE_K2, REFINE_ONE_SIG, REFINE_INVERSE_LAM, REFINE_K2_LAM };

/* l2/l1 d2: positive in the physical region. */
static inline float refine_ratio(const float r[])
{
    return (r[1] - r[2]) - 1.0f;
}

static inline bool pvid_refine_region(const float r[])
{
    return refine_ratio(r) > 0.02f;
}

static inline void pvid_refine_constants(const float r[], float m[])
{
    const float ratio = refine_ratio(r);
    m[REFINE_W] = r[0];
    m[REFINE_SIG] = 1.0f / ratio;
    m[REFINE_INVERSE_LAM] = r[2] / ratio;
    m[REFINE_LAM] = 1.0f / m[REFINE_INVERSE_LAM];
    m[REFINE_ONE_SIG] = 1.0f + m[REFINE_SIG];
    m[REFINE_K1] = r[3];
    m[REFINE_K2] = r[4];
    m[REFINE_K2_LAM] = r[4] * m[REFINE_INVERSE_LAM];
}

/* What accelerations and derivatives share. */
typedef struct {
    float gravity;
    float vr;
    float s1;
    float c1;
    float s2;
    float c2;
    float sf;
    float cf;
    float lv;
    float vv;
    float i11; /* and i12, i22: of the inverse of the matrix of inertia */
    float i12;
    float i22;
    float a1;
    float big;
    float a2;
} refine_common;

PVID_ALWAYS_INLINE refine_common refine_accelerations(const float m[], const float q[], const float v[],
                                                      const float u[])
{
    refine_common x;
    x.vr = v[1] - v[0];
    x.gravity = m[REFINE_W] + u[0];
    pvid_sincos_f32(q[0], &x.s1, &x.c1);
    pvid_sincos_f32(q[1], &x.s2, &x.c2);
    x.sf = (x.s2 * x.c1) - (x.c2 * x.s1);
    x.cf = (x.c2 * x.c1) + (x.s2 * x.s1);
    x.lv = (m[REFINE_LAM] * v[1]) * v[1];
    x.vv = v[0] * v[0];
    const float b1 = (((x.sf * x.lv) - (x.gravity * x.s1)) + (m[REFINE_K2] * x.vr)) - (m[REFINE_K1] * v[0]);
    const float b2 = (-(x.sf * x.vv) - (x.gravity * x.s2)) - (m[REFINE_K2_LAM] * x.vr);
    x.i22 = 1.0f / (m[REFINE_SIG] + (x.sf * x.sf));
    x.i11 = m[REFINE_ONE_SIG] * x.i22;
    x.i12 = -(x.cf * x.i22);
    x.a1 = (x.i11 * b1) + (x.i12 * b2);
    x.big = (x.i12 * b1) + (x.i22 * b2);
    x.a2 = x.big * m[REFINE_INVERSE_LAM];
    return x;
}

/* a = q'' */
PVID_ALWAYS_INLINE void pvid_refine_motion(const float m[], const float q[], const float v[], const float u[],
                                           float a[])
{
    const refine_common x = refine_accelerations(m, q, v, u);
    a[0] = x.a1;
    a[1] = x.a2;
}

/* a, K = da/dq, D = da/dv and U = da/du, all [row][column], B = da/dr by moving parameter: B[parameter][row]; that of
 * the skew is not written. */
PVID_ALWAYS_INLINE void pvid_refine_jacobian(const float m[], const float q[], const float v[], const float u[],
                                             float a[], float K[], float D[], float U[], float B[])
{
    const refine_common x = refine_accelerations(m, q, v, u);
    a[0] = x.a1;
    a[1] = x.a2;
    const float j12 = x.i12 * m[REFINE_INVERSE_LAM];
    const float j22 = x.i22 * m[REFINE_INVERSE_LAM];
    const float f1 = (x.cf * x.lv) + (x.sf * x.big);
    const float f2 = (x.sf * x.a1) - (x.cf * x.vv);
    const float e11 = -f1 - (x.gravity * x.c1);
    const float e22 = f2 - (x.gravity * x.c2);
    K[0] = (x.i11 * e11) - (x.i12 * f2);
    K[1] = (x.i11 * f1) + (x.i12 * e22);
    K[2] = (j12 * e11) - (j22 * f2);
    K[3] = (j12 * f1) + (j22 * e22);
    const float g11 = -(m[REFINE_K1] + m[REFINE_K2]);
    const float g12 = ((2.0f * m[REFINE_LAM]) * (x.sf * v[1])) + m[REFINE_K2];
    const float g21 = m[REFINE_K2_LAM] - (2.0f * (x.sf * v[0]));
    D[0] = (x.i11 * g11) + (x.i12 * g21);
    D[1] = (x.i11 * g12) - (x.i12 * m[REFINE_K2_LAM]);
    D[2] = (j12 * g11) + (j22 * g21);
    D[3] = (j12 * g12) - (j22 * m[REFINE_K2_LAM]);
    U[0] = -((x.i11 * x.s1) + (x.i12 * x.s2));
    U[1] = -((j12 * x.s1) + (j22 * x.s2));
    B[0] = m[REFINE_W] * U[0]; /* log w */
    B[1] = m[REFINE_W] * U[1];
    const float l1 = x.sf * x.lv; /* log lam */
    const float l2 = m[REFINE_K2_LAM] * x.vr;
    B[2] = (x.i11 * l1) + (x.i12 * l2);
    B[3] = ((j12 * l1) + (j22 * l2)) - x.a2;
    const float g = -(m[REFINE_SIG] * x.big); /* log sig */
    B[4] = x.i12 * g;
    B[5] = j22 * g;
    B[6] = -(x.i11 * v[0]); /* k1 */
    B[7] = -(j12 * v[0]);
    const float s = -(x.vr * m[REFINE_INVERSE_LAM]); /* k2 */
    B[8] = (x.i11 * x.vr) + (x.i12 * s);
    B[9] = (j12 * x.vr) + (j22 * s);
}

/* z */
static inline void pvid_refine_output(const float m[], const float r[], const float q[], const float v[],
                                      const float u[], float z[])
{
    (void)m;
    (void)u;
    (void)v;
    z[0] = (q[1] - q[0]) + r[6];
}

/* dz/dq, dz/dv (only with PVID_REFINE_OUTPUT_RATES) and dz/dr of the entries behind the moving ones. */
static inline void pvid_refine_output_jacobian(const float m[], const float r[], const float q[], const float v[],
                                               const float u[], float Zq[], float Zv[], float Zr[])
{
    (void)m;
    (void)r;
    (void)q;
    (void)u;
    (void)v;
    (void)Zv;
    Zq[0] = -1.0f;
    Zq[1] = 1.0f;
    Zr[0] = 1.0f;
}

/* Turns derivatives by the motion's columns to those by the steps of r:
 * d log lam = al dlog d1 - (be + 1) dlog d2,  d log sig = be dlog d2 - al dlog d1,  al, be = d1, d2 over d1 - d2 - 1.
 */
static inline void pvid_refine_chart(const float r[], float row[])
{
    const float inverse = 1.0f / refine_ratio(r);
    const float of_lam = row[1];
    const float of_sig = row[2];
    row[1] = (r[1] * inverse) * (of_lam - of_sig);
    row[2] = ((r[2] * inverse) * (of_sig - of_lam)) - of_lam;
}

/* r of an estimate of the weak form, p = (w, d1, d2, c); entries that it does not have are 0. */
static inline void pvid_refine_from_p(const float p[], float r[])
{
    r[0] = p[0];
    r[1] = p[1];
    r[2] = p[2];
    r[3] = 0.0f;
    r[4] = 0.0f;
    r[5] = 0.0f;
    r[6] = p[3];
}

/* Entries of p by that of r, for the comparison of the two estimates. */
static const uint8_t pvid_refine_place_of_p[PVID_REFINE_P] = {0, 1, 2, 6};

#endif
