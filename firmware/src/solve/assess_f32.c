#include "number/uncontracted.h"

#include "solve/assess_f32.h"

#include <math.h>
#include <string.h>

#include "number/exact.h"
#include "number/finite_f32.h"
#include "solve/constraints_f32.h"

/* Degrees of freedom of the residuals. */
static float freedom_of(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings)
{
    return system->weight - (float)settings->n_p;
}

PVID_COLD float pvid_assess_variance_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings)
{
    const float freedom = freedom_of(system, settings);
    if (!(freedom >= 1.0f)) {
        return settings->row_variance;
    }
    const float sum = system->rss + system->rounding;
    const float residual = (sum <= PVID_RESIDUAL_MAX) ? sum : PVID_RESIDUAL_MAX;
    return ((residual > system->floor) ? residual : system->floor) / freedom;
}

PVID_COLD float pvid_assess_misfit_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings)
{
    const bool free = freedom_of(system, settings) >= 1.0f;
    if (!free || !(system->floor > 0.0f) || !(system->rss > 0.0f)) {
        return 0.0f;
    }
    const float misfit = system->rss / system->floor;
    return (misfit <= PVID_RESIDUAL_MAX) ? misfit : PVID_RESIDUAL_MAX;
}

bool pvid_assess_above_noise_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings, float variance,
                                 const float noise[][PVID_MAX_P])
{
    const uint8_t n = settings->n_p;
    const size_t count = PVID_COUNT(PVID_MAX_P, n);
    const float much = (settings->noise_margin * variance) * system->weight;
    float excess[PVID_MAX_P][PVID_MAX_P];
#if PVID_MAX_CONSTRAINTS > 0
    float of_noise[PVID_MAX_P][PVID_MAX_P];
    memcpy(of_noise, noise, sizeof of_noise);
    pvid_constraints_project_f32(&system->ties, n, of_noise, NULL);
#else
    const float (*of_noise)[PVID_MAX_P] = noise;
#endif
    for (size_t a = 0; a < count; a++) {
        for (size_t b = a; b < count; b++) {
            excess[a][b] = system->s[a][b] - (much * of_noise[a][b]);
        }
    }
    pvid_cholesky_f32 factor;
    return pvid_cholesky_factor_f32(&factor, n, (const float (*)[PVID_MAX_P])excess);
}

PVID_COLD void pvid_assess_kappa_f32(const pvid_system_f32 *system, const pvid_solve_settings_f32 *settings,
                                     pvid_estimate_f32 *estimate)
{
    const uint8_t n = settings->n_p;
    pvid_cholesky_f32 factor;
    estimate->kappa = 0.0f;
    estimate->least_pivot = 0.0f;
    if (!pvid_cholesky_factor_f32(&factor, n, system->s)) {
        return;
    }
    /* the factor contains 1 / U_jj; diagonal over pivot is (D S D)_jj / U_jj^2 */
    float most = 1.0f;
    for (size_t j = 0; j < n; j++) {
        const float scaled = factor.u[j][j] * factor.scale[j];
        const float inflation = (scaled * scaled) * system->s[j][j];
        most = (inflation > most) ? inflation : most;
    }
    estimate->kappa = factor.first_pivot;
    estimate->least_pivot = 1.0f / most;
}

void pvid_assess_widen_f32(pvid_system_f32 *system, const pvid_solve_settings_f32 *settings, float wide)
{
    for (size_t a = 0; a < settings->n_p; a++) {
        system->s[a][a] += wide / (settings->start_sd[a] * settings->start_sd[a]);
    }
}

static void assess_as_start(const pvid_solve_settings_f32 *settings, pvid_estimate_f32 *estimate)
{
    for (size_t a = 0; a < settings->n_p; a++) {
        for (size_t b = 0; b < settings->n_p; b++) {
            estimate->covariance[a][b] = 0.0f;
        }
        estimate->covariance[a][a] = settings->start_sd[a] * settings->start_sd[a];
        estimate->se[a] = settings->start_sd[a];
    }
}

PVID_COLD void pvid_assess_scale_f32(const pvid_solve_settings_f32 *settings, float wide, bool known,
                                     pvid_estimate_f32 *estimate)
{
    const size_t n_p = settings->n_p;
    for (size_t a = 0; known && (a < n_p); a++) {
        for (size_t b = 0; b < n_p; b++) {
            estimate->covariance[a][b] *= wide;
            known = known && pvid_finite_f32(estimate->covariance[a][b]);
        }
        estimate->se[a] = sqrtf(estimate->covariance[a][a]);
        known = known && pvid_finite_f32(estimate->se[a]);
    }
    if (!known) {
        assess_as_start(settings, estimate);
    }
}

void pvid_assess_f32(pvid_system_f32 *system, const pvid_solve_settings_f32 *settings, pvid_estimate_f32 *estimate)
{
    const float variance = pvid_assess_variance_f32(system, settings);
    const float wide = variance * settings->correlation;
    estimate->weight = system->weight;
    estimate->residual_sd = sqrtf(variance);
    pvid_assess_kappa_f32(system, settings, estimate);
    pvid_cholesky_f32 factor;
    pvid_assess_widen_f32(system, settings, wide);
    const bool known = pvid_cholesky_factor_f32(&factor, settings->n_p, (const float (*)[PVID_MAX_P])system->s);
    if (known) {
        pvid_cholesky_inverse_f32(&factor, estimate->covariance);
#if PVID_MAX_CONSTRAINTS > 0
        pvid_constraints_spread_f32(&system->ties, settings->n_p, estimate->covariance);
#endif
    }
    pvid_assess_scale_f32(settings, wide, known, estimate);
}
