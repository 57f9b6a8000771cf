/* cholesky_q31: any matrix with a diagonal in [2^28, 2^30), any right-hand side within PVID_WIDE. And of scaled_q31 what
 * takes pvid_scale_q31 by its contract. */
#include "prove.h"

#include "contracts.h"

static pvid_cholesky_q31 factor;

/* The diagonal in one of two octaves each, by the bits of `octaves`. */
static void any_matrix(uint32_t octaves, int32_t s[PVID_MAX_P][PVID_MAX_P])
{
    for (uint32_t i = 0; i < PVID_MAX_P; i++) {
        for (size_t j = 0; j < PVID_MAX_P; j++) {
            s[i][j] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
        }
        const int32_t low = (PVID_ONE_Q30 / 4) << ((octaves >> i) & 1u);
        s[i][i] = any_i32(low, (2 * low) - 1);
    }
}

static void any_system(uint8_t n, uint32_t octaves)
{
    int32_t s[PVID_MAX_P][PVID_MAX_P];
    int64_t rhs[PVID_MAX_P];
    int32_t x[PVID_MAX_P];
    any_matrix(octaves, s);
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        rhs[i] = any_i64(-PVID_WIDE, PVID_WIDE);
    }
    if (pvid_cholesky_factor_q31(&factor, n, s)) {
        (void)pvid_cholesky_least_pivot_q31(&factor, s);
        (void)pvid_cholesky_solve_q31(&factor, rhs, x);
    }
}

void main(void)
{
    const pvid_scaled_q31 number = {any_i32(-PVID_ONE_Q30, PVID_ONE_Q30), any_i32(-10000, 10000)};
    (void)pvid_scaled_fixed_q31(number, any_i32(-100, 100));
    for (uint8_t n = 1; n <= PVID_MAX_P; n++) {
        for (uint32_t octaves = 0; octaves < (1u << PVID_MAX_P); octaves++) {
            any_system(n, octaves);
        }
    }
}
