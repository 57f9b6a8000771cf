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
 *
 * An entry of the noise table is a share of the variance D_h of the rows, and likewise the covariance that noise alone
 * has in two columns a and b, over theta_a theta_b. In white rows its sum is factor Q_j; half of it is each of (a, b)
 * and (b, a) if they differ. */
#include "weak/white_f32.h"

#include <math.h>
#include <string.h>

#include "number/exact.h"

#define TURN 6.28318531f

/* Least D_h relative to the mean of all, and least D_h. */
#define FLOOR 1.0e-10f
#define SPECTRUM_MIN 1.0e-30f

PVID_COLD void pvid_weak_white_init_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, float dt)
{
    self->omega = TURN / (2.0f * ((float)design->hop * dt));
    uint8_t highest = 0;
    for (size_t i = 0; i < design->n_noise; i++) {
        highest = (design->noise[i].power > highest) ? design->noise[i].power : highest;
    }
    for (size_t kind = 0; kind < design->model->kinds; kind++) {
        highest = (design->error_order[kind] > highest) ? design->error_order[kind] : highest;
    }
    self->powers = (uint8_t)(highest + 1u);
}

static inline bool is_of_kind(const pvid_weak_noise_f32 *one, uint8_t kind)
{
    return (PVID_MAX_KINDS == 1) || (one->kind == kind);
}

void pvid_weak_white_weigh_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                               const float theta[], size_t first, size_t last)
{
    if (first == 0u) {
        memset(self->weight, 0, sizeof self->weight);
    }
    for (size_t i = first; i < last; i++) {
        const pvid_weak_noise_f32 *one = &design->noise[i];
        if (is_of_kind(one, kind)) {
            self->weight[one->power] += one->factor * (theta[one->a] * theta[one->b]);
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
                                  float error_variance)
{
    const size_t harmonics = pvid_weak_harmonics(design);
    float mean = 0.0f;
    float c[PVID_MAX_POWER]; /* of the sensors and the equation */
    memcpy(c, self->weight, sizeof c);
    c[design->error_order[kind]] += error_variance;
    for (size_t h = 0; h < harmonics; h++) {
        const float rate = (float)h * self->omega;
        self->scale[h] = samples_of(design, h) * polynomial_of(c, self->powers, rate * rate);
        mean += self->scale[h];
    }
    const float part = (FLOOR * mean) / (float)harmonics;
    self->floor = (part > SPECTRUM_MIN) ? part : SPECTRUM_MIN;
}

PVID_COLD void pvid_weak_white_scale_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design)
{
    const size_t harmonics = pvid_weak_harmonics(design);
    for (size_t h = 0; h < harmonics; h++) {
        self->scale[h] = 1.0f / sqrtf((self->scale[h] > self->floor) ? self->scale[h] : self->floor);
    }
}

void pvid_weak_white_reflect_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, size_t family,
                                 size_t count, float x[])
{
    const size_t harmonics = pvid_weak_harmonics(design);
    float y[PVID_MAX_HARMONICS]; /* in registers, where the number is a constant */
    PVID_UNROLL_EXACT
    for (size_t h = 0; h < harmonics; h++) {
        y[h] = x[h];
    }
    for (size_t k = 0; k < count; k++) {
        const float *v = self->reflection[k][family];
        float along = 0.0f;
        PVID_UNROLL_EXACT
        for (size_t h = 0; h < harmonics; h++) {
            along += v[h] * y[h];
        }
        PVID_UNROLL_EXACT
        for (size_t h = 0; h < harmonics; h++) {
            y[h] -= along * v[h];
        }
    }
    PVID_UNROLL_EXACT
    for (size_t h = 0; h < harmonics; h++) {
        x[h] = y[h];
    }
}

/* Place behind the last part of a family; its first part has the number of the family. */
static size_t family_end(const pvid_weak_design_f32 *design, size_t family)
{
    return (family == 0u) ? pvid_weak_harmonics(design) : (pvid_weak_sines(design) + 1u);
}

/* The reflection of the present direction, behind those of the k directions before it: v with v^T v = 2, such that
 * x - v (v^T x) has nothing behind its entry k of the family. */
static void form(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, size_t k, size_t family,
                 const pvid_weak_basis_f32 *basis)
{
    const size_t first = family + k;
    const size_t end = family_end(design, family);
    float *v = self->reflection[k][family];
    for (size_t h = 0; h < pvid_weak_harmonics(design); h++) {
        v[h] = ((h >= family) && (h < end)) ? basis->direction[family][h] : 0.0f;
    }
    pvid_weak_white_reflect_f32(self, design, family, k, v);
    for (size_t h = family; h < first; h++) {
        v[h] = 0.0f;
    }
    float square = 0.0f;
    for (size_t h = first; h < end; h++) {
        square += v[h] * v[h];
    }
    const float size = sqrtf(square);
    const float head = v[first];
    const bool negative = head < 0.0f;
    const float scale = 1.0f / sqrtf(size * (size + (negative ? -head : head)));
    v[first] = negative ? (head - size) : (head + size);
    for (size_t h = first; h < end; h++) {
        v[h] *= scale;
    }
}

/* The next orthonormal direction of a family, the first one if k is 0. */
static void direct(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, size_t k, size_t family,
                   pvid_weak_basis_f32 *basis)
{
    const size_t end = family_end(design, family);
    const float unit = 1.0f / (float)(pvid_weak_harmonics(design) - 1u);
    const float norm = basis->norm[family];
    const float slope = basis->slope[family];
    float *u = basis->direction[family];
    float *before = basis->before[family];
    float *leverage = basis->leverage[family];
    float square = 0.0f;
    for (size_t h = family; h < end; h++) {
        const float x = (float)h * unit;
        const float last = u[h];
        float y = self->scale[h];
        if (k > 0u) {
            y = (((x * x) - slope) * last) - (norm * before[h]);
        } else if (family > 0u) {
            y *= x;
        } else {
            /* of h^0 */
        }
        before[h] = (k > 0u) ? last : 0.0f;
        u[h] = y;
        square += y * y;
    }
    const float size = sqrtf(square);
    const float inverse = 1.0f / size;
    float moment = 0.0f;
    for (size_t h = family; h < end; h++) {
        const float x = (float)h * unit;
        const float one = u[h] * inverse;
        const float part = one * one;
        u[h] = one;
        leverage[h] = (k > 0u) ? (leverage[h] + part) : part;
        moment += (x * x) * part;
    }
    basis->norm[family] = size;
    basis->slope[family] = moment;
}

/* Direction k takes four stages: for each family it is found, then for each its reflection. */
void pvid_weak_white_basis_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, size_t stage,
                               pvid_weak_basis_f32 *basis)
{
    const size_t k = stage / 4u;
    const size_t family = stage % 2u;
    if ((stage % 4u) < 2u) {
        direct(self, design, k, family, basis);
    } else {
        form(self, design, k, family, basis);
    }
}

void pvid_weak_white_share_f32(pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design,
                               const pvid_weak_basis_f32 *basis, size_t first, size_t last)
{
    const size_t sines = pvid_weak_sines(design);
    if (first == 0u) {
        memset(self->share, 0, sizeof self->share);
    }
    for (size_t h = first; h < last; h++) {
        const float rate = (float)h * self->omega;
        const float square = rate * rate;
        float left = 1.0f - basis->leverage[0][h];
        if ((h > 0u) && (h <= sines)) {
            left += 1.0f - basis->leverage[1][h];
        }
        float weight = samples_of(design, h) * (left * (self->scale[h] * self->scale[h]));
        for (size_t j = 0; j < self->powers; j++) {
            self->share[j] += weight;
            weight *= square;
        }
    }
}

void pvid_weak_white_pull_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design, uint8_t kind,
                              const float x[], size_t first, size_t last, float out[])
{
    for (size_t i = first; i < last; i++) {
        const pvid_weak_noise_f32 *one = &design->noise[i];
        if (is_of_kind(one, kind)) {
            const float half = (0.5f * one->factor) * self->share[one->power];
            out[one->a] += half * x[one->b];
            out[one->b] += half * x[one->a];
        }
    }
}

PVID_COLD float pvid_weak_white_sensors_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design)
{
    float sum = 0.0f;
    for (size_t j = 0; j < self->powers; j++) {
        sum += self->weight[j] * self->share[j];
    }
    return sum / (float)design->functions;
}

PVID_COLD float pvid_weak_white_error_share_f32(const pvid_weak_white_f32 *self, const pvid_weak_design_f32 *design,
                                                uint8_t kind)
{
    return self->share[design->error_order[kind]] / (float)design->functions;
}
