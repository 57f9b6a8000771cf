#include "number/uncontracted.h"

/* A column of frequency f is sum_k chi_f psi of terms factor D^m[channel] with the derivatives moved to chi: it needs
 *
 *   sum over terms  factor (-1)^m (i omega_h)^m S_h[channel]  =  a_h + i b_h
 *
 * and multiplication by sin^n(pi t/T), n/2 times by sin^2: 1/2 x_h - 1/4 (x_(h-1) + x_(h+1)), with x_(-h) the conjugate of
 * x_h. The real parts at 0..M are the rows of the cosines, the imaginary parts at 1.. those of the sines. */
#include "fourier/columns_f32.h"

#include <string.h>

#define SKIP 1.0e-6f

void pvid_fourier_columns_add_f32(const pvid_fourier_design_f32 *design, const pvid_fourier_term_f32 *term,
                                  size_t harmonics, float omega, const float window[][2][PVID_MAX_HARMONICS],
                                  float folded[2][PVID_MAX_HARMONICS])
{
    if (design->model->channel[term->channel].gain == PVID_FOURIER_NONE) {
        /* the sums of 1: 2 hop at h = 0, where only order 0 counts */
        folded[0][0] += (term->order == 0u) ? (term->factor * (2.0f * (float)design->hop)) : 0.0f;
        return;
    }
    /* (-i omega)^m: 1, -i omega, -omega^2, i omega^3, omega^4, ... */
    const bool turned = (term->order % 2u) != 0u;
    const bool negative = ((term->order + 1u) % 4u) >= 2u;
    const float *re = window[term->channel][turned ? 1u : 0u];
    const float *im = window[term->channel][turned ? 0u : 1u];
    const float sign = negative ? -term->factor : term->factor;
    const float of_re = turned ? -sign : sign;
    for (size_t h = 0; h < harmonics; h++) {
        const float rate = (float)h * omega;
        float power = 1.0f;
        for (size_t i = 0; i < term->order; i++) {
            power *= rate;
        }
        folded[0][h] += (of_re * power) * re[h];
        folded[1][h] += (sign * power) * im[h];
    }
}

void pvid_fourier_columns_pass_f32(size_t harmonics, size_t pass, float folded[2][PVID_MAX_HARMONICS])
{
    const size_t end = harmonics - (1u + pass);
    float *re = folded[0];
    float *im = folded[1];
    float re_before = re[1];
    float im_before = -im[1];
    for (size_t h = 0; h < end; h++) {
        const float a = re[h];
        const float b = im[h];
        re[h] = (0.5f * a) - (0.25f * (re_before + re[h + 1u]));
        im[h] = (0.5f * b) - (0.25f * (im_before + im[h + 1u]));
        re_before = a;
        im_before = b;
    }
}

void pvid_fourier_columns_rows_f32(const pvid_fourier_design_f32 *design, size_t cosines,
                                   const float folded[2][PVID_MAX_HARMONICS], float column[])
{
    memcpy(column, folded[0], cosines * sizeof(float));
    memcpy(&column[cosines], &folded[1][1], (design->functions - cosines) * sizeof(float));
}

float pvid_fourier_columns_square_f32(size_t functions, const float x[])
{
    float square = 0.0f;
    for (size_t k = 0; k < functions; k++) {
        square += x[k] * x[k];
    }
    return square;
}

bool pvid_fourier_columns_keep_f32(size_t functions, const float nuisance[], float whole, float *inverse)
{
    const float left = pvid_fourier_columns_square_f32(functions, nuisance);
    const bool kept = (left >= 1.17549435e-38f) && (left <= 3.4e38f) && (left > (SKIP * whole));
    *inverse = kept ? (1.0f / left) : 0.0f;
    return kept;
}

void pvid_fourier_columns_project_f32(size_t functions, const float nuisance[], float inverse, float column[])
{
    float along = 0.0f;
    for (size_t k = 0; k < functions; k++) {
        along += nuisance[k] * column[k];
    }
    along *= inverse;
    for (size_t k = 0; k < functions; k++) {
        column[k] -= along * nuisance[k];
    }
}
