#include "number/uncontracted.h"

#include "pvid/strong.h"

#include <stddef.h>
#include <string.h>

#include "number/init.h"
#include "number/count.h"
#include "strong/differentiator_f32.h"
#include "solve/state_f32.h"
#include "number/finite_f32.h"
#include "kapitza_row_f32.h"
#include "kapitza_strong_f32.h"
#include "judge/misfit_f32.h"

/* The gate's scale averages over about a period of the faster mode, because row_sd is only a guess. */
#define GATE_MEMORY_S 0.25f
#define GATE_FLOOR 1.0e-6f

/* Whether init has accepted a configuration. */
static inline bool is_ready(const pvid_strong_f32 *self)
{
    const bool ready = (self != NULL) && (self->estimator.model != NULL);
    PVID_ASSERT(ready);
    return ready;
}

static pvid_status prepare(pvid_strong_f32 *self, const pvid_strong_config_f32 *config)
{
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
    status = pvid_estimator_init_f32(&self->estimator, &estimator);
    if (status != PVID_OK) {
        return status;
    }
    pvid_misfit_init_f32(&self->misfit, config->sample_rate_hz, config->estimator.forgetting_s);
    return pvid_gate_init_f32(&self->gate, &config->gate, config->sample_rate_hz,
                              GATE_MEMORY_S * config->sample_rate_hz,
                              GATE_FLOOR * self->estimator.settings.row_variance);
}

pvid_status pvid_strong_init_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config)
{
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

void pvid_strong_freeze_f32(pvid_strong_f32 *self, bool frozen)
{
    if (is_ready(self)) {
        self->frozen = frozen;
    }
}

static void restart(pvid_strong_f32 *self)
{
    pvid_differentiator_reset_f32(&self->phi);
    pvid_differentiator_reset_f32(&self->y);
}

void pvid_strong_gap_f32(pvid_strong_f32 *self)
{
    if (is_ready(self)) {
        restart(self);
    }
}

/* Stores a sample of each channel and, if the windows are full, writes their derivatives. Both windows have the same
 * bank and the same fill: one loop serves both. */
static inline bool differentiate(pvid_strong_f32 *self, float phi, float y, float d_phi[PVID_ORDERS],
                                 float d_y[PVID_ORDERS])
{
    const bool y_ready = pvid_fir_push_f32(&self->y, y);
    if (!pvid_fir_push_f32(&self->phi, phi) || !y_ready) {
        return false;
    }
    const size_t half = self->phi.bank.half;
    const float *weight = self->phi.bank.weights;
    const float *phis = self->phi.history;
    const float *ys = self->y.history;
    pvid_fir_walk at = pvid_fir_centre_f32(&self->phi);
    const float phi_middle = phis[at.newer];
    const float y_middle = ys[at.newer];
    pvid_fir_outwards(&at);
    pvid_fir_sums_f32 phi_sums = pvid_fir_begin_f32(weight, half, phi_middle, phis[at.newer], phis[at.older]);
    pvid_fir_sums_f32 y_sums = pvid_fir_begin_f32(weight, half, y_middle, ys[at.newer], ys[at.older]);
    for (size_t i = 1; i < half; i++) {
        pvid_fir_outwards(&at);
        pvid_fir_add_f32(&phi_sums, &weight[i], half, phis[at.newer], phis[at.older]);
        pvid_fir_add_f32(&y_sums, &weight[i], half, ys[at.newer], ys[at.older]);
    }
    pvid_fir_end_f32(&self->phi, &phi_sums, d_phi);
    pvid_fir_end_f32(&self->y, &y_sums, d_y);
    return true;
}

/* Judges a row, adds it if the gate accepts it, and solves. */
static inline pvid_reason take_row(pvid_strong_f32 *self, const float n[PVID_KAPITZA_STRONG_THETA], float y)
{
    pvid_estimator_f32 *estimator = &self->estimator;
    float gradient[PVID_MAX_P];
    const float e = estimator->model->innovate(estimator->p, n, y, gradient);
    if (pvid_misfit_add_f32(&self->misfit, e, gradient[PVID_KAPITZA_W] * estimator->p[PVID_KAPITZA_W])) {
        self->alarm = pvid_misfit_judge_f32(&self->misfit);
    }
    if (!pvid_gate_passes_f32(&self->gate, e * e)) {
        pvid_count_up(&estimator->counters.rejected_outlier);
        return PVID_REJECTED_OUTLIER;
    }
    const pvid_reason reason = pvid_kapitza_take_row_f32(estimator, n, y, e, gradient, true);
    if ((reason != PVID_UPDATED) || !self->alarm) {
        return reason;
    }
    pvid_count_up(&estimator->counters.misfits);
    return PVID_MISFIT;
}

pvid_reason pvid_strong_step_f32(pvid_strong_f32 *self, float phi, float y)
{
    if (!is_ready(self)) {
        return PVID_NOT_READY;
    }
    if (!pvid_finite_f32(phi) || !pvid_finite_f32(y)) {
        restart(self);
        pvid_count_up(&self->estimator.counters.rejected_not_finite);
        return PVID_REJECTED_NOT_FINITE;
    }
    float d_phi[PVID_ORDERS];
    float d_y[PVID_ORDERS];
    if (!differentiate(self, phi, y, d_phi, d_y)) {
        return PVID_WARMING_UP;
    }
    const float u[3] = {d_y[2] * self->inverse_l1, d_y[3] * self->inverse_l1, d_y[4] * self->inverse_l1};
    const float drive = self->drive + (self->drive_forgetting * ((u[0] * u[0]) - self->drive));
    self->drive = pvid_finite_f32(drive) ? drive : self->drive;
    if (self->frozen) {
        return PVID_HELD_FROZEN;
    }
    if (self->drive < self->drive_min) {
        pvid_count_up(&self->estimator.counters.held_not_excited);
        return PVID_HELD_NOT_EXCITED;
    }
    float n[PVID_KAPITZA_STRONG_THETA];
    float row_y;
    pvid_kapitza_row_f32(d_phi, u, &row_y, n);
    return take_row(self, n, row_y);
}
