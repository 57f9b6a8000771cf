#include "cholesky_f32.h"

#include <math.h>
#include <stddef.h>

#include "finite_f32.h"

/* Power of two d with 1 <= d^2 x < 4 for a normal positive x: exact, so equilibrating costs no bit.
 * With e the biased exponent, d = 2^-floor((e - 127) / 2) has the biased exponent 127 - floor(..),
 * which is 190 - (e - 1) / 2 in unsigned arithmetic. */
static inline float inverse_root_scale(float x)
{
    const uint32_t exponent = pvid_bits_f32(x) >> 23;
    return pvid_from_bits_f32((190u - ((exponent - 1u) >> 1)) << 23);
}

static bool positive_normal(float x)
{
    return (x >= 1.17549435e-38f) && (x <= 3.4e38f);
}

static bool pivot_is_data(float pivot, float diagonal)
{
    return pivot >= (PVID_PIVOT_MIN * diagonal); /* false for NaN */
}

static bool factor_any(pvid_cholesky_f32 *self, size_t n, const float s[][PVID_MAX_P])
{
    for (size_t i = 0; i < n; i++) {
        if (!positive_normal(s[i][i])) {
            return false;
        }
        self->scale[i] = inverse_root_scale(s[i][i]);
    }
    for (size_t j = n; j-- > 0u;) {
        const float diagonal = (s[j][j] * self->scale[j]) * self->scale[j];
        float pivot = diagonal;
        for (size_t k = j + 1u; k < n; k++) {
            pivot -= self->u[j][k] * self->u[j][k];
        }
        if (!pivot_is_data(pivot, diagonal)) {
            return false;
        }
        if (j == 0u) {
            self->first_pivot = pivot / diagonal;
        }
        self->u[j][j] = 1.0f / sqrtf(pivot);
        for (size_t i = 0; i < j; i++) {
            float sum = (s[i][j] * self->scale[i]) * self->scale[j];
            for (size_t k = j + 1u; k < n; k++) {
                sum -= self->u[i][k] * self->u[j][k];
            }
            self->u[i][j] = sum * self->u[j][j];
        }
    }
    return true;
}

/* factor_any for n = 3, the paper's order, written out: the same operations in the same order at
 * half the instructions. It runs at every tick of the strong form. */
static bool factor_three(pvid_cholesky_f32 *self, const float s[][PVID_MAX_P])
{
    if (!positive_normal(s[0][0]) || !positive_normal(s[1][1]) || !positive_normal(s[2][2])) {
        return false;
    }
    const float d0 = inverse_root_scale(s[0][0]);
    const float d1 = inverse_root_scale(s[1][1]);
    const float d2 = inverse_root_scale(s[2][2]);
    self->scale[0] = d0;
    self->scale[1] = d1;
    self->scale[2] = d2;

    const float pivot2 = (s[2][2] * d2) * d2; /* in [1, 4): always data */
    const float inverse2 = 1.0f / sqrtf(pivot2);
    const float u02 = ((s[0][2] * d0) * d2) * inverse2;
    const float u12 = ((s[1][2] * d1) * d2) * inverse2;

    const float diagonal1 = (s[1][1] * d1) * d1;
    const float pivot1 = diagonal1 - (u12 * u12);
    if (!pivot_is_data(pivot1, diagonal1)) {
        return false;
    }
    const float inverse1 = 1.0f / sqrtf(pivot1);
    const float u01 = (((s[0][1] * d0) * d1) - (u02 * u12)) * inverse1;

    const float diagonal0 = (s[0][0] * d0) * d0;
    const float pivot0 = (diagonal0 - (u01 * u01)) - (u02 * u02);
    if (!pivot_is_data(pivot0, diagonal0)) {
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

bool pvid_cholesky_factor_f32(pvid_cholesky_f32 *self, uint8_t n, const float s[][PVID_MAX_P])
{
    self->n = n;
    self->first_pivot = 0.0f;
    return (n == 3u) ? factor_three(self, s) : factor_any(self, n, s);
}

/* Inlined twice: with n a constant 3 the compiler writes the loops out. */
static inline void solve_of(const pvid_cholesky_f32 *self, size_t n, const float rhs[], float x[])
{
    for (size_t row = 0; row < n; row++) { /* U z = D rhs */
        const size_t i = n - 1u - row;
        float sum = rhs[i] * self->scale[i];
        for (size_t k = i + 1u; k < n; k++) {
            sum -= self->u[i][k] * x[k];
        }
        x[i] = sum * self->u[i][i];
    }
    for (size_t i = 0; i < n; i++) { /* U^T y = z */
        float sum = x[i];
        for (size_t k = 0; k < i; k++) {
            sum -= self->u[k][i] * x[k];
        }
        x[i] = sum * self->u[i][i];
    }
    for (size_t i = 0; i < n; i++) {
        x[i] *= self->scale[i];
    }
}

void pvid_cholesky_solve_f32(const pvid_cholesky_f32 *self, const float rhs[], float x[])
{
    if (self->n == 3u) {
        solve_of(self, 3, rhs, x);
    } else {
        solve_of(self, self->n, rhs, x);
    }
}

void pvid_cholesky_inverse_column_f32(const pvid_cholesky_f32 *self, size_t j, float inverse[][PVID_MAX_P])
{
    float unit[PVID_MAX_P] = {0.0f};
    float column[PVID_MAX_P];
    unit[j] = 1.0f;
    pvid_cholesky_solve_f32(self, unit, column);
    for (size_t i = 0; i <= j; i++) { /* the two triangles differ by rounding: keep one */
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
