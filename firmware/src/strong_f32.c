#include "pvid/strong.h"

#include <stddef.h>
#include <string.h>

#include "count.h"
#include "finite_f32.h"

pvid_status pvid_strong_init_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config)
{
    PVID_ASSERT((self != NULL) && (config != NULL));
    if (!pvid_within_f32(config->l1, 1.0e-6f, 1.0e6f)) {
        return PVID_BAD_LENGTH;
    }
    if (!pvid_within_f32(config->drive_min, 0.0f, 1.0e9f)) {
        return PVID_BAD_DRIVE_MIN;
    }
    memset(self, 0, sizeof *self);
    pvid_status status = pvid_differentiator_init_f32(&self->phi, &config->bank, config->sample_rate_hz);
    if (status != PVID_OK) {
        return status;
    }
    status = pvid_differentiator_init_f32(&self->y, &config->bank, config->sample_rate_hz);
    if (status != PVID_OK) {
        return status;
    }
    self->inverse_l1 = 1.0f / config->l1;
    self->drive_forgetting = (config->sample_rate_hz > 1.0f) ? (1.0f / config->sample_rate_hz) : 1.0f;
    self->drive_min = config->drive_min * config->drive_min;
    pvid_estimator_config_f32 estimator = config->estimator;
    estimator.model = &pvid_kapitza_strong_f32;
    estimator.update_rate_hz = config->sample_rate_hz;
    return pvid_estimator_init_f32(&self->estimator, &estimator);
}

void pvid_strong_gap_f32(pvid_strong_f32 *self)
{
    pvid_differentiator_reset_f32(&self->phi);
    pvid_differentiator_reset_f32(&self->y);
}

pvid_reason pvid_strong_step_f32(pvid_strong_f32 *self, float phi, float y)
{
    if (!pvid_finite_f32(phi) || !pvid_finite_f32(y)) {
        pvid_strong_gap_f32(self);
        pvid_count_up(&self->estimator.counters.rejected_not_finite);
        return PVID_REJECTED_NOT_FINITE;
    }
    float d_phi[PVID_ORDERS];
    float d_y[PVID_ORDERS];
    const bool phi_ready = pvid_differentiator_step_f32(&self->phi, phi, d_phi);
    const bool y_ready = pvid_differentiator_step_f32(&self->y, y, d_y);
    if (!phi_ready || !y_ready) {
        return PVID_WARMING_UP;
    }
    const float u[3] = {d_y[2] * self->inverse_l1, d_y[3] * self->inverse_l1, d_y[4] * self->inverse_l1};
    const float drive = self->drive + (self->drive_forgetting * ((u[0] * u[0]) - self->drive));
    self->drive = pvid_finite_f32(drive) ? drive : self->drive;
    if (self->drive < self->drive_min) {
        pvid_count_up(&self->estimator.counters.held_not_excited);
        return PVID_HELD_NOT_EXCITED;
    }
    float n[PVID_KAPITZA_STRONG_THETA];
    float row_y;
    pvid_kapitza_strong_row_f32(d_phi, u, &row_y, n);
    return pvid_estimator_step_f32(&self->estimator, n, row_y);
}
