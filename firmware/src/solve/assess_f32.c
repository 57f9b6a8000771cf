#include "number/uncontracted.h"

#include "solve/assess_f32.h"

#include <math.h>
#include <stddef.h>

#include "number/finite_f32.h"

float pvid_estimator_variance_f32(const pvid_estimator_f32 *self, const float sums[], float energy, float floor)
{
    const pvid_model_f32 *model = self->model;
    const float *tail = &sums[model->n_moments + model->n_theta];
    const float yy = tail[0];
    const float freedom = tail[1] - (float)model->n_p;
    if (!(freedom >= 1.0f)) {
        return self->row_variance;
    }
    const float sum = (yy + energy) + self->information.rounding;
    const float residual = (sum <= PVID_RESIDUAL_MAX) ? sum : PVID_RESIDUAL_MAX;
    return ((residual > floor) ? residual : floor) / freedom;
}

void pvid_estimator_set_expected_f32(pvid_estimator_f32 *self, float variance)
{
    float tail[2];
    pvid_information_tail_f32(&self->information, tail);
    const float share = (self->group_weight < tail[1]) ? (self->group_weight / tail[1]) : 1.0f;
    const float clamped = (variance <= PVID_RESIDUAL_MAX) ? variance : PVID_RESIDUAL_MAX;
    if (self->group_weight > 0.0f) {
        self->expected += (clamped - self->expected) * share;
    }
}

float pvid_estimator_misfit_f32(const pvid_estimator_f32 *self, const float sums[])
{
    const float *tail = &sums[self->model->n_moments + self->model->n_theta];
    const float freedom = tail[1] - (float)self->model->n_p;
    const float explained = freedom * self->expected;
    if (!(freedom >= 1.0f) || !(explained > 0.0f) || !(tail[0] > 0.0f)) {
        return 0.0f;
    }
    const float misfit = tail[0] / explained;
    return (misfit <= PVID_RESIDUAL_MAX) ? misfit : PVID_RESIDUAL_MAX;
}

bool pvid_estimator_is_rounded_f32(const pvid_estimator_f32 *self)
{
    float tail[2];
    pvid_information_tail_f32(&self->information, tail);
    return self->information.rounding > tail[0];
}

bool pvid_estimator_is_above_noise_f32(const pvid_estimator_f32 *self, const float s[][PVID_MAX_P], float variance,
                                       float weight)
{
    const pvid_model_f32 *model = self->model;
    if ((model->noise == NULL) || !(self->noise_margin > 0.0f)) {
        return true;
    }
    float rest[PVID_MAX_P][PVID_MAX_P];
    const uint8_t n = pvid_excited_parameters_f32(model);
    const float much = (self->noise_margin * variance) * weight;
    model->noise(self->p, self->noise, rest);
    for (size_t a = 0; a < n; a++) {
        for (size_t b = a; b < n; b++) {
            rest[a][b] = s[a][b] - (much * rest[a][b]);
        }
    }
    pvid_cholesky_f32 factor;
    return pvid_cholesky_factor_f32(&factor, n, (const float (*)[PVID_MAX_P])rest);
}

void pvid_estimator_find_kappa_f32(const pvid_estimator_f32 *self, const float s[][PVID_MAX_P],
                                   pvid_estimate_f32 *estimate)
{
    const uint8_t n = pvid_excited_parameters_f32(self->model);
    pvid_cholesky_f32 factor;
    estimate->kappa = 0.0f;
    estimate->least_pivot = 0.0f;
    if (!pvid_cholesky_factor_f32(&factor, n, s)) {
        return;
    }
    /* the factor contains 1 / U_jj; diagonal over pivot is (D S D)_jj / U_jj^2 */
    float most = 1.0f;
    for (size_t j = 0; j < n; j++) {
        const float scaled = factor.u[j][j] * factor.scale[j];
        const float inflation = (scaled * scaled) * s[j][j];
        most = (inflation > most) ? inflation : most;
    }
    estimate->kappa = factor.first_pivot;
    estimate->least_pivot = 1.0f / most;
}

bool pvid_estimator_factor_wide_f32(const pvid_estimator_f32 *self, float s[][PVID_MAX_P], float wide,
                                    pvid_cholesky_f32 *factor)
{
    const uint8_t n_p = self->model->n_p;
    for (size_t a = 0; a < n_p; a++) {
        s[a][a] += wide / (self->start_sd[a] * self->start_sd[a]);
    }
    return pvid_cholesky_factor_f32(factor, n_p, (const float (*)[PVID_MAX_P])s);
}

bool pvid_estimator_is_in_dead_zone_f32(const pvid_estimator_f32 *self, const pvid_cholesky_f32 *factor,
                                        const float force[], float variance)
{
    float x[PVID_MAX_P];
    float square = 0.0f;
    pvid_cholesky_solve_f32(factor, force, x);
    for (size_t a = 0; a < self->model->n_p; a++) {
        square += force[a] * x[a];
    }
    const float noise = (variance < self->row_variance) ? variance : self->row_variance;
    return square <= (self->dead_zone * (self->correlation * noise));
}

static void assess_as_start(const pvid_estimator_f32 *self, pvid_estimate_f32 *estimate)
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        for (size_t b = 0; b < self->model->n_p; b++) {
            estimate->covariance[a][b] = 0.0f;
        }
        estimate->covariance[a][a] = self->start_sd[a] * self->start_sd[a];
        estimate->se[a] = self->start_sd[a];
    }
}

void pvid_estimator_scale_f32(const pvid_estimator_f32 *self, float wide, bool known, pvid_estimate_f32 *estimate)
{
    const size_t n_p = self->model->n_p;
    for (size_t a = 0; known && (a < n_p); a++) {
        for (size_t b = 0; b < n_p; b++) {
            estimate->covariance[a][b] *= wide;
            known = known && pvid_finite_f32(estimate->covariance[a][b]);
        }
        estimate->se[a] = sqrtf(estimate->covariance[a][a]);
        known = known && pvid_finite_f32(estimate->se[a]);
    }
    if (!known) {
        assess_as_start(self, estimate);
    }
}
