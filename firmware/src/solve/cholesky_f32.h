/* Equilibrated Cholesky factorisation of a small symmetric matrix. Private to the core. */
#ifndef PVID_CHOLESKY_F32_H
#define PVID_CHOLESKY_F32_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "number/finite_f32.h"
#include "pvid/estimator.h"

/* A pivot below this part of its diagonal entry is rounding, not data: n eps, with a margin for the rounding of S. */
#define PVID_PIVOT_MIN 1.0e-6f

/* Factors the n x n matrix with the upper triangle s. Fails (returns false, first_pivot = 0) iff a diagonal entry
 * is not a positive normal number or a relative pivot is below PVID_PIVOT_MIN. Cost: n (n + 1) (n + 2) / 6
 * multiplications, n square roots, n + 1 divisions. */
bool pvid_cholesky_factor_f32(pvid_cholesky_f32 *self, uint8_t n, const float s[][PVID_MAX_P]);

/* x[n] = S^-1 rhs[n]. */
void pvid_cholesky_solve_f32(const pvid_cholesky_f32 *self, const float rhs[], float x[]);

/* Column j of inverse[n][n] = S^-1 down to its diagonal, and row j: all columns, in any order, give a symmetric
 * inverse. Cost: a solve. */
void pvid_cholesky_inverse_column_f32(const pvid_cholesky_f32 *self, size_t j, float inverse[][PVID_MAX_P]);

/* inverse[n][n] = S^-1, symmetric. */
void pvid_cholesky_inverse_f32(const pvid_cholesky_f32 *self, float inverse[][PVID_MAX_P]);

/* ---- inlined ---- */

/* Power of two d with 1 <= d^2 x < 4 for a normal positive x: exact, so equilibrating costs no bit.
 * With e the biased exponent, d = 2^-floor((e - 127) / 2) has the biased exponent 127 - floor(..),
 * which is 190 - (e - 1) / 2 in unsigned arithmetic. */
static inline float pvid_inverse_root_scale_f32(float x)
{
    const uint32_t exponent = pvid_bits_f32(x) >> 23;
    return pvid_from_bits_f32((190u - ((exponent - 1u) >> 1)) << 23);
}

/* Positive, normal and finite, by the biased exponent: 1..254 without a sign. */
static inline bool pvid_positive_normal_f32(float x)
{
    return (pvid_bits_f32(x) - 0x00800000u) < 0x7F000000u;
}

static inline bool pvid_pivot_is_significant_f32(float pivot, float diagonal)
{
    return pivot >= (PVID_PIVOT_MIN * diagonal); /* false for NaN */
}

/* The factorisation for n = 3, the paper's order, written out: the same operations in the same order at half the
 * instructions. Inlined where it runs at every tick, so that the factor stays in registers. */
static inline bool pvid_cholesky_factor_three_f32(pvid_cholesky_f32 *self, const float s[][PVID_MAX_P])
{
    if (!pvid_positive_normal_f32(s[0][0]) || !pvid_positive_normal_f32(s[1][1]) ||
        !pvid_positive_normal_f32(s[2][2])) {
        return false;
    }
    const float d0 = pvid_inverse_root_scale_f32(s[0][0]);
    const float d1 = pvid_inverse_root_scale_f32(s[1][1]);
    const float d2 = pvid_inverse_root_scale_f32(s[2][2]);
    self->scale[0] = d0;
    self->scale[1] = d1;
    self->scale[2] = d2;

    const float pivot2 = (s[2][2] * d2) * d2; /* in [1, 4): always data */
    const float inverse2 = 1.0f / sqrtf(pivot2);
    const float u02 = ((s[0][2] * d0) * d2) * inverse2;
    const float u12 = ((s[1][2] * d1) * d2) * inverse2;

    const float diagonal1 = (s[1][1] * d1) * d1;
    const float pivot1 = diagonal1 - (u12 * u12);
    if (!pvid_pivot_is_significant_f32(pivot1, diagonal1)) {
        return false;
    }
    const float inverse1 = 1.0f / sqrtf(pivot1);
    const float u01 = (((s[0][1] * d0) * d1) - (u02 * u12)) * inverse1;

    const float diagonal0 = (s[0][0] * d0) * d0;
    const float pivot0 = (diagonal0 - (u01 * u01)) - (u02 * u02);
    if (!pvid_pivot_is_significant_f32(pivot0, diagonal0)) {
        return false;
    }
    self->first_pivot = pivot0 / diagonal0;
    self->u[0][0] = 1.0f / sqrtf(pivot0);
    self->u[0][1] = u01;
    self->u[0][2] = u02;
    self->u[1][1] = inverse1;
    self->u[1][2] = u12;
    self->u[2][2] = inverse2;
    return true;
}

/* pvid_cholesky_solve_f32 for n = 3, unrolled. */
static inline void pvid_cholesky_solve_three_f32(const pvid_cholesky_f32 *self, const float rhs[], float x[])
{
    const float z2 = (rhs[2] * self->scale[2]) * self->u[2][2]; /* U z = D rhs */
    const float z1 = ((rhs[1] * self->scale[1]) - (self->u[1][2] * z2)) * self->u[1][1];
    const float z0 = (((rhs[0] * self->scale[0]) - (self->u[0][1] * z1)) - (self->u[0][2] * z2)) * self->u[0][0];
    const float y0 = z0 * self->u[0][0]; /* U^T y = z */
    const float y1 = (z1 - (self->u[0][1] * y0)) * self->u[1][1];
    const float y2 = ((z2 - (self->u[0][2] * y0)) - (self->u[1][2] * y1)) * self->u[2][2];
    x[0] = y0 * self->scale[0];
    x[1] = y1 * self->scale[1];
    x[2] = y2 * self->scale[2];
}

#endif
