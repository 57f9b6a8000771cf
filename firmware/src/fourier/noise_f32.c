#include "number/uncontracted.h"

#include "number/short_loops.h"

/* An entry of the noise table is a share of the variance D_h of the rows, and likewise the covariance that noise alone
 * has in two columns a and b, over theta_a theta_b. In white rows its sum is factor Q_j; half of it is each of (a, b)
 * and (b, a) if they differ. Where Q_j = tr(R^-1 dR/dc_j) is not formed, it is at most
 *
 *   sum over all K + n parts of W_h omega_h^(2 j) / D_h,
 *
 * which counts n parts that no test function contains: the check is up to (K + n)/K times as strict. */
#include "fourier/noise_f32.h"

#include <stdbool.h>
#include <string.h>

void pvid_fourier_noise_shares_f32(const pvid_fourier_white_f32 *white, const pvid_fourier_design_f32 *design,
                                   float share[PVID_MAX_POWER])
{
    const size_t cosines = white->cosines;
    const size_t sines = ((size_t)design->functions + design->power) - cosines;
    memset(share, 0, PVID_MAX_POWER * sizeof share[0]);
    for (size_t h = 0; h < cosines; h++) {
        const float rate = (float)h * white->omega;
        const float square = rate * rate;
        const bool both = (h > 0u) && (h <= sines); /* W_0 is twice the others: it has no imaginary part */
        const float parts = (both || (h == 0u)) ? (2.0f * (float)design->hop) : (float)design->hop;
        float weight = parts * (white->scale[h] * white->scale[h]);
        for (size_t j = 0; j < white->powers; j++) {
            share[j] += weight;
            weight *= square;
        }
    }
}

/* Of this kind, and of two regressors. */
static bool counts(const pvid_fourier_design_f32 *design, uint8_t kind, size_t place)
{
    const pvid_fourier_noise_f32 *one = &design->noise[place];
    const uint8_t thetas = design->model->kind[kind].thetas;
    return (one->kind == kind) && (one->a < thetas) && (one->b < thetas);
}

size_t pvid_fourier_noise_next_f32(const pvid_fourier_design_f32 *design, uint8_t kind, size_t place)
{
    size_t i = place;
    while ((i < design->n_noise) && !counts(design, kind, i)) {
        i++;
    }
    return i;
}

/* The entry has the same columns as the one before it. */
static bool goes_on(const pvid_fourier_design_f32 *design, size_t place)
{
    const pvid_fourier_noise_f32 *one = &design->noise[place];
    const pvid_fourier_noise_f32 *last = &design->noise[place - 1u];
    return (one->kind == last->kind) && (one->a == last->a) && (one->b == last->b);
}

size_t pvid_fourier_noise_pairs_f32(const pvid_fourier_design_f32 *design, uint8_t kind)
{
    size_t pairs = 0;
    for (size_t i = 0; i < design->n_noise; i++) {
        if (counts(design, kind, i) && ((i == 0u) || !goes_on(design, i))) {
            pairs++;
        }
    }
    return pairs;
}

size_t pvid_fourier_noise_add_f32(const pvid_fourier_design_f32 *design, size_t place, size_t first,
                                  const float share[PVID_MAX_POWER], float rows, const float c[], float s[][PVID_MAX_P])
{
    const pvid_model_f32 *model = design->model->model;
    const pvid_fourier_noise_f32 *one = &design->noise[place];
    float sum = one->factor * share[one->power];
    size_t end = place + 1u;
    while ((end < design->n_noise) && goes_on(design, end)) {
        sum += design->noise[end].factor * share[design->noise[end].power];
        end++;
    }
    const bool same = one->a == one->b;
    const float own = (same ? sum : (0.5f * sum)) / rows;
    uint8_t of_a[PVID_MAX_P];
    uint8_t of_b[PVID_MAX_P];
    size_t n_a = 0; /* non-zeros of these rows of C */
    size_t n_b = 0;
    const uint8_t *c_row = model->c_row;
    for (size_t k = 0; k < model->n_c; k++) {
        const size_t row = (size_t)c_row[k] - first;
        if ((row == one->a) && (n_a < (size_t)PVID_MAX_P)) {
            of_a[n_a] = (uint8_t)k;
            n_a++;
        }
        if ((row == one->b) && (n_b < (size_t)PVID_MAX_P)) {
            of_b[n_b] = (uint8_t)k;
            n_b++;
        }
    }
    for (size_t k = 0; k < n_a; k++) {
        for (size_t l = 0; l < n_b; l++) {
            const size_t i = model->c_column[of_a[k]];
            const size_t j = model->c_column[of_b[l]];
            if (same && (j < i)) {
                continue;
            }
            const float x = own * (c[of_a[k]] * c[of_b[l]]);
            float *entry = (i < j) ? &s[i][j] : &s[j][i];
            *entry += (!same && (i == j)) ? (x + x) : x;
        }
    }
    return end;
}
