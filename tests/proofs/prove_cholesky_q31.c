/* cholesky_q31: any matrix within 30 bits, of any diagonal, of which nothing but the upper triangle is there; any
 * right-hand side. And of scaled_q31 what takes pvid_scale_q31 by its contract. */
#include "prove.h"

#include "contracts.h"

static void any_system(uint8_t n)
{
    pvid_cholesky_q31 factor;
    int32_t s[PVID_MAX_P][PVID_MAX_P];
    int64_t rhs[PVID_MAX_P];
    int32_t unit[PVID_MAX_P];
    int32_t x[PVID_MAX_P];
    for (uint32_t i = 0; i < n; i++) {
        for (size_t j = i; j < n; j++) {
            s[i][j] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
        }
        rhs[i] = any_i64(-INT64_MAX, INT64_MAX - 1);
        unit[i] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
    }
    if (pvid_cholesky_factor_q31(&factor, n, s)) {
        (void)pvid_cholesky_least_pivot_q31(&factor, s);
        (void)pvid_cholesky_solve_q31(&factor, rhs, x);
        pvid_cholesky_lower_q31(&factor, unit, x);
    }
}

void main(void)
{
    const pvid_scaled_q31 number = {any_i32(-PVID_ONE_Q30, PVID_ONE_Q30), any_i32(-10000, 10000)};
    (void)pvid_scaled_fixed_q31(number, any_i32(-100, 100));
    for (uint8_t n = 1; n <= PVID_MAX_P; n++) {
        any_system(n);
    }
    (void)pvid_half_exponent_q31(any_i64(-INT64_MAX, INT64_MAX));
}
