/* Accuracy of p: standard errors, misfit, residual. */
#include "solve/assess_q31.h"

pvid_scaled_q31 pvid_assess_row_variance_q31(const pvid_solve_settings_q31 *settings, int32_t exponent)
{
    return pvid_scaled_of_q31((int64_t)settings->row_sd * settings->row_sd, -2 * (PVID_ROW_SD_BITS + exponent));
}

/* Degrees of freedom of the residuals, Q16. */
static int64_t freedom_of(const pvid_residual_q31 *sums, const pvid_solve_settings_q31 *settings)
{
    return sums->weight - ((int64_t)settings->n_p << 16);
}

/* Residual sum over the degrees of freedom, of which there is one at least. */
static pvid_scaled_q31 found_variance(const pvid_residual_q31 *sums, int64_t freedom)
{
    const int64_t residual = sums->residual;
    return pvid_scaled_over_q31(pvid_scaled_of_q31(residual, 0), pvid_scaled_of_q31(freedom, -16));
}

/* The variance by the sensors' noise, divided as the sums are. */
static pvid_scaled_q31 explained_variance(const pvid_residual_q31 *sums, pvid_scaled_q31 expected)
{
    return pvid_scaled_shifted_q31(expected, -2 * (int32_t)sums->exponent);
}

pvid_scaled_q31 pvid_assess_variance_q31(const pvid_residual_q31 *sums, const pvid_solve_settings_q31 *settings,
                                         pvid_scaled_q31 expected)
{
    const int64_t freedom = freedom_of(sums, settings);
    if (freedom < ((int64_t)1 << 16)) {
        return pvid_assess_row_variance_q31(settings, sums->exponent);
    }
    const pvid_scaled_q31 found = found_variance(sums, freedom);
    const pvid_scaled_q31 explained = explained_variance(sums, expected);
    return pvid_scaled_exceeds_q31(explained, found) ? explained : found;
}

/* Residual variance over its expectation, Q16; 0: unknown. */
static int32_t misfit_of(const pvid_residual_q31 *sums, const pvid_solve_settings_q31 *settings,
                         pvid_scaled_q31 expected)
{
    const int64_t freedom = freedom_of(sums, settings);
    const pvid_scaled_q31 explained = explained_variance(sums, expected);
    if ((freedom < ((int64_t)1 << 16)) || (explained.m <= 0)) {
        return 0;
    }
    const pvid_scaled_q31 misfit = pvid_scaled_over_q31(found_variance(sums, freedom), explained);
    return (int32_t)pvid_clamp_q31(pvid_scaled_fixed_q31(misfit, 16), INT32_MAX);
}

void pvid_assess_residual_q31(const pvid_residual_q31 *sums, const pvid_solve_settings_q31 *settings,
                              pvid_scaled_q31 expected, pvid_scaled_q31 *variance, pvid_root_q31 *wide,
                              pvid_estimate_q31 *estimate)
{
    const int64_t weight = pvid_floor_shift_q31(sums->weight, 16);
    estimate->weight = (weight > (int64_t)UINT32_MAX) ? UINT32_MAX : (uint32_t)weight;
    estimate->misfit = misfit_of(sums, settings, expected);
    *variance = pvid_assess_variance_q31(sums, settings, expected);
    const pvid_root_q31 residual = pvid_root_of_q31(variance->m, variance->e);
    const int32_t shift = -((residual.e + (int32_t)sums->exponent) + PVID_ROW_SD_BITS);
    estimate->residual_sd = (int32_t)pvid_clamp_q31(pvid_scale_q31(residual.r, shift), INT32_MAX);
    const pvid_scaled_q31 square = pvid_scaled_times_q31(*variance, pvid_scaled_of_q31(settings->correlation, -16));
    *wide = pvid_root_of_q31(square.m, square.e);
}

void pvid_assess_widen_q31(pvid_system_q31 *system, const pvid_solve_settings_q31 *settings, pvid_root_q31 wide)
{
    for (size_t a = 0; a < settings->n_p; a++) {
        int32_t prior;
        const int32_t exponent = pvid_square_ratio_q31(wide.r, wide.e, settings->start_sd[a], &prior);
        system->s[a][a] += pvid_system_prior_q31(prior, exponent, system->f[a]);
    }
}

void pvid_assess_invert_q31(const pvid_cholesky_q31 *factor, size_t a, pvid_inverse_q31 *inverse)
{
    if (!factor->positive) {
        return;
    }
    int32_t unit[PVID_MAX_P] = {0};
    int64_t square = 0;
    unit[a] = (int32_t)1 << (uint32_t)pvid_unit_bits_q31(factor->n);
    pvid_cholesky_lower_q31(factor, unit, inverse->column[a]);
    for (size_t i = 0; i < factor->n; i++) {
        square += pvid_square_q31(inverse->column[a][i]);
    }
    inverse->root[a] = pvid_root_of_q31((square > 0) ? square : 1, 0); /* no column is empty */
}

/* x / (a b), |x| <= a b: Q30, rounded towards 0. */
static int32_t part_of(int64_t x, int32_t a, int32_t b)
{
    const uint64_t over_a = pvid_quotient_q31(pvid_magnitude_q31(x), (uint32_t)a);
    const uint64_t part = pvid_quotient_q31(over_a << 30, (uint32_t)b);
    const int64_t clamped = (part > (uint64_t)PVID_ONE_Q30) ? PVID_ONE_Q30 : (int64_t)part;
    return (int32_t)((x < 0) ? -clamped : clamped);
}

int32_t pvid_assess_error_q31(const pvid_system_q31 *system, pvid_root_q31 own, size_t a, pvid_root_q31 wide)
{
    const int32_t shift =
        ((system->f[a] + system->g[a]) - (wide.e + own.e)) + 31 + pvid_unit_bits_q31(system->factor.n);
    return (int32_t)pvid_clamp_q31(pvid_scale_q31(pvid_product_q31(wide.r, own.r), shift), INT32_MAX);
}

void pvid_assess_errors_q31(const pvid_system_q31 *system, const pvid_solve_settings_q31 *settings,
                            const pvid_inverse_q31 *inverse, size_t a, pvid_estimate_q31 *estimate)
{
    estimate->correlation[a][a] = PVID_ONE_Q30;
    if (!system->factor.positive) {
        estimate->se[a] = settings->start_sd[a];
        return;
    }
    const pvid_root_q31 own = inverse->root[a];
    estimate->se[a] = pvid_assess_error_q31(system, own, a, inverse->wide);
    for (size_t b = 0; b < a; b++) {
        int64_t sum = 0;
        for (size_t i = 0; i < system->factor.n; i++) {
            sum += pvid_product_q31(inverse->column[a][i], inverse->column[b][i]);
        }
        const int64_t in_roots = pvid_scale_q31(sum, own.e + inverse->root[b].e);
        estimate->correlation[a][b] = part_of(in_roots, own.r, inverse->root[b].r);
        estimate->correlation[b][a] = estimate->correlation[a][b];
    }
}
