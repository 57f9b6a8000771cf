#include "solve/cholesky_q31.h"

#include <stddef.h>

#include "number/scaled_q31.h"

int32_t pvid_half_exponent_q31(int64_t diagonal)
{
    const int32_t length = (int32_t)pvid_bit_length_q31(pvid_magnitude_q31(diagonal));
    return (int32_t)pvid_floor_shift_q31((int64_t)length - 29, 1);
}

bool pvid_pivot_is_significant_q31(int64_t pivot, int32_t diagonal)
{
    return (diagonal >= (PVID_ONE_Q30 / 4)) && (pivot >= ((int64_t)diagonal * (PVID_ONE_Q30 >> PVID_PIVOT_SHIFT)));
}

int32_t pvid_divide_q31(int64_t total, pvid_reciprocal_q31 inverse, int32_t limit)
{
    const int32_t part = (int32_t)pvid_clamp_q31(pvid_round_shift_q31(total, 30), INT32_MAX);
    return (int32_t)pvid_clamp_q31(pvid_round_shift_q31(pvid_product_q31(part, inverse.m), 31u - inverse.k), limit);
}

void pvid_cholesky_begin_q31(pvid_cholesky_q31 *self, uint8_t n)
{
    self->n = n;
    self->positive = true;
    self->first_pivot = 0;
}

/* A pivot over its diagonal entry. */
static int32_t part_of(int64_t pivot, int32_t diagonal)
{
    return (int32_t)pvid_clamp_q31((int64_t)pvid_quotient_q31((uint64_t)pivot, (uint32_t)diagonal), PVID_ONE_Q30);
}

void pvid_cholesky_eliminate_q31(pvid_cholesky_q31 *self, const int32_t s[][PVID_MAX_P], size_t j)
{
    if (!self->positive) { /* rows of u that are missing must not be read */
        return;
    }
    const size_t n = self->n;
    const int32_t diagonal = s[j][j];
    int64_t pivot = (int64_t)diagonal * PVID_ONE_Q30;
    for (size_t k = j + 1u; (k < n) && ((PVID_MAX_P <= 8) || (pivot >= 0)); k++) { /* 8 squares cannot wrap */
        pivot -= pvid_short_square_q31(self->u[j][k]);
    }
    if (!pvid_pivot_is_significant_q31(pivot, diagonal)) {
        self->positive = false;
        return;
    }
    self->pivot[j] = pivot;
    self->first_pivot = (j == 0u) ? part_of(pivot, diagonal) : 0;
    const pvid_scaled_q31 root = pvid_inverse_root_q31(pvid_scaled_of_q31(pivot, 0));
    self->inverse[j].m = 2 * root.m;
    self->inverse[j].k = (uint8_t)((uint32_t)(root.e + 60) & 31u); /* of a pivot that is significant 0 to 11 */
    for (size_t i = 0; i < j; i++) {
        int64_t sum = (int64_t)s[i][j] * PVID_ONE_Q30;
        for (size_t k = j + 1u; k < n; k++) {
            sum -= pvid_short_product_q31(self->u[i][k], self->u[j][k]);
        }
        self->u[i][j] = pvid_divide_q31(sum, self->inverse[j], PVID_ONE_Q30);
    }
}

int32_t pvid_cholesky_least_pivot_q31(const pvid_cholesky_q31 *self, const int32_t s[][PVID_MAX_P])
{
    int32_t least = PVID_ONE_Q30;
    for (size_t j = 0; j < self->n; j++) {
        const int32_t relative = part_of(self->pivot[j], s[j][j]);
        least = (relative < least) ? relative : least;
    }
    return least;
}

bool pvid_cholesky_factor_q31(pvid_cholesky_q31 *self, uint8_t n, const int32_t s[][PVID_MAX_P])
{
    pvid_cholesky_begin_q31(self, n);
    for (size_t eliminated = 1; eliminated <= n; eliminated++) {
        pvid_cholesky_eliminate_q31(self, s, n - eliminated);
    }
    return self->positive;
}

void pvid_cholesky_lower_q31(const pvid_cholesky_q31 *self, const int32_t rhs[], int32_t x[])
{
    for (size_t eliminated = 1; eliminated <= self->n; eliminated++) {
        const size_t i = self->n - eliminated;
        int64_t sum = (int64_t)rhs[i] * PVID_ONE_Q30;
        for (size_t k = i + 1u; k < self->n; k++) {
            sum -= pvid_short_product_q31(self->u[i][k], x[k]);
        }
        x[i] = pvid_divide_q31(sum, self->inverse[i], pvid_x_max_q31(self->n));
    }
}

static void solve_upper(const pvid_cholesky_q31 *self, const int32_t rhs[], int32_t x[])
{
    for (size_t i = 0; i < self->n; i++) {
        int64_t sum = (int64_t)rhs[i] * PVID_ONE_Q30;
        for (size_t k = 0; k < i; k++) {
            sum -= pvid_short_product_q31(self->u[k][i], x[k]);
        }
        x[i] = pvid_divide_q31(sum, self->inverse[i], pvid_x_max_q31(self->n));
    }
}

int32_t pvid_cholesky_solve_q31(const pvid_cholesky_q31 *self, const int64_t rhs[], int32_t x[])
{
    int32_t first[PVID_MAX_P];
    int32_t middle[PVID_MAX_P];
    int64_t wide[PVID_MAX_P];
    const int32_t before = pvid_to_block_q31(self->n, rhs, pvid_rhs_bits_q31(self->n), first);
    pvid_cholesky_lower_q31(self, first, middle);
    for (size_t i = 0; i < self->n; i++) {
        wide[i] = middle[i];
    }
    const int32_t after = pvid_to_block_q31(self->n, wide, pvid_rhs_bits_q31(self->n), middle);
    solve_upper(self, middle, x);
    return before + after;
}

int32_t pvid_to_block_q31(uint32_t n, const int64_t x[], int32_t bits, int32_t out[])
{
    uint32_t largest = 0;
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t length = pvid_bit_length_q31(pvid_magnitude_q31(x[i]));
        largest = (length > largest) ? length : largest;
    }
    const int32_t exponent = (int32_t)largest - bits;
    for (uint32_t i = 0; i < n; i++) {
        out[i] = (int32_t)pvid_scale_q31(x[i], exponent);
    }
    return exponent;
}
