#include "number/uncontracted.h"

#include "number/short_loops.h"

/* An entry of the noise table is a share of the variance D_h of the rows, and likewise the covariance that noise alone
 * has in two columns a and b, over theta_a theta_b. In white rows its sum is factor Q_j; half of it is each of (a, b)
 * and (b, a) if they differ. Where Q_j = tr(R^-1 dR/dc_j) is not formed, it is at most
 *
 *   sum over all K + n parts of W_h omega_h^(2 j) / D_h,
 *
 * which counts n parts that no test function contains: the check is up to (K + n)/K times as strict. */
#include "weak/noise_f32.h"

#include <stdbool.h>
#include <string.h>

void pvid_weak_noise_shares_f32(const pvid_weak_white_f32 *white, const pvid_weak_design_f32 *design,
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
static bool counts(const pvid_weak_design_f32 *design, uint8_t kind, size_t place)
{
    const pvid_weak_noise_f32 *one = &design->noise[place];
    const uint8_t thetas = design->model->kind[kind].thetas;
    return (one->kind == kind) && (one->a < thetas) && (one->b < thetas);
}

size_t pvid_weak_noise_next_f32(const pvid_weak_design_f32 *design, uint8_t kind, size_t place)
{
    size_t i = place;
    while ((i < design->n_noise) && !counts(design, kind, i)) {
        i++;
    }
    return i;
}

/* The entry has the same columns as the one before it. */
static bool goes_on(const pvid_weak_design_f32 *design, size_t place)
{
    const pvid_weak_noise_f32 *one = &design->noise[place];
    const pvid_weak_noise_f32 *last = &design->noise[place - 1u];
    return (one->kind == last->kind) && (one->a == last->a) && (one->b == last->b);
}

size_t pvid_weak_noise_pairs_f32(const pvid_weak_design_f32 *design, uint8_t kind)
{
    size_t pairs = 0;
    for (size_t i = 0; i < design->n_noise; i++) {
        if (counts(design, kind, i) && ((i == 0u) || !goes_on(design, i))) {
            pairs++;
        }
    }
    return pairs;
}

void pvid_weak_noise_list_f32(const pvid_weak_design_f32 *design, size_t first, size_t thetas, size_t from, size_t to,
                              pvid_weak_slopes_f32 *slopes)
{
    const uint8_t *c_row = design->model->model->c_row;
    for (size_t row = 0; (from == 0u) && (row < thetas); row++) {
        slopes->count[row] = 0;
    }
    for (size_t k = from; k < to; k++) {
        const size_t row = (size_t)c_row[k] - first; /* beyond `thetas` also for a row before the kind's */
        if ((row < thetas) && (slopes->count[row] < (uint8_t)PVID_MAX_P)) {
            slopes->place[row][slopes->count[row]] = (uint8_t)k;
            slopes->count[row]++;
        }
    }
}

size_t pvid_weak_noise_add_f32(const pvid_weak_design_f32 *design, size_t place, const float share[], float rows,
                               const pvid_weak_slopes_f32 *slopes, float s[][PVID_MAX_P])
{
    const pvid_weak_noise_f32 *one = &design->noise[place];
    const uint8_t *c_column = design->model->model->c_column;
    const float *c = slopes->c;
    float sum = one->factor * share[one->power];
    size_t end = place + 1u;
    while ((end < design->n_noise) && goes_on(design, end)) {
        sum += design->noise[end].factor * share[design->noise[end].power];
        end++;
    }
    const bool same = one->a == one->b;
    const float own = (same ? sum : (0.5f * sum)) / rows;
    for (size_t k = 0; k < slopes->count[one->a]; k++) {
        const size_t of_a = slopes->place[one->a][k];
        const size_t i = c_column[of_a];
        for (size_t l = 0; l < slopes->count[one->b]; l++) {
            const size_t of_b = slopes->place[one->b][l];
            const size_t j = c_column[of_b];
            if (same && (j < i)) {
                continue;
            }
            const float x = own * (c[of_a] * c[of_b]);
            float *entry = (i < j) ? &s[i][j] : &s[j][i];
            *entry += (!same && (i == j)) ? (x + x) : x;
        }
    }
    return end;
}
