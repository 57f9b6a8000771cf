#include "longevity.h"

#include <math.h>
#include <string.h>

/* Of the full equations, in the angles from the vertical a1, a2 and their rates. */
static void full_rate(const double x[4], const double p[2], double g, double dx[4])
{
    const double l2 = (p[0] - p[1]) - 1.0; /* L2 */
    const double a2 = x[0] + x[1];
    const double v2 = x[2] + x[3];
    const double s = sin(x[1]);
    const double c = cos(x[1]);
    const double b1 = (((l2 / p[1]) * s) * (v2 * v2)) - (g * sin(x[0]));
    const double b2 = (-s * (x[2] * x[2])) - (g * sin(a2));
    const double det = (1.0 / l2) + (s * s);
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = (((1.0 + (1.0 / l2)) * b1) - (c * b2)) / det;
    dx[3] = (((b2 - (c * b1)) / det) * (p[1] / l2)) - dx[2];
}

static void rate(bool full, const double x[4], const double p[2], double g, double dx[4])
{
    if (full) {
        full_rate(x, p, g, dx);
        return;
    }
    const double l2 = (p[0] - p[1]) - 1.0; /* L2 */
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = (-g * x[0]) + (l2 * g * x[1]);
    dx[3] = (g * x[0]) - ((p[0] - 1.0) * g * x[1]);
}

void longevity_motion(bool full, double x[4], uint32_t ticks, double step, const double p[2], const double w[],
                      const double u[], double phi[])
{
    for (uint32_t tick = 0; tick < ticks; tick++) {
        double k[4][4];
        double part[4];
        phi[tick] = x[1];
        rate(full, x, p, w[tick] + u[2u * tick], k[0]);
        for (int stage = 1; stage < 4; stage++) {
            const double ahead = (stage == 3) ? step : (0.5 * step);
            for (int i = 0; i < 4; i++) {
                part[i] = x[i] + (ahead * k[stage - 1][i]);
            }
            rate(full, part, p, w[tick] + u[(2u * tick) + ((stage == 3) ? 2u : 1u)], k[stage]);
        }
        for (int i = 0; i < 4; i++) {
            x[i] += (step / 6.0) * (k[0][i] + (2.0 * k[1][i]) + (2.0 * k[2][i]) + k[3][i]);
        }
    }
}

const uint32_t longevity_peer_bytes = sizeof(longevity_peer);

bool longevity_peer_init(longevity_peer *self, bool factored, float lambda, const pvid_fir_bank_f32 *bank,
                         float sample_rate_hz, float l1, const float theta[], float y_scale)
{
    memset(self, 0, sizeof *self);
    self->factored = factored;
    self->inverse_l1 = 1.0f / l1;
    self->y_scale = y_scale;
    memcpy(self->scale, theta, sizeof self->scale);
    rls_init_f32(&self->rls, lambda, 100.0f);
    ud_init_f32(&self->ud, lambda, 100.0f);
    return (pvid_differentiator_init_f32(&self->phi, bank, sample_rate_hz) == PVID_OK) &&
           (pvid_differentiator_init_f32(&self->y, bank, sample_rate_hz) == PVID_OK);
}

static bool estimate_is_finite(const float theta[])
{
    bool finite = true;
    for (int i = 0; i < PVID_KAPITZA_STRONG_THETA; i++) {
        finite = finite && isfinite(theta[i]);
    }
    return finite;
}

/* One sample; returns whether the estimate is still a number. */
static bool step(longevity_peer *self, float phi, float y)
{
    if (!isfinite(phi) || !isfinite(y)) {
        pvid_differentiator_reset_f32(&self->phi);
        pvid_differentiator_reset_f32(&self->y);
        return true;
    }
    float d_phi[PVID_ORDERS];
    float d_y[PVID_ORDERS];
    const bool ready = pvid_differentiator_step_f32(&self->phi, phi, d_phi);
    if (!pvid_differentiator_step_f32(&self->y, y, d_y) || !ready) {
        return true;
    }
    const float u[3] = {d_y[2] * self->inverse_l1, d_y[3] * self->inverse_l1, d_y[4] * self->inverse_l1};
    float n[PVID_KAPITZA_STRONG_THETA];
    float row_y;
    pvid_kapitza_strong_row_f32(d_phi, u, &row_y, n);
    for (int i = 0; i < PVID_KAPITZA_STRONG_THETA; i++) {
        n[i] *= self->scale[i] / self->y_scale;
    }
    if (self->factored) {
        ud_step_f32(&self->ud, n, row_y / self->y_scale);
        return estimate_is_finite(self->ud.theta);
    }
    rls_step_f32(&self->rls, n, row_y / self->y_scale);
    return estimate_is_finite(self->rls.theta);
}

uint32_t longevity_peer_run(longevity_peer *self, uint32_t ticks, const float phi[], const float y[])
{
    uint32_t tick = 0;
    while ((tick < ticks) && step(self, phi[tick], y[tick])) {
        tick++;
    }
    return tick;
}

float longevity_peer_w(const longevity_peer *self)
{
    return (self->factored ? self->ud.theta[0] : self->rls.theta[0]) * self->scale[0];
}
