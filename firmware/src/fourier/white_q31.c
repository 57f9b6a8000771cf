/* As white_f32.c, in numbers of any size up to 1 / sqrt(D_h) and in Q30 from there on:
 *
 *   D_h = W_h sum_j c_j h^(2 j),   W_0 = 2 hop, else hop,   c_j = sum factor theta_a theta_b  (theta_Y = -1)
 *
 * with the equation's own error as a part of c_m. A D_h below 2^-20 of the mean counts as that much: the entries of a
 * column over their standard deviations then fit a block of 27 bits. */
#include "fourier/white_q31.h"

#include <stdbool.h>

#include "fourier/direction_q31.h"
#include "fourier/sums_q31.h"
#include "number/integer_q31.h"
#include "number/scaled_q31.h"

#define FLOOR_BITS 20
#define LEAST_EXPONENT (-200) /* of D_h, where there is no noise at all */

static const pvid_scaled_q31 none = {0, 0};

void pvid_fourier_white_init_q31(pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design)
{
    self->cosines = pvid_fourier_harmonics_q31(design);
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

void pvid_fourier_white_weigh_q31(pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design, uint8_t kind,
                                  const pvid_scaled_q31 theta[], size_t first, size_t last)
{
    const pvid_scaled_q31 minus_one = pvid_scaled_of_q31(-1, 0);
    const size_t thetas = design->model->kind[kind].thetas;
    for (size_t j = 0; (first == 0u) && (j < self->powers); j++) {
        self->weight[j] = none;
    }
    for (size_t i = first; i < last; i++) {
        const pvid_fourier_noise_q31 *one = &design->noise[i];
        if (one->kind == kind) {
            const pvid_scaled_q31 a = (one->a < thetas) ? theta[one->a] : minus_one;
            const pvid_scaled_q31 b = (one->b < thetas) ? theta[one->b] : minus_one;
            const pvid_scaled_q31 share = pvid_scaled_times_q31(one->factor, pvid_scaled_times_q31(a, b));
            self->weight[one->power] = pvid_scaled_plus_q31(self->weight[one->power], share);
        }
    }
}

/* W_h */
static int64_t samples_of(const pvid_fourier_design_q31 *design, size_t harmonic)
{
    return (harmonic == 0u) ? (2 * (int64_t)design->hop) : (int64_t)design->hop;
}

void pvid_fourier_white_spectrum_q31(pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design, uint8_t kind,
                                     size_t first, size_t last)
{
    const size_t order = design->error_order[kind];
    const pvid_scaled_q31 error = design->error_variance[kind];
    for (size_t h = first; h < last; h++) {
        const pvid_scaled_q31 square = pvid_scaled_of_q31((int64_t)(h * h), 0);
        pvid_scaled_q31 sum = none;
        for (size_t j = self->powers; j > 0u; j--) {
            sum = pvid_scaled_plus_q31(pvid_scaled_times_q31(sum, square), self->weight[j - 1u]);
            if (j - 1u == order) {
                sum = pvid_scaled_plus_q31(sum, error);
            }
        }
        sum = pvid_scaled_times_q31(sum, pvid_scaled_of_q31(samples_of(design, h), 0));
        self->scale[h] = (sum.m > 0) ? sum : none;
    }
}

pvid_scaled_q31 pvid_fourier_white_floor_q31(const pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design)
{
    const size_t harmonics = pvid_fourier_harmonics_q31(design);
    pvid_scaled_q31 sum = none;
    for (size_t h = 0; h < harmonics; h++) {
        sum = pvid_scaled_plus_q31(sum, self->scale[h]);
    }
    pvid_scaled_q31 least = pvid_scaled_over_q31(sum, pvid_scaled_of_q31((int64_t)harmonics, 0));
    least.e -= FLOOR_BITS;
    return (least.m > 0) ? least : pvid_scaled_of_q31(1, LEAST_EXPONENT);
}

void pvid_fourier_white_invert_q31(pvid_fourier_white_q31 *self, pvid_scaled_q31 least, size_t first, size_t last)
{
    for (size_t h = first; h < last; h++) {
        const bool is_less = pvid_scaled_minus_q31(self->scale[h], least).m < 0;
        const pvid_scaled_q31 variance = is_less ? least : self->scale[h];
        const pvid_root_q31 root = pvid_root_of_q31(variance.m, variance.e);
        self->scale[h] = pvid_scaled_over_q31(pvid_scaled_of_q31(1, 0), pvid_scaled_of_q31(root.r, root.e));
    }
}

void pvid_fourier_white_remove_q31(const pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design,
                                   size_t place, int32_t column[])
{
    const size_t rows = pvid_fourier_rows_q31(design);
    pvid_fourier_take_off_q31(self->basis[place], 0, self->cosines, column);
    pvid_fourier_take_off_q31(self->basis[place], self->cosines, rows, column);
}

/* The vector of place k before what is taken off: of one family, in a block. */
static void begin_vector(pvid_fourier_white_q31 *self, size_t k, size_t first, size_t last)
{
    int64_t wide[PVID_FOURIER_ROWS_Q31];
    int32_t longest = INT32_MIN;
    for (size_t i = first; i < last; i++) {
        const int32_t e = self->scale[pvid_fourier_harmonic_q31(self, i)].e;
        longest = (e > longest) ? e : longest;
    }
    for (size_t i = first; i < last; i++) {
        const int64_t h = (int64_t)pvid_fourier_harmonic_q31(self, i);
        if (k > 0u) {
            wide[i] = h * h * self->basis[k - 1u][i];
        } else {
            const pvid_scaled_q31 scale = self->scale[h];
            const int64_t x = (first == 0u) ? scale.m : (h * scale.m);
            wide[i] = pvid_scale_q31(x * 65536, longest - scale.e);
        }
    }
    (void)pvid_fourier_block_q31(wide, first, last, self->basis[k]);
}

/* To a block again: what is left may be small. */
static void fill(int32_t u[], size_t first, size_t last)
{
    int64_t wide[PVID_FOURIER_ROWS_Q31];
    for (size_t i = first; i < last; i++) {
        wide[i] = u[i];
    }
    (void)pvid_fourier_block_q31(wide, first, last, u);
}

/* Vector k takes 2 k + 1 stages: it begins as h^2 times the one before; each of those before is taken off twice. */
void pvid_fourier_white_basis_q31(pvid_fourier_white_q31 *self, const pvid_fourier_design_q31 *design, size_t stage)
{
    const size_t rows = pvid_fourier_rows_q31(design);
    size_t k = 0;
    for (size_t next = 1; (next < (PVID_MAX_POWER / 2u)) && ((next * next) <= stage); next++) {
        k = next;
    }
    const size_t part = stage - (k * k);
    int32_t *u = self->basis[k];
    if (part == 0u) {
        begin_vector(self, k, 0, self->cosines);
        begin_vector(self, k, self->cosines, rows);
    } else {
        pvid_fourier_white_remove_q31(self, design, (part - 1u) % k, u);
        fill(u, 0, self->cosines);
        fill(u, self->cosines, rows);
    }
    if (part == (2u * k)) {
        pvid_fourier_normalise_q31(0, self->cosines, u);
        pvid_fourier_normalise_q31(self->cosines, rows, u);
    }
}
