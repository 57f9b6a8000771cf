/* Equilibrated Cholesky factorisation of a small symmetric matrix. Private to the core. */
#ifndef PVID_CHOLESKY_F32_H
#define PVID_CHOLESKY_F32_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/estimator.h"

/* A pivot below this part of its diagonal entry is rounding, not data: n eps, with a margin for
 * the rounding of S itself. */
#define PVID_PIVOT_MIN 1.0e-6f

/* Factors the n x n matrix whose upper triangle is s. Returns false iff a diagonal entry is not a
 * positive normal number or a relative pivot is below PVID_PIVOT_MIN; first_pivot is 0 then.
 * Cost: n (n + 1) (n + 2) / 6 multiplications, n square roots, n + 1 divisions. */
bool pvid_cholesky_factor_f32(pvid_cholesky_f32 *self, uint8_t n, const float s[][PVID_MAX_P]);

/* x[n] = S^-1 rhs[n]. */
void pvid_cholesky_solve_f32(const pvid_cholesky_f32 *self, const float rhs[], float x[]);

/* Column j of inverse[n][n] = S^-1 down to its diagonal, and row j likewise: all of them, in any order, make a
 * symmetric inverse. Cost: a solve. */
void pvid_cholesky_inverse_column_f32(const pvid_cholesky_f32 *self, size_t j, float inverse[][PVID_MAX_P]);

/* inverse[n][n] = S^-1, symmetric. */
void pvid_cholesky_inverse_f32(const pvid_cholesky_f32 *self, float inverse[][PVID_MAX_P]);

#endif
