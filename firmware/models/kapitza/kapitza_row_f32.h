/* The row of the strong form (theory.md 2), by its factors: N_1 = A, N_2 = E, the others are powers of u times -phi''
 * or -phi. Private to the core, inlined: derivatives that it does not use are not computed. */
#ifndef PVID_KAPITZA_ROW_F32_H
#define PVID_KAPITZA_ROW_F32_H

#include "pvid/detail/strong_state.h"

/* From phi, phi'', phi''', phi'''' and u, u', u''. */
static inline void pvid_kapitza_row_f32(const float phi[5], const float u[3], pvid_strong_row_f32 *row)
{
    const float two_u0 = 2.0f * u[0];
    const float two_u1 = 2.0f * u[1];
    row->x[PVID_ROW_Y] =
        (((u[0] * u[0]) * phi[4]) - ((two_u0 * u[1]) * phi[3])) + (((two_u1 * u[1]) - (u[0] * u[2])) * phi[2]);
    row->x[PVID_ROW_A] = ((two_u1 * phi[3]) - (two_u0 * phi[4])) + (u[2] * phi[2]);
    row->x[PVID_ROW_E] = -phi[4];
    row->f2 = -phi[2];
    row->f0 = -phi[0];
    row->u = u[0];
}

/* The residual of a row at p = (w, d1, d2) and its gradient C^T N = (n_w, n_1, n_2), by G = u + w:
 * n_1 = -G^3 phi'', n_2 = -G^4 phi. */
static inline float pvid_kapitza_innovate_f32(const float p[3], const pvid_strong_row_f32 *row, float gradient[3])
{
    const float w = p[0];
    const float g = row->u + w;
    const float g2 = g * g;
    const float g2_f2 = g2 * row->f2;
    const float g3_f0 = g * (g2 * row->f0);
    const float n_1 = g * g2_f2;
    const float n_2 = g * g3_f0;
    gradient[0] =
        (row->x[PVID_ROW_A] + ((w + w) * row->x[PVID_ROW_E])) + (((3.0f * p[1]) * g2_f2) + ((4.0f * p[2]) * g3_f0));
    gradient[1] = n_1;
    gradient[2] = n_2;
    return (row->x[PVID_ROW_Y] - (w * (row->x[PVID_ROW_A] + (w * row->x[PVID_ROW_E])))) - ((p[1] * n_1) + (p[2] * n_2));
}

/* s += g g^T, upper triangle by rows. */
static inline void pvid_kapitza_add_squares_f32(const float g[3], float s[6])
{
    s[0] += g[0] * g[0];
    s[1] += g[0] * g[1];
    s[2] += g[0] * g[2];
    s[3] += g[1] * g[1];
    s[4] += g[1] * g[2];
    s[5] += g[2] * g[2];
}

/* force += g e */
static inline void pvid_kapitza_add_products_f32(const float g[3], float e, float force[3])
{
    force[0] += g[0] * e;
    force[1] += g[1] * e;
    force[2] += g[2] * e;
}

/* Sum of squares of what bounds every entry of the row: Y, A, E and the highest and lowest powers of u. */
static inline float pvid_kapitza_row_squares_f32(const pvid_strong_row_f32 *row)
{
    const float u2 = row->u * row->u;
    const float high2 = (row->u * u2) * row->f2;
    const float high0 = (u2 * u2) * row->f0;
    return ((((((row->x[PVID_ROW_Y] * row->x[PVID_ROW_Y]) + (row->x[PVID_ROW_A] * row->x[PVID_ROW_A])) +
               (row->x[PVID_ROW_E] * row->x[PVID_ROW_E])) +
              (row->f2 * row->f2)) +
             (row->f0 * row->f0)) +
            (high2 * high2)) +
           (high0 * high0);
}

#endif
