#include "number/uncontracted.h"

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
 * are the white rows, up to a rotation: K + n entries that span K dimensions. With u_k those directions made
 * orthonormal
 *
 *   Q_j = tr(R^-1 dR/dc_j) = sum over the parts of W_h omega_h^(2 j) (1 - sum_k u_kh^2) / D_h
 */
#include "fourier/white_f32.h"

#include <math.h>
#include <string.h>

#define TURN 6.28318531f

/* Least D_h relative to the mean of all, and least D_h. */
#define FLOOR 1.0e-10f
#define SPECTRUM_MIN 1.0e-30f

void pvid_fourier_white_init_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, float dt)
{
    const size_t half = design->power / 2u;
    self->cosines = (uint8_t)((design->functions / 2u) + half + 1u);
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

static float theta_of(const pvid_fourier_design_f32 *design, uint8_t kind, const float theta[], uint8_t column)
{
    return (column < design->model->kind[kind].thetas) ? theta[column] : -1.0f;
}

void pvid_fourier_white_weigh_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, uint8_t kind,
                                  const float theta[], size_t first, size_t last)
{
    if (first == 0u) {
        memset(self->weight, 0, sizeof self->weight);
    }
    for (size_t i = first; i < last; i++) {
        const pvid_fourier_noise_f32 *one = &design->noise[i];
        if (one->kind == kind) {
            const float a = theta_of(design, kind, theta, one->a);
            const float b = theta_of(design, kind, theta, one->b);
            self->weight[one->power] += one->factor * (a * b);
        }
    }
}

/* W_h */
static float samples_of(const pvid_fourier_design_f32 *design, size_t harmonic)
{
    return (harmonic == 0u) ? (2.0f * (float)design->hop) : (float)design->hop;
}

void pvid_fourier_white_spectrum_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, uint8_t kind,
                                     uint8_t harmonics)
{
    float mean = 0.0f;
    const size_t order = design->error_order[kind];
    const float error = design->error_variance[kind];
    for (size_t h = 0; h < harmonics; h++) {
        const float rate = (float)h * self->omega;
        const float square = rate * rate;
        float sum = 0.0f;
        for (size_t j = self->powers; j > 0u; j--) {
            const float own = (j - 1u == order) ? (self->weight[j - 1u] + error) : self->weight[j - 1u];
            sum = (sum * square) + own;
        }
        self->scale[h] = samples_of(design, h) * sum;
        mean += self->scale[h];
    }
    const float part = (FLOOR * mean) / (float)harmonics;
    const float least = (part > SPECTRUM_MIN) ? part : SPECTRUM_MIN;
    for (size_t h = 0; h < harmonics; h++) {
        self->scale[h] = 1.0f / sqrtf((self->scale[h] > least) ? self->scale[h] : least);
    }
}

static size_t harmonic_of(const pvid_fourier_white_f32 *self, size_t row)
{
    return (row < self->cosines) ? row : ((row + 1u) - self->cosines);
}

static inline float product(const float *x, const float *y, size_t first, size_t last)
{
    float sum = 0.0f;
    for (size_t i = first; i < last; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}

/* x -= a y */
static inline void subtract(float a, const float *restrict y, size_t first, size_t last, float *restrict x)
{
    for (size_t i = first; i < last; i++) {
        x[i] -= a * y[i];
    }
}

void pvid_fourier_white_remove_f32(const pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design,
                                   size_t place, float column[])
{
    const size_t rows = pvid_fourier_rows(design);
    const float *u = self->basis[place];
    subtract(product(u, column, 0, self->cosines), u, 0, self->cosines, column);
    subtract(product(u, column, self->cosines, rows), u, self->cosines, rows, column);
}

static void normalise(float x[], size_t first, size_t last)
{
    const float inverse = 1.0f / sqrtf(product(x, x, first, last));
    for (size_t i = first; i < last; i++) {
        x[i] *= inverse;
    }
}

/* Vector k takes 2 k + 1 stages: it begins as (h/H)^2 times the one before; each of those before is taken off twice. */
void pvid_fourier_white_basis_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, size_t stage)
{
    const size_t rows = pvid_fourier_rows(design);
    const float highest = (float)(self->cosines - 1u);
    size_t k = 0;
    for (size_t next = 1; (next < (PVID_MAX_POWER / 2u)) && ((next * next) <= stage); next++) {
        k = next;
    }
    const size_t part = stage - (k * k);
    float *u = self->basis[k];
    if (part == 0u) {
        for (size_t i = 0; i < rows; i++) {
            const size_t h = harmonic_of(self, i);
            const float x = (float)h / highest;
            const float first = (i < self->cosines) ? self->scale[h] : (x * self->scale[h]);
            u[i] = (k == 0u) ? first : ((x * x) * self->basis[k - 1u][i]);
        }
    } else {
        pvid_fourier_white_remove_f32(self, design, (part - 1u) % k, u);
    }
    if (part == (2u * k)) {
        normalise(u, 0, self->cosines);
        normalise(u, self->cosines, rows);
    }
}

void pvid_fourier_white_scale_f32(const pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design,
                                  const float sum[2][PVID_MAX_HARMONICS], float column[])
{
    const size_t rows = pvid_fourier_rows(design);
    for (size_t i = 0; i < self->cosines; i++) {
        column[i] = self->scale[i] * sum[0][i];
    }
    for (size_t i = self->cosines; i < rows; i++) {
        const size_t h = harmonic_of(self, i);
        column[i] = self->scale[h] * sum[1][h];
    }
}

void pvid_fourier_white_share_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, size_t first,
                                  size_t last)
{
    if (first == 0u) {
        memset(self->share, 0, sizeof self->share);
    }
    for (size_t i = first; i < last; i++) {
        const size_t h = harmonic_of(self, i);
        const float rate = (float)h * self->omega;
        const float square = rate * rate;
        float left = 1.0f;
        for (size_t k = 0; k < design->power / 2u; k++) {
            left -= self->basis[k][i] * self->basis[k][i];
        }
        float weight = samples_of(design, h) * (left * (self->scale[h] * self->scale[h]));
        for (size_t j = 0; j < self->powers; j++) {
            self->share[j] += weight;
            weight *= square;
        }
    }
}

void pvid_fourier_white_pull_f32(const pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design,
                                 uint8_t kind, const float theta[], size_t first, size_t last, float g[])
{
    const uint8_t thetas = design->model->kind[kind].thetas;
    for (size_t i = first; i < last; i++) {
        const pvid_fourier_noise_f32 *one = &design->noise[i];
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

float pvid_fourier_white_sensors_f32(const pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design)
{
    float sum = 0.0f;
    for (size_t j = 0; j < self->powers; j++) {
        sum += self->weight[j] * self->share[j];
    }
    return sum / (float)design->functions;
}
