#include "number/uncontracted.h"

#include "solve/cholesky_f32.h"

#include <math.h>
#include <stddef.h>

#include "number/exact.h"
#include "number/finite_f32.h"

static bool factor_any(pvid_cholesky_f32 *self, size_t n, const float s[][PVID_MAX_P])
{
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < n; i++) {
        if (!pvid_positive_normal_f32(s[i][i])) {
            return false;
        }
        self->scale[i] = pvid_inverse_root_scale_f32(s[i][i]);
    }
    PVID_UNROLL_EXACT
    for (size_t left = n; left > 0u; left--) {
        const size_t j = left - 1u;
        const float diagonal = (s[j][j] * self->scale[j]) * self->scale[j];
        float pivot = diagonal;
        PVID_UNROLL_EXACT
        for (size_t k = j + 1u; k < n; k++) {
            pivot -= self->u[j][k] * self->u[j][k];
        }
        if (!pvid_pivot_is_significant_f32(pivot, diagonal)) {
            return false;
        }
        if (j == 0u) {
            self->first_pivot = pivot / diagonal;
        }
        self->u[j][j] = 1.0f / sqrtf(pivot);
        PVID_UNROLL_EXACT
        for (size_t i = 0; i < j; i++) {
            float sum = (s[i][j] * self->scale[i]) * self->scale[j];
            PVID_UNROLL_EXACT
            for (size_t k = j + 1u; k < n; k++) {
                sum -= self->u[i][k] * self->u[j][k];
            }
            self->u[i][j] = sum * self->u[j][j];
        }
    }
    return true;
}

bool pvid_cholesky_factor_f32(pvid_cholesky_f32 *self, uint8_t n, const float s[][PVID_MAX_P])
{
    self->n = n;
    self->first_pivot = 0.0f;
    const size_t count = PVID_COUNT(PVID_MAX_P, n);
    return (count == 3u) ? pvid_cholesky_factor_three_f32(self, s) : factor_any(self, count, s);
}

static void solve_any(const pvid_cholesky_f32 *self, size_t n, const float rhs[], float x[])
{
    PVID_UNROLL_EXACT
    for (size_t row = 0; row < n; row++) { /* U z = D rhs */
        const size_t i = n - 1u - row;
        float sum = rhs[i] * self->scale[i];
        PVID_UNROLL_EXACT
        for (size_t k = i + 1u; k < n; k++) {
            sum -= self->u[i][k] * x[k];
        }
        x[i] = sum * self->u[i][i];
    }
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < n; i++) { /* U^T y = z */
        float sum = x[i];
        PVID_UNROLL_EXACT
        for (size_t k = 0; k < i; k++) {
            sum -= self->u[k][i] * x[k];
        }
        x[i] = sum * self->u[i][i];
    }
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < n; i++) {
        x[i] *= self->scale[i];
    }
}

void pvid_cholesky_solve_f32(const pvid_cholesky_f32 *self, const float rhs[], float x[])
{
    const size_t n = PVID_COUNT(PVID_MAX_P, self->n);
    if (n == 3u) {
        pvid_cholesky_solve_three_f32(self, rhs, x);
    } else {
        solve_any(self, n, rhs, x);
    }
}

void pvid_cholesky_inverse_column_f32(const pvid_cholesky_f32 *self, size_t j, float inverse[][PVID_MAX_P])
{
    float unit[PVID_MAX_P] = {0.0f};
    float column[PVID_MAX_P];
    unit[j] = 1.0f;
    pvid_cholesky_solve_f32(self, unit, column);
    for (size_t i = 0; i < j + 1u; i++) { /* the two triangles differ by rounding: keep one */
        inverse[i][j] = column[i];
        inverse[j][i] = column[i];
    }
}

void pvid_cholesky_inverse_f32(const pvid_cholesky_f32 *self, float inverse[][PVID_MAX_P])
{
    for (size_t j = 0; j < self->n; j++) {
        pvid_cholesky_inverse_column_f32(self, j, inverse);
    }
}
