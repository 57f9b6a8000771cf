/* As white_f32.c and noise_f32.c:
 *
 *   Q_j = sum over the parts of W_h h^(2 j) (1 - leverage) / D_h
 *
 * is the share of c_j in the K rows' variance. A direction u that the test functions leave out is the first unit vector
 * reflected by its own reflection and then by those before it, from the last to the first. */
#include "weak/noise_q31.h"

#include "number/integer_q31.h"
#include "number/scaled_q31.h"
#include "weak/reflection_q31.h"
#include "weak/sums_q31.h"
#include "weak/white_q31.h"

#define UNIT ((int32_t)1 << 26) /* a length that reflections take */

void pvid_weak_noise_leverage_q31(const pvid_weak_white_q31 *white, const pvid_weak_design_q31 *design, size_t place,
                                  int32_t u[], int32_t leverage[])
{
    const size_t vectors = design->power / 2u;
    const bool is_sine = place >= vectors;
    const size_t k = is_sine ? (place - vectors) : place;
    const size_t first = is_sine ? white->cosines : 0u;
    const size_t n = is_sine ? (pvid_weak_sums_rows_q31(design) - white->cosines) : white->cosines;
    for (size_t i = 0; i < n; i++) {
        u[i] = (i == k) ? UNIT : 0;
    }
    for (size_t left = k + 1u; left > 0u; left--) {
        const size_t j = left - 1u;
        pvid_weak_reflect_q31(&white->reflector[j][first + j], n - j, &u[j]);
    }
    for (size_t i = 0; i < n; i++) {
        const int32_t square = (int32_t)pvid_floor_shift_q31(pvid_short_square_q31(u[i]), 22);
        leverage[first + i] = ((k == 0u) ? 0 : leverage[first + i]) + square;
    }
}

void pvid_weak_noise_share_q31(const pvid_weak_white_q31 *white, const pvid_weak_design_q31 *design,
                               const int32_t leverage[], size_t h, pvid_scaled_q31 share[])
{
    const size_t cosines = white->cosines;
    const bool has_sine = (h > 0u) && ((cosines + h) <= pvid_weak_sums_rows_q31(design));
    int64_t left = (int64_t)PVID_ONE_Q30 - leverage[h];
    left += has_sine ? ((int64_t)PVID_ONE_Q30 - leverage[(cosines + h) - 1u]) : 0;
    const int64_t samples = (h == 0u) ? (2 * (int64_t)design->hop) : (int64_t)design->hop;
    const pvid_scaled_q31 square = pvid_scaled_of_q31((int64_t)(h * h), 0);
    const pvid_scaled_q31 inverse = pvid_scaled_times_q31(white->scale[h], white->scale[h]);
    const pvid_scaled_q31 rest = pvid_scaled_of_q31((left > 0) ? left : 0, -30);
    pvid_scaled_q31 weight =
        pvid_scaled_times_q31(pvid_scaled_times_q31(inverse, rest), pvid_scaled_of_q31(samples, 0));
    const pvid_scaled_q31 none = {0, 0};
    for (size_t j = 0; j < white->powers; j++) {
        share[j] = pvid_scaled_plus_q31((h == 0u) ? none : share[j], weight);
        weight = pvid_scaled_times_q31(weight, square);
    }
}

/* Place of (i, j), i <= j, in an upper triangle by rows. */
static size_t place_of(size_t n, size_t i, size_t j)
{
    return (((2u * n) - i) - 1u) * i / 2u + j;
}

/* `own` times C_a^T C_b to the table, both ways for different rows. */
static void add_information(pvid_estimator_q31 *estimator, size_t a, size_t b, pvid_scaled_q31 own,
                            const pvid_weak_noise_work_q31 *work)
{
    const pvid_model_q31 *model = estimator->model;
    const bool same = a == b;
    for (size_t k = 0; k < model->n_c; k++) {
        if (model->c_row[k] != a) {
            continue;
        }
        const size_t i = model->c_column[k];
        const pvid_scaled_q31 part = pvid_scaled_times_q31(own, pvid_scaled_of_q31(work->c[k], work->f[i]));
        for (size_t l = 0; l < model->n_c; l++) {
            const size_t j = model->c_column[l];
            if ((model->c_row[l] != b) || (same && (j < i))) {
                continue;
            }
            int32_t twice = 0;
            if (!same && (i == j)) {
                twice = 1;
            }
            const pvid_scaled_q31 x = pvid_scaled_times_q31(part, pvid_scaled_of_q31(work->c[l], work->f[j] + twice));
            int32_t *place = &estimator->noise_table[(i < j) ? place_of(model->n_p, i, j) : place_of(model->n_p, j, i)];
            *place = pvid_scaled_packed_q31(pvid_scaled_plus_q31(pvid_scaled_unpacked_q31(*place), x));
        }
    }
}

void pvid_weak_noise_take_q31(pvid_estimator_q31 *estimator, const pvid_weak_design_q31 *design,
                              const pvid_weak_noise_q31 *one, const pvid_weak_noise_work_q31 *work,
                              const pvid_scaled_q31 theta[], size_t first, const int8_t n_bits[], int32_t y_bits,
                              pvid_scaled_q31 pull[])
{
    const size_t thetas = design->model->kind[one->kind].thetas;
    const size_t of_place[2] = {one->a, one->b};
    const pvid_scaled_q31 minus_one = pvid_scaled_of_q31(-1, 0);
    const pvid_scaled_q31 whole = pvid_scaled_times_q31(one->factor, work->share[one->power]);
    const pvid_scaled_q31 half = pvid_scaled_shifted_q31(whole, -1);
    for (size_t side = 0; side < 2u; side++) {
        const size_t own = of_place[side];
        const size_t other = of_place[1u - side];
        if (own < thetas) {
            const pvid_scaled_q31 g = pvid_scaled_times_q31(half, (other < thetas) ? theta[other] : minus_one);
            pull[own] =
                pvid_scaled_plus_q31(pull[own], pvid_scaled_shifted_q31(g, (int32_t)n_bits[first + own] + y_bits));
        }
    }
    if ((one->a < thetas) && (one->b < thetas)) {
        const int32_t bits = (int32_t)n_bits[first + one->a] + n_bits[first + one->b];
        const pvid_scaled_q31 own = pvid_scaled_shifted_q31((one->a == one->b) ? whole : half, bits);
        add_information(estimator, first + one->a, first + one->b, own, work);
    }
}

pvid_scaled_q31 pvid_weak_noise_error_share_q31(const pvid_weak_design_q31 *design, size_t kind,
                                                const pvid_scaled_q31 share[])
{
    const pvid_scaled_q31 functions = pvid_scaled_of_q31((int64_t)design->functions, 0);
    return pvid_scaled_over_q31(share[design->error_order[kind]], functions);
}

/* All of the variance is sum c_j Q_j / K, and the share of the equation's own error. */
pvid_scaled_q31 pvid_weak_noise_sensors_q31(const pvid_weak_design_q31 *design, pvid_scaled_q31 error_variance,
                                            pvid_scaled_q31 error_share)
{
    if (design->n_noise == 0u) {
        const pvid_scaled_q31 none = {0, 0};
        return none;
    }
    return pvid_scaled_minus_q31(pvid_scaled_of_q31(1, 0), pvid_scaled_times_q31(error_variance, error_share));
}
