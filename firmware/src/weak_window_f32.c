#include "weak_window_f32.h"

#include <string.h>

#include "unroll.h"

enum { UF = 0, F = 1, U = 2 }; /* integrands */

#define ON_CHI2 8u /* terms that chi'' multiplies, then those of chi, then the one of chi'''' */
#define ON_CHI0 4u

/* What is known of the window as a whole: drive, zero, range, curvature. */
static inline void observe(pvid_weak_window_f32 *self, float phi, float u, const pvid_weak_bend_f32 *bend)
{
    const bool first = self->index == 0u;
    const float bend_square = bend->due ? bend->square : 0.0f;
    self->u_sum = (first ? 0.0f : self->u_sum) + u;
    self->u_square_sum = (first ? 0.0f : self->u_square_sum) + (u * u);
    self->phi_sum = (first ? 0.0f : self->phi_sum) + phi;
    self->lowest = (first || (phi < self->lowest)) ? phi : self->lowest;
    self->highest = (first || (phi > self->highest)) ? phi : self->highest;
    self->bend_square_sum = (first ? 0.0f : self->bend_square_sum) + bend_square;
    self->bends = (uint16_t)((first ? 0u : self->bends) + (bend->due ? 1u : 0u));
}

void pvid_weak_window_terms_f32(pvid_weak_window_f32 *self, uint16_t samples, float dt, float phi, float u,
                                const pvid_weak_bend_f32 *bend, float term[PVID_WEAK_TERMS])
{
    const float half_dt = 0.5f * dt;
    const float correction = (dt * dt) / 6.0f;
    const float now[PVID_WEAK_INTEGRALS] = {u * phi, phi, u};
    float integral[PVID_WEAK_INTEGRALS];
    const bool first = self->index == 0u;
    for (size_t i = 0; i < PVID_WEAK_INTEGRALS; i++) {
        const float once = self->once[i] + ((self->before[i] + now[i]) * half_dt);
        const float twice = self->twice[i] + ((self->once[i] + once) * half_dt);
        self->once[i] = first ? 0.0f : once;
        self->twice[i] = first ? 0.0f : twice;
        self->before[i] = now[i];
        integral[i] = twice - (correction * now[i]);
    }
    observe(self, phi, u, bend);
    const float steps = (float)self->index;
    const float i2_one = (dt * dt) * ((0.5f * (steps * steps)) - (1.0f / 6.0f));
    const float t = dt * (steps - (0.5f * (float)(samples - 1u)));
    term[PVID_TERM_UF] = -now[UF];
    term[PVID_TERM_F] = -phi;
    term[PVID_TERM_UIUF] = -(u * integral[UF]);
    term[PVID_TERM_UIF] = -(u * integral[F]);
    term[PVID_TERM_UIU] = u * integral[U];
    term[PVID_TERM_UI1] = u * i2_one;
    term[PVID_TERM_U] = u;
    term[PVID_TERM_UT] = u * t;
    term[PVID_TERM_CHI_UF] = -now[UF];
    term[PVID_TERM_CHI_F] = -phi;
    term[PVID_TERM_CHI_U] = u;
    term[PVID_TERM_CHI_1] = 1.0f;
    term[PVID_TERM_Y] = phi;
}

/* The last sample counts for the next window. */
float pvid_weak_window_drive_f32(const pvid_weak_window_f32 *self, uint16_t samples)
{
    const float n = (float)(samples - 1u);
    const float mean = self->u_sum / n;
    return (self->u_square_sum / n) - (mean * mean);
}

float pvid_weak_window_mean_f32(const pvid_weak_window_f32 *self, uint16_t samples)
{
    return self->phi_sum / (float)(samples - 1u);
}

float pvid_weak_window_reach_f32(const pvid_weak_window_f32 *self, float zero)
{
    const float up = self->highest - zero;
    const float down = zero - self->lowest;
    return (up > down) ? up : down;
}

float pvid_weak_window_bend_f32(const pvid_weak_window_f32 *self)
{
    return (self->bends > 0u) ? (self->bend_square_sum / (float)self->bends) : 0.0f;
}

static inline void add_function(const float *restrict term, float chi0, float chi2, float chi4, float *restrict sum)
{
    PVID_UNROLL
    for (size_t i = 0; i < ON_CHI2; i++) {
        sum[i] += chi2 * term[i];
    }
    PVID_UNROLL
    for (size_t i = ON_CHI2; i < ON_CHI2 + ON_CHI0; i++) {
        sum[i] += chi0 * term[i];
    }
    sum[PVID_TERM_Y] += chi4 * term[PVID_TERM_Y];
}

void pvid_weak_window_add_f32(const pvid_weak_window_f32 *self, const pvid_weak_design_f32 *design,
                              const float term[PVID_WEAK_TERMS], size_t first, size_t last,
                              float sums[][PVID_WEAK_TERMS])
{
    const size_t functions = design->functions;
    const float *chi = &design->chi[3u * functions * self->index];
    if (self->index == 0u) {
        memset(&sums[first], 0, (last - first) * sizeof sums[0]);
        return;
    }
    for (size_t k = first; k < last; k++) {
        add_function(term, chi[k], chi[functions + k], chi[(2u * functions) + k], sums[k]);
    }
}
