#include "number/uncontracted.h"

/* The strong form of Kapitza's pendulum (theory.md 2) as a model: row, theta, C. */
#include "kapitza_strong_f32.h"

#include <stddef.h>

#include "kapitza_row_f32.h"
#include "kapitza_solve_f32.h"
#include "kapitza_sums_f32.h"
#include "number/unroll.h"
#include "solve/row_f32.h"
#include "solve/commit.h"

enum { W = PVID_KAPITZA_W, D1 = PVID_KAPITZA_D1, D2 = PVID_KAPITZA_D2 };

void pvid_kapitza_strong_row_f32(const float phi[5], const float u[3], float *y, float n[PVID_KAPITZA_STRONG_THETA])
{
    pvid_kapitza_row_f32(phi, u, y, n);
}

static void theta_of(const float p[], float theta[])
{
    const float w = p[W];
    const float w2 = w * w;
    const float w3 = w2 * w;
    theta[0] = w;
    theta[1] = w2;
    theta[2] = p[D1];
    theta[3] = 3.0f * (p[D1] * w);
    theta[4] = 3.0f * (p[D1] * w2);
    theta[5] = p[D1] * w3;
    theta[6] = p[D2];
    theta[7] = 4.0f * (p[D2] * w);
    theta[8] = 6.0f * (p[D2] * w2);
    theta[9] = 4.0f * (p[D2] * w3);
    theta[10] = p[D2] * (w3 * w);
}

static const uint8_t c_row[18] = {0, 1, 3, 4, 5, 7, 8, 9, 10, 2, 3, 4, 5, 6, 7, 8, 9, 10};
static const uint8_t c_column[18] = {W, W, W, W, W, W, W, W, W, D1, D1, D1, D1, D2, D2, D2, D2, D2};

static void jacobian_of(const float p[], float c[])
{
    const float w = p[W];
    const float w2 = w * w;
    const float w3 = w2 * w;
    c[0] = 1.0f;
    c[1] = 2.0f * w;
    c[2] = 3.0f * p[D1];
    c[3] = 6.0f * (p[D1] * w);
    c[4] = 3.0f * (p[D1] * w2);
    c[5] = 4.0f * p[D2];
    c[6] = 12.0f * (p[D2] * w);
    c[7] = 12.0f * (p[D2] * w2);
    c[8] = 4.0f * (p[D2] * w3);
    c[9] = 1.0f;
    c[10] = 3.0f * w;
    c[11] = 3.0f * w2;
    c[12] = w3;
    c[13] = 1.0f;
    c[14] = 4.0f * w;
    c[15] = 6.0f * w2;
    c[16] = 4.0f * w3;
    c[17] = w3 * w;
}

static float innovate_of(const float p[], const float n[], float y, float gradient[])
{
    const float w = p[W];
    const float d1 = p[D1];
    const float d2 = p[D2];
    const float two_w = 2.0f * w;
    const float w2 = w * w;
    /* -G^2 phi'', -G^3 phi, and from them n_1 = -G^3 phi'', n_2 = -G^4 phi: G x = u x + w x */
    const float g2_low = (n[3] + (two_w * n[4])) + (w2 * n[5]);
    const float g2_high = (n[2] + (two_w * n[3])) + (w2 * n[4]);
    const float g3_low = ((n[7] + (w * n[8])) + (two_w * (n[8] + (w * n[9])))) + (w2 * (n[9] + (w * n[10])));
    const float g3_high = ((n[6] + (w * n[7])) + (two_w * (n[7] + (w * n[8])))) + (w2 * (n[8] + (w * n[9])));
    const float n_1 = g2_high + (w * g2_low);
    const float n_2 = g3_high + (w * g3_low);
    gradient[W] = (n[PVID_N_A] + (two_w * n[PVID_N_E])) + (((3.0f * d1) * g2_low) + ((4.0f * d2) * g3_low));
    gradient[D1] = n_1;
    gradient[D2] = n_2;
    return (y - (w * (n[PVID_N_A] + (w * n[PVID_N_E])))) - ((d1 * n_1) + (d2 * n_2));
}

/* pvid_row_squares_f32 of 11 entries. */
static inline float sum_of_squares_strong(const float n[], float y)
{
    float squares = y * y;
    PVID_UNROLL
    for (size_t i = 0; i < PVID_KAPITZA_STRONG_THETA; i++) {
        squares += n[i] * n[i];
    }
    return squares;
}

pvid_reason pvid_kapitza_take_row_f32(pvid_estimator_f32 *self, const float n[], float y, float e,
                                      const float gradient[], bool ends_group)
{
    pvid_reason reason = pvid_row_accept_f32(self, PVID_KAPITZA_STRONG_THETA, n, y, sum_of_squares_strong(n, y));
    if (reason != PVID_ACCUMULATED) {
        return reason;
    }
    if (self->settings.gain < 1.0f) {
        pvid_row_accumulate_innovation_f32(self, PVID_KAPITZA_P, gradient, e);
    }
    pvid_count_up(&self->counters.rows);
    if (ends_group && pvid_solve_is_due(&self->phase, self->divider)) {
        reason = pvid_kapitza_solve_f32(self, n, y);
    } else {
        pvid_kapitza_add_f32(n, y, self->information.high, self->information.low);
    }
    if (ends_group) {
        pvid_information_end_group_f32(&self->information);
    }
    return reason;
}

const pvid_model_f32 pvid_kapitza_strong_f32 = {
    .n_theta = PVID_KAPITZA_STRONG_THETA,
    .n_p = PVID_KAPITZA_P,
    .n_moments = PVID_KAPITZA_STRONG_MOMENTS,
    .n_c = 18,
    .positive = 7u,
    .c_row = c_row,
    .c_column = c_column,
    .theta = theta_of,
    .jacobian = jacobian_of,
    .accumulate = pvid_kapitza_accumulate_f32,
    .project = pvid_kapitza_project_f32,
    .innovate = innovate_of,
    .take_row = pvid_kapitza_take_row_f32,
};
