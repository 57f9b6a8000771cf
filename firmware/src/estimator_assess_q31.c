/* What is known of p: standard errors, kappa, residual. */
#include <string.h>

#include "estimator_q31.h"

#define UNIT_BITS (PVID_RHS_BITS - 1)

/* A positive number m 2^exponent, m of 30 bits, or 0. */
typedef struct {
    int32_t m;
    int32_t exponent;
} scaled;

static scaled to_scaled(int64_t x, int32_t exponent)
{
    scaled result;
    result.exponent = exponent + pvid_to_block_q31(1, &x, 30, &result.m);
    return result;
}

/* s^2 of a row, divided by 4^exponent as the sums are. */
static scaled row_variance(const pvid_estimator_q31 *self)
{
    const pvid_information_q31 *information = &self->information;
    const int64_t residual = information->sums[information->n_sums - 2u];
    const int64_t freedom = information->sums[information->n_sums - 1u] - ((int64_t)self->model->n_p << 16); /* Q16 */
    if (freedom < ((int64_t)1 << 16)) {
        return to_scaled((int64_t)self->row_sd * self->row_sd, -2 * (PVID_ROW_SD_BITS + (int32_t)information->exponent));
    }
    const int32_t up = 62 - (int32_t)pvid_bit_length_q31((uint64_t)residual);
    const scaled divisor = to_scaled(freedom, -16);
    return to_scaled(pvid_scale_q31(residual, -up) / divisor.m, -up - divisor.exponent);
}

static void assess_as_start(const pvid_estimator_q31 *self, pvid_estimate_q31 *estimate)
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        estimate->se[a] = self->start_sd[a];
        estimate->correlation[a][a] = PVID_ONE_Q30;
    }
}

/* x / (a b), |x| <= a b: Q30, rounded towards 0. */
static int32_t part_of(int64_t x, int32_t a, int32_t b)
{
    const uint64_t part = ((pvid_magnitude_q31(x) / (uint64_t)a) << 30) / (uint64_t)b;
    const int64_t held = (part > (uint64_t)PVID_ONE_Q30) ? PVID_ONE_Q30 : (int64_t)part;
    return (int32_t)((x < 0) ? -held : held);
}

/* The errors' covariance wide^2 (S + H)^-1, from the columns of U^-1. */
static void assess_errors(pvid_estimate_q31 *estimate, const pvid_cholesky_q31 *factor, pvid_root_q31 wide,
                          const int16_t f[], const int16_t g[])
{
    const size_t n_p = factor->n;
    int32_t column[PVID_MAX_P][PVID_MAX_P];
    pvid_root_q31 root[PVID_MAX_P];
    for (size_t a = 0; a < n_p; a++) {
        int32_t unit[PVID_MAX_P] = {0};
        int64_t square = 0;
        unit[a] = (int32_t)1 << UNIT_BITS;
        pvid_cholesky_lower_q31(factor, unit, column[a]);
        for (size_t i = 0; i < n_p; i++) {
            square += (int64_t)column[a][i] * column[a][i];
        }
        root[a] = pvid_root_of_q31(square, 0);
        const int32_t shift = ((f[a] + g[a]) - (wide.e + root[a].e)) + 31 + UNIT_BITS;
        estimate->se[a] = (int32_t)pvid_clamp_q31(pvid_scale_q31((int64_t)wide.r * root[a].r, shift), INT32_MAX);
    }
    for (size_t a = 0; a < n_p; a++) {
        estimate->correlation[a][a] = PVID_ONE_Q30;
        for (size_t b = 0; b < a; b++) {
            int64_t sum = 0;
            for (size_t i = 0; i < n_p; i++) {
                sum += (int64_t)column[a][i] * column[b][i];
            }
            const int64_t in_roots = pvid_scale_q31(sum, root[a].e + root[b].e);
            estimate->correlation[a][b] = part_of(in_roots, root[a].r, root[b].r);
            estimate->correlation[b][a] = estimate->correlation[a][b];
        }
    }
}

/* Equilibrates s and factors it. */
static bool factor_system(uint8_t n_p, int64_t s[][PVID_MAX_P], int16_t g[], int32_t q[][PVID_MAX_P],
                          pvid_cholesky_q31 *factor)
{
    pvid_system_equilibrate_q31(n_p, (const int64_t(*)[PVID_MAX_P])s, g, q);
    return pvid_cholesky_factor_q31(factor, n_p, (const int32_t(*)[PVID_MAX_P])q);
}

void pvid_estimator_assess_q31(const pvid_estimator_q31 *self, pvid_estimate_q31 *estimate)
{
    const pvid_information_q31 *information = &self->information;
    const uint8_t n_p = self->model->n_p;
    int32_t m[PVID_MAX_MOMENTS_Q31];
    int16_t h[PVID_MAX_THETA_Q31];
    int32_t c[PVID_MAX_C_Q31];
    int16_t f[PVID_MAX_P];
    int16_t g[PVID_MAX_P];
    int64_t s[PVID_MAX_P][PVID_MAX_P];
    int32_t q[PVID_MAX_P][PVID_MAX_P];
    pvid_cholesky_q31 factor;
    memset(estimate, 0, sizeof *estimate);
    memcpy(estimate->p, self->p, sizeof estimate->p);
    const int64_t weight = pvid_floor_shift_q31(information->sums[information->n_sums - 1u], 16);
    estimate->weight = (weight > (int64_t)UINT32_MAX) ? UINT32_MAX : (uint32_t)weight;

    const scaled variance = row_variance(self);
    const pvid_root_q31 residual = pvid_root_of_q31(variance.m, variance.exponent);
    const int32_t residual_shift = -((residual.e + (int32_t)information->exponent) + PVID_ROW_SD_BITS);
    estimate->residual_sd = (int32_t)pvid_clamp_q31(pvid_scale_q31(residual.r, residual_shift), INT32_MAX);
    const scaled wide = to_scaled((int64_t)variance.m * self->correlation, variance.exponent - 16);
    const pvid_root_q31 wide_root = pvid_root_of_q31(wide.m, wide.exponent);

    pvid_system_exponents_q31(information, h);
    for (size_t row = 0; row < self->model->n_theta;) {
        row = pvid_system_scale_rows_q31(information, h, row, m);
    }
    pvid_system_jacobian_q31(self, h, c, f);
    for (size_t a = 0, start = 0; a < n_p; a++) {
        start = pvid_system_project_q31(self->model, m, c, start, s[a]);
    }
    if (factor_system(n_p, s, g, q, &factor)) {
        estimate->kappa = factor.first_pivot;
    }
    for (size_t a = 0; a < n_p; a++) {
        int32_t prior;
        const int32_t exponent = pvid_square_ratio_q31(wide_root.r, wide_root.e, self->start_sd[a], &prior);
        s[a][a] += pvid_system_prior_q31(prior, exponent, f[a]);
    }
    if (factor_system(n_p, s, g, q, &factor)) {
        assess_errors(estimate, &factor, wide_root, f, g);
    } else {
        assess_as_start(self, estimate);
    }
}
