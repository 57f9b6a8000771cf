#include "number/uncontracted.h"

#include "number/short_loops.h"

/* A column of a test function chi is sum_k chi psi of terms factor D^m[channel] with the derivatives moved to chi. It
 * is a combination of the parts of
 *
 *   sum over terms  factor (-1)^m (i omega_h)^m S_h[channel]  =  a_h + i b_h,
 *
 * the same for all columns: white_f32.c. Here they are in standard deviations. */
#include "weak/columns_f32.h"

#include "number/exact.h"
#include "number/finite_f32.h"
#include "solve/products_f32.h"
#include "weak/white_f32.h"

#define SKIP 1.0e-6f

/* Numbers between the sums of a channel at two harmonics. */
#define BETWEEN (2u * (size_t)PVID_MAX_CHANNELS)

void pvid_weak_columns_add_f32(const pvid_weak_design_f32 *design, const pvid_weak_term_f32 *term,
                               const pvid_weak_white_f32 *white, const float window[][PVID_MAX_CHANNELS][2],
                               float part[2][PVID_MAX_HARMONICS])
{
    if (design->model->channel[term->channel].gain == PVID_WEAK_NONE) {
        /* the sums of 1: 2 hop at h = 0, where only order 0 counts */
        part[0][0] += (term->order == 0u) ? (white->scale[0] * (term->factor * (2.0f * (float)design->hop))) : 0.0f;
        return;
    }
    /* (-i omega)^m: 1, -i omega, -omega^2, i omega^3, omega^4, ... */
    const bool turned = (term->order % 2u) != 0u;
    const bool negative = ((term->order + 1u) % 4u) >= 2u;
    const float *re = &window[0][term->channel][turned ? 1u : 0u];
    const float *im = &window[0][term->channel][turned ? 0u : 1u];
    const float sign = negative ? -term->factor : term->factor;
    const float of_re = turned ? -sign : sign;
    const float unit = white->omega;
    const size_t order = term->order;
    const size_t harmonics = pvid_weak_harmonics(design);
    const size_t sines = pvid_weak_sines(design);
    for (size_t h = 0; h < harmonics; h++) {
        const float rate = (float)h * unit;
        float weight = white->scale[h];
        for (size_t i = order; i > 0u; i--) {
            weight *= rate;
        }
        part[0][h] += (of_re * weight) * re[h * BETWEEN];
        if (h <= sines) {
            part[1][h] += (sign * weight) * im[h * BETWEEN];
        }
    }
}

bool pvid_weak_columns_keep_f32(size_t rows, const float nuisance[], float whole, float *inverse)
{
    const float left = pvid_product_f32(nuisance, nuisance, rows);
    const bool kept = (left >= PVID_LEAST_NORMAL_F32) && (left <= 3.4e38f) && (left > (SKIP * whole));
    *inverse = kept ? (1.0f / left) : 0.0f;
    return kept;
}

void pvid_weak_columns_project_f32(size_t rows, const float nuisance[], float inverse, float column[])
{
    const float along = pvid_product_f32(nuisance, column, rows) * inverse;
    const size_t count = PVID_COUNT(PVID_MAX_FUNCTIONS, rows);
    for (size_t k = 0; k < count; k++) {
        column[k] -= along * nuisance[k];
    }
}
