/* Equilibrated Cholesky factorisation of a small symmetric matrix. Private to the core. */
#ifndef PVID_CHOLESKY_F32_H
#define PVID_CHOLESKY_F32_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"

/* D S D = U U^T with D a diagonal of powers of two and U upper triangular: elimination runs from
 * the last index to the first, so that the last pivot is that of p[0]. */
typedef struct {
    uint8_t n;
    float scale[PVID_MAX_P];         /* D: diagonal entries of D S D lie in [1, 4) */
    float u[PVID_MAX_P][PVID_MAX_P]; /* upper triangle; the diagonal holds 1 / U_ii */
    float first_pivot;               /* pivot of index 0 over its diagonal entry: 1 - R^2 */
} pvid_cholesky_f32;

/* A pivot below this part of its diagonal entry is rounding, not data: n eps, with a margin for
 * the rounding of S itself. */
#define PVID_PIVOT_MIN 1.0e-6f

/* Factors the n x n matrix whose upper triangle is s. Returns false iff a diagonal entry is not a
 * positive normal number or a relative pivot is below PVID_PIVOT_MIN; first_pivot is 0 then.
 * Cost: n (n + 1) (n + 2) / 6 multiplications, n square roots, n + 1 divisions. */
bool pvid_cholesky_factor_f32(pvid_cholesky_f32 *self, uint8_t n, const float s[][PVID_MAX_P]);

/* x[n] = S^-1 rhs[n]. */
void pvid_cholesky_solve_f32(const pvid_cholesky_f32 *self, const float rhs[], float x[]);

/* inverse[n][n] = S^-1, symmetric. */
void pvid_cholesky_inverse_f32(const pvid_cholesky_f32 *self, float inverse[][PVID_MAX_P]);

#endif
