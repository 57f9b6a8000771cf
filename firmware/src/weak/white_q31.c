/* As white_f32.c, in numbers of any size up to 1 / sqrt(D_h), and in Q30 from the reflections on:
 *
 *   D_h = W_h sum_j c_j h^(2 j),   W_0 = 2 hop, else hop,   c_j = sum factor theta_a theta_b  (theta_Y = -1)
 *
 * with the equation's own error as a part of c_m. A D_h below 2^-33 of the mean counts as that much.
 *
 * The test functions leave out the polynomials in h below degree n, over the standard deviations: even ones among the
 * real parts, odd ones among the imaginary parts. n/2 reflections for each family turn these into the first n/2 rows,
 * and the K other rows are what remains: white, K of them, no covariance. */
#include "weak/white_q31.h"

#include <stdbool.h>

#include "number/integer_q31.h"
#include "number/scaled_q31.h"
#include "weak/reflection_q31.h"
#include "weak/sums_q31.h"

#define FLOOR_BITS 33
#define LEAST_EXPONENT (-200) /* of D_h, where there is no noise at all */

static const pvid_scaled_q31 none = {0, 0};

void pvid_weak_white_init_q31(pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design)
{
    self->cosines = pvid_weak_harmonics_q31(design);
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

void pvid_weak_white_weigh_q31(const pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design, uint8_t kind,
                               const pvid_scaled_q31 theta[], size_t first, size_t last, pvid_scaled_q31 weight[])
{
    const pvid_scaled_q31 minus_one = pvid_scaled_of_q31(-1, 0);
    const size_t thetas = design->model->kind[kind].thetas;
    for (size_t j = 0; (first == 0u) && (j < self->powers); j++) {
        weight[j] = none;
    }
    for (size_t i = first; i < last; i++) {
        const pvid_weak_noise_q31 *one = &design->noise[i];
        if (one->kind == kind) {
            const pvid_scaled_q31 a = (one->a < thetas) ? theta[one->a] : minus_one;
            const pvid_scaled_q31 b = (one->b < thetas) ? theta[one->b] : minus_one;
            const pvid_scaled_q31 share = pvid_scaled_times_q31(one->factor, pvid_scaled_times_q31(a, b));
            weight[one->power] = pvid_scaled_plus_q31(weight[one->power], share);
        }
    }
}

/* W_h */
static int64_t samples_of(const pvid_weak_design_q31 *design, size_t harmonic)
{
    return (harmonic == 0u) ? (2 * (int64_t)design->hop) : (int64_t)design->hop;
}

void pvid_weak_white_spectrum_q31(pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design, uint8_t kind,
                                  pvid_scaled_q31 error_variance, const pvid_scaled_q31 weight[], size_t first,
                                  size_t last)
{
    const size_t order = design->error_order[kind];
    for (size_t h = first; h < last; h++) {
        const pvid_scaled_q31 square = pvid_scaled_of_q31((int64_t)(h * h), 0);
        pvid_scaled_q31 sum = none;
        for (size_t j = self->powers; j > 0u; j--) {
            sum = pvid_scaled_plus_q31(pvid_scaled_times_q31(sum, square), weight[j - 1u]);
            if (j - 1u == order) {
                sum = pvid_scaled_plus_q31(sum, error_variance);
            }
        }
        sum = pvid_scaled_times_q31(sum, pvid_scaled_of_q31(samples_of(design, h), 0));
        self->scale[h] = (sum.m > 0) ? sum : none;
    }
}

pvid_scaled_q31 pvid_weak_white_floor_q31(const pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design)
{
    const size_t harmonics = pvid_weak_harmonics_q31(design);
    pvid_scaled_q31 sum = none;
    for (size_t h = 0; h < harmonics; h++) {
        sum = pvid_scaled_plus_q31(sum, self->scale[h]);
    }
    pvid_scaled_q31 least = pvid_scaled_over_q31(sum, pvid_scaled_of_q31((int64_t)harmonics, 0));
    least.e -= FLOOR_BITS;
    return (least.m > 0) ? least : pvid_scaled_of_q31(1, LEAST_EXPONENT);
}

void pvid_weak_white_invert_q31(pvid_weak_white_q31 *self, pvid_scaled_q31 least, size_t first, size_t last)
{
    for (size_t h = first; h < last; h++) {
        const bool is_less = pvid_scaled_exceeds_q31(least, self->scale[h]);
        self->scale[h] = pvid_inverse_root_q31(is_less ? least : self->scale[h]);
    }
}

/* The vector of place k before the reflections of those before it: h^(2 k) / sqrt(D_h), or h times that, in a unit in
 * which the largest has 29 or 30 bits, less the order at most. */
static void begin_vector(const pvid_weak_white_q31 *self, size_t k, size_t first, size_t n, int32_t x[])
{
    const size_t order = (2u * k) + ((first > 0u) ? 1u : 0u);
    int32_t largest = INT32_MIN;
    for (size_t i = (order > 0u) ? (1u - first) : 0u; i < n; i++) {
        const int32_t exponent = pvid_weak_white_exponent_q31(self, first + i, order);
        largest = (exponent > largest) ? exponent : largest;
    }
    for (size_t i = 0; i < n; i++) {
        const size_t h = first + i;
        const int32_t below = largest - pvid_weak_white_exponent_q31(self, h, order);
        int32_t weight = self->scale[h].m;
        for (size_t m = 0; m < order; m++) {
            weight = pvid_weak_white_times_q31(weight, h);
        }
        x[i] = (below < 31) ? pvid_floor_shift_32_q31(weight, (uint32_t)((below > 0) ? below : 0)) : 0;
    }
}

/* Reflects a column of one family by its vectors before `count`. */
static void reflect(const pvid_weak_white_q31 *self, size_t place, size_t n, size_t count, int32_t x[])
{
    for (size_t k = 0; k < count; k++) {
        pvid_weak_reflect_q31(&self->reflector[k][place + k], n - k, &x[k]);
    }
}

void pvid_weak_white_reflector_q31(pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design, size_t place)
{
    const size_t vectors = design->power / 2u;
    const bool is_sine = place >= vectors;
    const size_t k = is_sine ? (place - vectors) : place;
    const size_t first = is_sine ? self->cosines : 0u;
    const size_t n = is_sine ? (pvid_weak_sums_rows_q31(design) - self->cosines) : self->cosines;
    int32_t *x = &self->reflector[k][first];
    begin_vector(self, k, is_sine ? 1u : 0u, n, x);
    (void)pvid_weak_block_q31(n, x);
    reflect(self, first, n, k, x);
    (void)pvid_weak_block_q31(n - k, &x[k]); /* what is left may be small */
    pvid_weak_reflector_of_q31(n - k, &x[k]);
}

void pvid_weak_white_remove_q31(const pvid_weak_white_q31 *self, const pvid_weak_design_q31 *design, int32_t column[])
{
    const size_t cosines = self->cosines;
    const size_t sines = pvid_weak_sums_rows_q31(design) - cosines;
    const size_t vectors = design->power / 2u;
    reflect(self, 0, cosines, vectors, column);
    reflect(self, cosines, sines, vectors, &column[cosines]);
    for (size_t i = 0; i < (cosines - vectors); i++) {
        column[i] = column[vectors + i];
    }
    for (size_t i = vectors; i < sines; i++) {
        column[(cosines - (2u * vectors)) + i] = column[cosines + i];
    }
}
