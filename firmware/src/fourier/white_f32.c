#include "number/uncontracted.h"

/* The sums S_h of a kind's residual Y - sum theta_j N_j have independent noise in their real and imaginary parts, of
 * variance
 *
 *   D_h = W_h sum_j c_j omega_h^(2 j),   W_0 = 2 hop, else hop,   c_j = sum factor theta_a theta_b  (theta_Y = -1)
 *
 * with the equation's own error, white noise of variance v differentiated m times, as a part v of c_m. Rows are T times
 * these sums. Frequency f of sin^n has the harmonics h = f - n/2 .. f + n/2 with the bell (-1)^d binomial(n, n/2 + d) /
 * 2^n, d = h - f, where harmonics below 0 fold to -h: added for cosines, subtracted for sines. So
 *
 *   R = T diag(D) T^T
 *
 * has a band of n on each side of its diagonal, and so has L, R = L L^T. (The rows are those of the oracle but for the
 * sign (-1)^f.) With y_h = L^-1 t_h, t_h the columns of T:
 *
 *   Q_j = tr(R^-1 dR/dc_j) = sum_h W_h omega_h^(2 j) |y_h|^2
 */
#include "fourier/white_f32.h"

#include <math.h>
#include <string.h>

#define TURN 6.28318531f

/* Least D_h relative to the mean of all, least D_h, and least pivot relative to its diagonal entry. */
#define FLOOR 1.0e-10f
#define SPECTRUM_MIN 1.0e-30f
#define PIVOT 1.0e-6f

void pvid_fourier_white_init_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, float dt)
{
    const size_t n = design->power;
    float binomial = 1.0f; /* n over n/2 + d, divided by 2^n */
    for (size_t i = 0; i < n; i++) {
        binomial *= 0.5f;
    }
    for (size_t i = 0; i < n / 2u; i++) {
        binomial *= (float)(n - i) / (float)(i + 1u);
    }
    for (size_t d = 0; d <= n / 2u; d++) {
        self->bell[d] = ((d % 2u) != 0u) ? -binomial : binomial;
        binomial *= (float)((n / 2u) - d) / (float)((n / 2u) + d + 1u);
    }
    self->cosines = (uint8_t)((design->functions / 2u) + 1u);
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
static float sides(const pvid_fourier_design_f32 *design, size_t harmonic)
{
    return (harmonic == 0u) ? (2.0f * (float)design->hop) : (float)design->hop;
}

void pvid_fourier_white_spectrum_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, uint8_t kind,
                                     uint8_t harmonics)
{
    float weight[PVID_MAX_POWER];
    memcpy(weight, self->weight, sizeof weight);
    weight[design->error_order[kind]] += design->error_variance[kind];
    float mean = 0.0f;
    for (size_t h = 0; h < harmonics; h++) {
        const float rate = (float)h * self->omega;
        const float square = rate * rate;
        float sum = 0.0f;
        for (size_t j = self->powers; j > 0u; j--) {
            sum = (sum * square) + weight[j - 1u];
        }
        self->spectrum[h] = sides(design, h) * sum;
        mean += self->spectrum[h];
    }
    const float part = (FLOOR * mean) / (float)harmonics;
    const float least = (part > SPECTRUM_MIN) ? part : SPECTRUM_MIN;
    for (size_t h = 0; h < harmonics; h++) {
        self->spectrum[h] = (self->spectrum[h] > least) ? self->spectrum[h] : least;
    }
}

static bool is_sine(const pvid_fourier_white_f32 *self, size_t row)
{
    return row >= self->cosines;
}

/* Frequency of a row of a family. */
static size_t frequency_of(bool sines, size_t row)
{
    return sines ? (row + 1u) : row;
}

/* T at a frequency and a harmonic. */
static float shape(const pvid_fourier_white_f32 *self, size_t half, bool sines, size_t frequency, size_t harmonic)
{
    const size_t apart = (harmonic > frequency) ? (harmonic - frequency) : (frequency - harmonic);
    const size_t folded = harmonic + frequency;
    float value = (apart <= half) ? self->bell[apart] : 0.0f;
    if ((harmonic > 0u) && (folded <= half)) {
        value += sines ? -self->bell[folded] : self->bell[folded];
    }
    return value;
}

void pvid_fourier_white_gram_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, size_t row)
{
    const size_t n = design->power;
    const size_t half = n / 2u;
    const bool sines = is_sine(self, row);
    const size_t own = sines ? (row - self->cosines) : row;
    const size_t f = frequency_of(sines, own);
    const size_t lowest = sines ? 1u : 0u;
    const size_t begin = (f > half + lowest) ? (f - half) : lowest;
    float weighted[PVID_MAX_POWER + 1];
    for (size_t h = begin; h <= f + half; h++) {
        weighted[h - begin] = self->spectrum[h] * shape(self, half, sines, f, h);
    }
    const size_t first = (own > n) ? (own - n) : 0u;
    for (size_t j = first; j <= own; j++) {
        const size_t g = frequency_of(sines, j);
        float sum = 0.0f;
        for (size_t h = begin; h <= g + half; h++) {
            sum += weighted[h - begin] * shape(self, half, sines, g, h);
        }
        self->factor[row][(j + n) - own] = sum;
    }
}

void pvid_fourier_white_factor_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, size_t row)
{
    const size_t n = design->power;
    const size_t offset = is_sine(self, row) ? self->cosines : 0u;
    const size_t own = row - offset;
    const size_t first = (own > n) ? (own - n) : 0u;
    float *line = self->factor[row];
    const float diagonal = line[n];
    for (size_t j = first; j < own; j++) {
        const float *other = self->factor[offset + j];
        const size_t shift = own - j; /* entry k of this line is entry k + shift of the other */
        float value = line[n - shift];
        for (size_t k = (first + n) - own; k < n - shift; k++) {
            value -= line[k] * other[k + shift];
        }
        line[n - shift] = value * other[n];
    }
    float pivot = diagonal;
    for (size_t k = (first + n) - own; k < n; k++) {
        pivot -= line[k] * line[k];
    }
    const float least = PIVOT * diagonal;
    line[n] = 1.0f / sqrtf((pivot > least) ? pivot : least);
}

void pvid_fourier_white_forward_f32(const pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design,
                                    bool sines, size_t first, float x[])
{
    const size_t n = design->power;
    const size_t offset = sines ? self->cosines : 0u;
    const size_t rows = sines ? ((size_t)design->functions - self->cosines) : self->cosines;
    for (size_t i = first; i < rows; i++) {
        const float *line = self->factor[offset + i];
        const size_t begin = (i > first + n) ? (i - n) : first;
        float value = x[i];
        for (size_t k = begin; k < i; k++) {
            value -= line[(k + n) - i] * x[k];
        }
        x[i] = value * line[n];
    }
}

/* The first row of a family that has a harmonic. */
static size_t first_row(const pvid_fourier_design_f32 *design, bool sines, size_t harmonic)
{
    const size_t half = design->power / 2u;
    const size_t lowest = sines ? 1u : 0u;
    return (harmonic > half + lowest) ? (harmonic - (half + lowest)) : 0u;
}

static size_t rows_of(const pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, bool sines)
{
    return sines ? ((size_t)design->functions - self->cosines) : self->cosines;
}

void pvid_fourier_white_share_f32(pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, bool sines,
                                  size_t harmonic)
{
    const size_t rows = rows_of(self, design, sines);
    const size_t first = first_row(design, sines, harmonic);
    float y[PVID_FOURIER_FAMILY];
    for (size_t i = first; i < rows; i++) {
        y[i] = shape(self, design->power / 2u, sines, frequency_of(sines, i), harmonic);
    }
    pvid_fourier_white_forward_f32(self, design, sines, first, y);
    float square = 0.0f;
    for (size_t i = first; i < rows; i++) {
        square += y[i] * y[i];
    }
    if (!sines && (harmonic == 0u)) {
        memset(self->share, 0, sizeof self->share);
    }
    const float rate = (float)harmonic * self->omega;
    float weight = sides(design, harmonic);
    for (size_t j = 0; j < self->powers; j++) {
        self->share[j] += weight * square;
        weight *= rate * rate;
    }
}

void pvid_fourier_white_pull_f32(const pvid_fourier_white_f32 *self, const pvid_fourier_design_f32 *design, uint8_t kind,
                                 const float theta[], size_t first, size_t last, float g[])
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
