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

void pvid_fourier_noise_add_f32(const pvid_fourier_design_f32 *design, const pvid_fourier_noise_f32 *one, size_t first,
                                const float share[PVID_MAX_POWER], float rows, const float c[], float s[][PVID_MAX_P])
{
    const pvid_model_f32 *model = design->model->model;
    const size_t thetas = design->model->kind[one->kind].thetas;
    if ((one->a >= thetas) || (one->b >= thetas)) { /* of Y: no regressor */
        return;
    }
    const bool same = one->a == one->b;
    const float whole = (one->factor * share[one->power]) / rows;
    const float own = same ? whole : (0.5f * whole);
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
            float *place = (i < j) ? &s[i][j] : &s[j][i];
            *place += (!same && (i == j)) ? (x + x) : x;
        }
    }
}
