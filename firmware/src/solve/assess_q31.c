/* Accuracy of p: standard errors, kappa, residual. */
#include <string.h>

#include "solve/assess_q31.h"
#include "solve/system_q31.h"
#include "number/scaled_q31.h"

#define UNIT_BITS (PVID_RHS_BITS - 1)

pvid_scaled_q31 pvid_estimator_expected_variance_q31(const pvid_estimator_q31 *self)
{
    const int32_t exponent = -2 * (PVID_ROW_SD_BITS + (int32_t)self->information.exponent);
    return pvid_scaled_of_q31((int64_t)self->row_sd * self->row_sd, exponent);
}

/* Degrees of freedom of the residuals, Q16. */
static int64_t freedom_of(const pvid_estimator_q31 *self)
{
    return self->information.sums[self->information.n_sums - 1u] - ((int64_t)self->model->n_p << 16);
}

/* Residual sum over the degrees of freedom, of which there is one at least. */
static pvid_scaled_q31 found_variance(const pvid_estimator_q31 *self, int64_t freedom)
{
    const int64_t residual = self->information.sums[self->information.n_sums - 2u];
    return pvid_scaled_over_q31(pvid_scaled_of_q31(residual, 0), pvid_scaled_of_q31(freedom, -16));
}

/* Expected residual sum from the sensors' noise. */
static pvid_scaled_q31 explained_variance(const pvid_estimator_q31 *self)
{
    return pvid_scaled_shifted_q31(self->expected, -2 * (int32_t)self->information.exponent);
}

pvid_scaled_q31 pvid_estimator_variance_q31(const pvid_estimator_q31 *self)
{
    const int64_t freedom = freedom_of(self);
    if (freedom < ((int64_t)1 << 16)) {
        return pvid_estimator_expected_variance_q31(self);
    }
    const pvid_scaled_q31 found = found_variance(self, freedom);
    const pvid_scaled_q31 explained = explained_variance(self);
    return pvid_scaled_exceeds_q31(explained, found) ? explained : found;
}

void pvid_estimator_set_expected_q31(pvid_estimator_q31 *self, pvid_scaled_q31 variance)
{
    const int64_t weight = self->information.sums[self->information.n_sums - 1u];
    if ((self->group_weight <= 0) || (weight < self->group_weight)) {
        return;
    }
    const pvid_scaled_q31 share =
        pvid_scaled_over_q31(pvid_scaled_of_q31(self->group_weight, 0), pvid_scaled_of_q31(weight, 0));
    const pvid_scaled_q31 change = pvid_scaled_times_q31(share, pvid_scaled_minus_q31(variance, self->expected));
    const pvid_scaled_q31 mean = pvid_scaled_plus_q31(self->expected, change);
    self->expected.m = (mean.m > 0) ? mean.m : 0;
    self->expected.e = mean.e;
}

/* Residual variance over its expectation, Q16; 0: unknown. */
static int32_t misfit_of(const pvid_estimator_q31 *self)
{
    const int64_t freedom = freedom_of(self);
    const pvid_scaled_q31 explained = explained_variance(self);
    if ((freedom < ((int64_t)1 << 16)) || (explained.m <= 0)) {
        return 0;
    }
    const pvid_scaled_q31 misfit = pvid_scaled_over_q31(found_variance(self, freedom), explained);
    return (int32_t)pvid_clamp_q31(pvid_scaled_fixed_q31(misfit, 16), INT32_MAX);
}

void pvid_estimator_residual_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve,
                                 pvid_estimate_q31 *estimate)
{
    const pvid_information_q31 *information = &self->information;
    const int64_t weight = pvid_floor_shift_q31(information->sums[information->n_sums - 1u], 16);
    estimate->weight = (weight > (int64_t)UINT32_MAX) ? UINT32_MAX : (uint32_t)weight;
    estimate->misfit = misfit_of(self);
    solve->variance = pvid_estimator_variance_q31(self);
    const pvid_root_q31 residual = pvid_root_of_q31(solve->variance.m, solve->variance.e);
    const int32_t shift = -((residual.e + (int32_t)information->exponent) + PVID_ROW_SD_BITS);
    estimate->residual_sd = (int32_t)pvid_clamp_q31(pvid_scale_q31(residual.r, shift), INT32_MAX);
    const pvid_scaled_q31 wide = pvid_scaled_times_q31(solve->variance, pvid_scaled_of_q31(self->correlation, -16));
    solve->wide = pvid_root_of_q31(wide.m, wide.e);
}

void pvid_estimator_widen_q31(const pvid_estimator_q31 *self, pvid_estimator_solve_q31 *solve)
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        int32_t prior;
        const int32_t exponent = pvid_square_ratio_q31(solve->wide.r, solve->wide.e, self->start_sd[a], &prior);
        solve->s[a][a] += pvid_system_prior_q31(prior, exponent, solve->f[a]);
    }
}

void pvid_estimator_invert_q31(pvid_estimator_solve_q31 *solve, size_t a)
{
    if (!solve->factor.positive) {
        return;
    }
    int32_t unit[PVID_MAX_P] = {0};
    int64_t square = 0;
    unit[a] = (int32_t)1 << UNIT_BITS;
    pvid_cholesky_lower_q31(&solve->factor, unit, solve->column[a]);
    for (size_t i = 0; i < solve->factor.n; i++) {
        square += pvid_square_q31(solve->column[a][i]);
    }
    solve->root[a] = pvid_root_of_q31((square > 0) ? square : 1, 0); /* no column is empty */
}

/* x / (a b), |x| <= a b: Q30, rounded towards 0. */
static int32_t part_of(int64_t x, int32_t a, int32_t b)
{
    const uint64_t part = ((pvid_magnitude_q31(x) / (uint64_t)a) << 30) / (uint64_t)b;
    const int64_t clamped = (part > (uint64_t)PVID_ONE_Q30) ? PVID_ONE_Q30 : (int64_t)part;
    return (int32_t)((x < 0) ? -clamped : clamped);
}

void pvid_estimator_errors_q31(const pvid_estimator_q31 *self, const pvid_estimator_solve_q31 *solve, size_t a,
                               pvid_estimate_q31 *estimate)
{
    estimate->correlation[a][a] = PVID_ONE_Q30;
    if (!solve->factor.positive) {
        estimate->se[a] = self->start_sd[a];
        return;
    }
    const pvid_root_q31 own = solve->root[a];
    const int32_t shift = ((solve->f[a] + solve->g[a]) - (solve->wide.e + own.e)) + 31 + UNIT_BITS;
    estimate->se[a] = (int32_t)pvid_clamp_q31(pvid_scale_q31((int64_t)solve->wide.r * own.r, shift), INT32_MAX);
    for (size_t b = 0; b < a; b++) {
        int64_t sum = 0;
        for (size_t i = 0; i < solve->factor.n; i++) {
            sum += (int64_t)solve->column[a][i] * solve->column[b][i];
        }
        const int64_t in_roots = pvid_scale_q31(sum, own.e + solve->root[b].e);
        estimate->correlation[a][b] = part_of(in_roots, own.r, solve->root[b].r);
        estimate->correlation[b][a] = estimate->correlation[a][b];
    }
}
