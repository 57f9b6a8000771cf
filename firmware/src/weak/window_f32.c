#include "number/uncontracted.h"

#include "weak/window_f32.h"

#include <string.h>

#include "number/unroll.h"

enum { UF = 0, F = 1, U = 2 }; /* integrands */

/* Statistics of the window: drive, offset, range, curvature. */
static inline void observe(pvid_weak_window_f32 *self, float phi, float u, const pvid_weak_curvature_f32 *curvature)
{
    const bool first = self->index == 0u;
    const float curvature_square = curvature->due ? curvature->square : 0.0f;
    self->u_sum = (first ? 0.0f : self->u_sum) + u;
    self->u_square_sum = (first ? 0.0f : self->u_square_sum) + (u * u);
    self->phi_sum = (first ? 0.0f : self->phi_sum) + phi;
    self->lowest = (first || (phi < self->lowest)) ? phi : self->lowest;
    self->highest = (first || (phi > self->highest)) ? phi : self->highest;
    self->curvature_square_sum = (first ? 0.0f : self->curvature_square_sum) + curvature_square;
    self->curvatures = (uint16_t)((first ? 0u : self->curvatures) + (curvature->due ? 1u : 0u));
}

/* The double integral of integrand i up to now, minus the trapezoid rule's error. */
static inline float integrate(pvid_weak_window_f32 *self, size_t i, float now, float half_dt, float correction)
{
    const bool first = self->index == 0u;
    const float once = self->once[i] + ((self->before[i] + now) * half_dt);
    const float twice = self->twice[i] + ((self->once[i] + once) * half_dt);
    self->once[i] = first ? 0.0f : once;
    self->twice[i] = first ? 0.0f : twice;
    self->before[i] = now;
    return twice - (correction * now);
}

void pvid_weak_window_terms_f32(pvid_weak_window_f32 *self, uint16_t samples, float dt, float phi, float u,
                                const pvid_weak_curvature_f32 *curvature, float term[PVID_WEAK_SAMPLE_TERMS])
{
    const float half_dt = 0.5f * dt;
    const float correction = (dt * dt) / 6.0f;
    const float u_phi = u * phi;
    const float i2_uf = integrate(self, UF, u_phi, half_dt, correction);
    const float i2_f = integrate(self, F, phi, half_dt, correction);
    const float i2_u = integrate(self, U, u, half_dt, correction);
    observe(self, phi, u, curvature);
    if (self->index == 0u) { /* chi is 0, but 0 times infinity would not be 0 */
        memset(term, 0, PVID_WEAK_SAMPLE_TERMS * sizeof term[0]);
        return;
    }
    const float steps = (float)self->index;
    const float i2_one = (dt * dt) * ((0.5f * (steps * steps)) - (1.0f / 6.0f));
    const float t = dt * (steps - (0.5f * (float)(samples - 1u)));
    term[PVID_TERM_UF] = -u_phi;
    term[PVID_TERM_F] = -phi;
    term[PVID_TERM_UIUF] = -(u * i2_uf);
    term[PVID_TERM_UIF] = -(u * i2_f);
    term[PVID_TERM_UIU] = u * i2_u;
    term[PVID_TERM_UI1] = u * i2_one;
    term[PVID_TERM_U] = u;
    term[PVID_TERM_UT] = u * t;
}

/* Without the window's last sample, which is the first of the next window. */
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

float pvid_weak_window_max_deviation_f32(const pvid_weak_window_f32 *self, float offset)
{
    const float up = self->highest - offset;
    const float down = offset - self->lowest;
    return (up > down) ? up : down;
}

float pvid_weak_window_curvature_f32(const pvid_weak_window_f32 *self)
{
    return (self->curvatures > 0u) ? (self->curvature_square_sum / (float)self->curvatures) : 0.0f;
}

/* chi, chi'' and chi'''' of a function at a sample. */
typedef struct {
    float chi0;
    float chi2;
    float chi4;
} chi_values;

static inline chi_values values_of(const float row[], size_t functions, size_t k)
{
    const chi_values of = {row[k], row[functions + k], row[(2u * functions) + k]};
    return of;
}

/* A sum with the products of two samples, one after the other. */
static inline float plus_two(float sum, float a, float x, float b, float z)
{
    return (sum + (a * x)) + (b * z);
}

/* Adds two samples, x and then z, to the sums of a function. The term of Y is phi, that is -F. */
static inline void add_two(const float *restrict x, chi_values a, const float *restrict z, chi_values b,
                           float *restrict sum)
{
    PVID_UNROLL
    for (size_t i = 0; i < PVID_WEAK_SAMPLE_TERMS; i++) {
        sum[i] = plus_two(sum[i], a.chi2, x[i], b.chi2, z[i]);
    }
    sum[PVID_TERM_CHI_UF] = plus_two(sum[PVID_TERM_CHI_UF], a.chi0, x[PVID_TERM_UF], b.chi0, z[PVID_TERM_UF]);
    sum[PVID_TERM_CHI_F] = plus_two(sum[PVID_TERM_CHI_F], a.chi0, x[PVID_TERM_F], b.chi0, z[PVID_TERM_F]);
    sum[PVID_TERM_CHI_U] = plus_two(sum[PVID_TERM_CHI_U], a.chi0, x[PVID_TERM_U], b.chi0, z[PVID_TERM_U]);
    sum[PVID_TERM_CHI_1] = (sum[PVID_TERM_CHI_1] + a.chi0) + b.chi0;
    sum[PVID_TERM_Y] = (sum[PVID_TERM_Y] - (a.chi4 * x[PVID_TERM_F])) - (b.chi4 * z[PVID_TERM_F]);
}

void pvid_weak_window_add_f32(const pvid_weak_window_f32 *self, const pvid_weak_design_f32 *design,
                              const float term[2][PVID_WEAK_SAMPLE_TERMS], size_t first, size_t last,
                              float sums[][PVID_WEAK_TERMS])
{
    static const float no_weight[3 * PVID_MAX_FUNCTIONS]; /* chi of the window's first sample: 0 */
    const size_t functions = design->functions;
    const size_t index = self->index;
    if (index == 0u) {
        memset(&sums[first], 0, (last - first) * sizeof sums[0]);
    }
    if ((index % 2u) == 0u) {
        return;
    }
    const float *now = &design->chi[3u * functions * index];
    const float *before = (index > 1u) ? (now - (3u * functions)) : no_weight;
    for (size_t k = first; k < last; k++) {
        add_two(term[0], values_of(before, functions, k), term[1], values_of(now, functions, k), sums[k]);
    }
}
