#include "number/uncontracted.h"

#include "number/short_loops.h"

/* The sums S_h of a kind's residual Y - sum theta_j N_j have independent noise in their real and imaginary parts, of
 * variance
 *
 *   D_h = W_h sum_j c_j omega_h^(2 j),   W_0 = 2 hop, else hop,   c_j = sum factor theta_a theta_b  (theta_Y = -1)
 *
 * with the equation's own error, white noise of variance v differentiated m times, as a part v of c_m. The K test
 * functions sin^n(pi t/T) cos and sin(2 pi f t/T) are K combinations T of the K + n parts: real ones at h = 0..(K +
 * n)/2, imaginary ones at h = 1..(K - 1)/2 + n/2. Their covariance T diag(D) T^T is too ill-conditioned for float32:
 * its condition number is (K/pi)^(2 n). But the directions that this matrix T leaves out are known: an n-th difference
 * of a polynomial below degree n is 0. So the parts over their standard deviations, without their components along
 *
 *   h^(2 k) / sqrt(D_h) of the real parts,   h^(2 k + 1) / sqrt(D_h) of the imaginary parts,   k = 0..n/2 - 1,
 *
 * are the white rows, up to a rotation. n/2 reflections of each family turn these directions into its first n/2 parts;
 * what is behind them are K white rows. u_k are the directions made orthonormal, by three-term recurrence:
 *
 *   y_(k+1) = (h/H)^2 u_k - a_k u_k - |y_k| u_(k-1),   a_k = u_k^T (h/H)^2 u_k,   u_(k+1) = y_(k+1) / |y_(k+1)|
 *
 *   Q_j = tr(R^-1 dR/dc_j) = sum over the parts of W_h omega_h^(2 j) (1 - sum_k u_kh^2) / D_h
 */
#include "weak/white_f32.h"

#include <math.h>
#include <string.h>

#include "number/exact.h"

#define TURN 6.28318531f

/* Least D_h relative to the mean of all, and least D_h. */
#define FLOOR 1.0e-10f
#define SPECTRUM_MIN 1.0e-30f

void pvid_weak_white_init_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, float dt)
{
    const size_t half = design->power / 2u;
    self->cosines = (uint8_t)((design->functions / 2u) + half + 1u);
    self->parts = (uint8_t)(design->functions + design->power);
    self->vectors = (uint8_t)half;
    self->omega = TURN / (2.0f * ((float)design->hop * dt));
    self->powers = 1;
    for (size_t i = 0; i < design->n_noise; i++) {
        const uint8_t powers = (uint8_t)(design->noise[i].power + 1u);
        self->powers = (powers > self->powers) ? powers : self->powers;
    }
    for (size_t kind = 0; kind < design->model->kinds; kind++) {
        const uint8_t powers = (uint8_t)(design->error_order[kind] + 1u);
        self->powers = (powers > self->powers) ? powers : self->powers;
    }
}

static float theta_of(const pvid_weak_design_f32 *design, uint8_t kind, const float theta[], uint8_t column)
{
    return (column < design->model->kind[kind].thetas) ? theta[column] : -1.0f;
}

void pvid_weak_white_weigh_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                               const float theta[], size_t first, size_t last)
{
    if (first == 0u) {
        memset(self->weight, 0, sizeof self->weight);
    }
    for (size_t i = first; i < last; i++) {
        const pvid_weak_noise_f32 *one = &design->noise[i];
        if (one->kind == kind) {
            const float a = theta_of(design, kind, theta, one->a);
            const float b = theta_of(design, kind, theta, one->b);
            self->weight[one->power] += one->factor * (a * b);
        }
    }
}

/* W_h */
static float samples_of(const pvid_weak_design_f32 *design, size_t harmonic)
{
    return (harmonic == 0u) ? (2.0f * (float)design->hop) : (float)design->hop;
}

/* c[0] + c[1] x + c[2] x^2 .. */
static float polynomial_of(const float c[], size_t powers, float x)
{
    float sum = 0.0f;
    for (size_t j = powers; j > 0u; j--) {
        sum = (sum * x) + c[j - 1u];
    }
    return sum;
}

void pvid_weak_white_spectrum_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                                  uint8_t harmonics)
{
    float mean = 0.0f;
    float c[PVID_MAX_POWER]; /* of the sensors and the equation */
    for (size_t j = 0; j < self->powers; j++) {
        c[j] = self->weight[j];
    }
    c[design->error_order[kind]] += design->error_variance[kind];
    for (size_t h = 0; h < harmonics; h++) {
        const float rate = (float)h * self->omega;
        self->scale[h] = samples_of(design, h) * polynomial_of(c, self->powers, rate * rate);
        mean += self->scale[h];
    }
    const float part = (FLOOR * mean) / (float)harmonics;
    self->floor = (part > SPECTRUM_MIN) ? part : SPECTRUM_MIN;
}

void pvid_weak_white_scale_f32(pvid_weak_white_f32 *self, uint8_t harmonics)
{
    for (size_t h = 0; h < harmonics; h++) {
        self->scale[h] = 1.0f / sqrtf((self->scale[h] > self->floor) ? self->scale[h] : self->floor);
    }
}

static inline size_t cosines_of(const pvid_weak_white_f32 *self)
{
    return PVID_COUNT(PVID_MAX_HARMONICS, self->cosines);
}

static inline size_t parts_of(const pvid_weak_white_f32 *self)
{
    return PVID_COUNT(PVID_MAX_FUNCTIONS + PVID_MAX_POWER, self->parts);
}

static inline size_t harmonic_of(const pvid_weak_white_f32 *self, size_t part)
{
    return (part < self->cosines) ? part : ((part + 1u) - self->cosines);
}

/* First part of a family, and the place behind its last one. */
static inline size_t family_first(const pvid_weak_white_f32 *self, size_t family)
{
    return (family == 0u) ? 0u : cosines_of(self);
}

static inline size_t family_end(const pvid_weak_white_f32 *self, size_t family)
{
    return (family == 0u) ? cosines_of(self) : parts_of(self);
}

/* x -= v (v^T x) from `first` to `end` - 1 */
static inline void reflect(const float *restrict v, size_t first, size_t end, float *restrict x)
{
    float along = 0.0f;
    for (size_t i = first; i < end; i++) {
        along += v[i] * x[i];
    }
    for (size_t i = first; i < end; i++) {
        x[i] -= along * v[i];
    }
}

/* All reflections of a family, one after the other: as `reflect`, written out in a build for one design. */
static inline void reflect_family(const pvid_weak_white_f32 *self, size_t family, float x[])
{
    const size_t vectors = PVID_COUNT(PVID_MAX_POWER / 2, self->vectors);
    const size_t end = family_end(self, family);
    PVID_UNROLL_EXACT
    for (size_t k = 0; k < vectors; k++) {
        const float *v = self->reflection[k];
        float along = 0.0f;
        PVID_UNROLL_EXACT
        for (size_t i = family_first(self, family) + k; i < end; i++) {
            along += v[i] * x[i];
        }
        PVID_UNROLL_EXACT
        for (size_t i = family_first(self, family) + k; i < end; i++) {
            x[i] -= along * v[i];
        }
    }
}

void pvid_weak_white_reflect_f32(const pvid_weak_white_f32 *self, size_t family, float x[])
{
    if (family == 0u) {
        reflect_family(self, 0, x);
    } else {
        reflect_family(self, 1, x);
    }
}

/* Puts in place of x, from `first` on, v with v^T v = 2, such that x - v (v^T x) has nothing behind its first entry. */
static void form(float *x, size_t first, size_t end)
{
    float square = 0.0f;
    for (size_t i = first; i < end; i++) {
        square += x[i] * x[i];
    }
    const float size = sqrtf(square);
    const float head = x[first];
    const bool negative = head < 0.0f;
    const float scale = 1.0f / sqrtf(size * (size + (negative ? -head : head)));
    x[first] = negative ? (head - size) : (head + size);
    for (size_t i = first; i < end; i++) {
        x[i] *= scale;
    }
}

/* The next orthonormal direction of a family, the first one if k is 0. */
static void direct(const pvid_weak_white_f32 *self, size_t k, size_t family, pvid_weak_basis_f32 *basis)
{
    const size_t first = family_first(self, family);
    const size_t end = family_end(self, family);
    const float unit = 1.0f / (float)(self->cosines - 1u);
    const float least = (family == 0u) ? 0.0f : 1.0f; /* its first harmonic */
    const float *scale = &self->scale[family];
    const float norm = basis->norm[family];
    const float slope = basis->slope[family];
    float *u = basis->direction;
    float *before = basis->before;
    float square = 0.0f;
    float h = least;
    for (size_t i = first; i < end; i++) {
        const float x = h * unit;
        const float last = u[i];
        float y = scale[i - first];
        if (k > 0u) {
            y = (((x * x) - slope) * last) - (norm * before[i]);
        } else if (family > 0u) {
            y *= x;
        } else {
            /* of h^0 */
        }
        before[i] = (k > 0u) ? last : 0.0f;
        u[i] = y;
        square += y * y;
        h += 1.0f;
    }
    const float size = sqrtf(square);
    const float inverse = 1.0f / size;
    float moment = 0.0f;
    h = least;
    for (size_t i = first; i < end; i++) {
        const float x = h * unit;
        const float one = u[i] * inverse;
        const float part = one * one;
        u[i] = one;
        basis->leverage[i] = (k > 0u) ? (basis->leverage[i] + part) : part;
        moment += (x * x) * part;
        h += 1.0f;
    }
    basis->norm[family] = size;
    basis->slope[family] = moment;
}

/* Direction k takes four stages: for each family it is found, then for each its reflection. */
void pvid_weak_white_basis_f32(pvid_weak_white_f32 *self, size_t stage, pvid_weak_basis_f32 *basis)
{
    const size_t k = stage / 4u;
    const size_t family = stage % 2u;
    if ((stage % 4u) < 2u) {
        direct(self, k, family, basis);
        return;
    }
    const size_t first = family_first(self, family);
    const size_t end = family_end(self, family);
    float *own = self->reflection[k];
    for (size_t i = first; i < end; i++) {
        own[i] = basis->direction[i];
    }
    for (size_t j = 0; j < k; j++) {
        reflect(self->reflection[j], first + j, end, own);
    }
    form(own, first + k, end);
}

void pvid_weak_white_share_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, const float leverage[],
                               size_t first, size_t last)
{
    if (first == 0u) {
        memset(self->share, 0, sizeof self->share);
    }
    for (size_t i = first; i < last; i++) {
        const size_t h = harmonic_of(self, i);
        const float rate = (float)h * self->omega;
        const float square = rate * rate;
        float weight = samples_of(design, h) * ((1.0f - leverage[i]) * (self->scale[h] * self->scale[h]));
        for (size_t j = 0; j < self->powers; j++) {
            self->share[j] += weight;
            weight *= square;
        }
    }
}

void pvid_weak_white_pull_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                              const float theta[], size_t first, size_t last, float g[])
{
    const uint8_t thetas = design->model->kind[kind].thetas;
    for (size_t i = first; i < last; i++) {
        const pvid_weak_noise_f32 *one = &design->noise[i];
        if (one->kind == kind) {
            const float half = (0.5f * one->factor) * self->share[one->power];
            if (one->a < thetas) {
                g[one->a] += half * theta_of(design, kind, theta, one->b);
            }
            if (one->b < thetas) {
                g[one->b] += half * theta_of(design, kind, theta, one->a);
            }
        }
    }
}

float pvid_weak_white_sensors_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design)
{
    float sum = 0.0f;
    for (size_t j = 0; j < self->powers; j++) {
        sum += self->weight[j] * self->share[j];
    }
    return sum / (float)design->functions;
}
