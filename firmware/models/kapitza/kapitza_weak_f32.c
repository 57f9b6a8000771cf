#include "number/uncontracted.h"

#include "pvid/kapitza_weak.h"

enum { W = PVID_KAPITZA_W, D1 = PVID_KAPITZA_D1, D2 = PVID_KAPITZA_D2, C = PVID_KAPITZA_C };

static void zeroed_theta_of(const float p[], float theta[])
{
    theta[0] = p[D1];
    theta[1] = p[D1] * p[W];
    theta[2] = p[D2];
    theta[3] = p[D2] * p[W];
    theta[4] = theta[3] * p[W];
}

static void theta_of(const float p[], float theta[])
{
    zeroed_theta_of(p, theta);
    theta[5] = p[D2] * p[C];
    theta[6] = theta[5] * p[W];
    theta[7] = theta[6] * p[W];
}

static const uint8_t c_row[16] = {1, 3, 4, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7, 5, 6, 7};
static const uint8_t c_column[16] = {W, W, W, W, W, D1, D1, D2, D2, D2, D2, D2, D2, C, C, C};

static void jacobian_of(const float p[], float c[])
{
    const float w = p[W];
    const float w2 = w * w;
    const float d2c = p[D2] * p[C];
    c[0] = p[D1];
    c[1] = p[D2];
    c[2] = 2.0f * (p[D2] * w);
    c[3] = d2c;
    c[4] = 2.0f * (d2c * w);
    c[5] = 1.0f;
    c[6] = w;
    c[7] = 1.0f;
    c[8] = w;
    c[9] = w2;
    c[10] = p[C];
    c[11] = p[C] * w;
    c[12] = p[C] * w2;
    c[13] = p[D2];
    c[14] = p[D2] * w;
    c[15] = p[D2] * w2;
}

static const uint8_t zeroed_c_row[8] = {1, 3, 4, 0, 1, 2, 3, 4};
static const uint8_t zeroed_c_column[8] = {W, W, W, D1, D1, D2, D2, D2};

static void zeroed_jacobian_of(const float p[], float c[])
{
    const float w = p[W];
    c[0] = p[D1];
    c[1] = p[D2];
    c[2] = 2.0f * (p[D2] * w);
    c[3] = 1.0f;
    c[4] = w;
    c[5] = 1.0f;
    c[6] = w;
    c[7] = w * w;
}

/* Noise of phi is in N2 = -int chi'' phi and N5 = -int chi phi; their factors c_2 and c_5 in C^T N do not depend
 * on the offset. The double integrals of the noise are small in comparison. */
static void noise_of(const float p[], const float traces[PVID_NOISE_TRACES], float s[][PVID_MAX_P])
{
    const float w = p[W];
    const float w2 = w * w;
    const float two_d2w = 2.0f * (p[D2] * w);
    const float c2[2] = {p[D1], w};    /* of w, d1 */
    const float c5[2] = {two_d2w, w2}; /* of w, d2 */
    const float mixed = c2[0] * c5[0];
    s[W][W] = ((c2[0] * c2[0]) * traces[0]) + (((2.0f * mixed) * traces[1]) + ((c5[0] * c5[0]) * traces[2]));
    s[W][D1] = ((c2[0] * c2[1]) * traces[0]) + ((c5[0] * c2[1]) * traces[1]);
    s[W][D2] = ((c2[0] * c5[1]) * traces[1]) + ((c5[0] * c5[1]) * traces[2]);
    s[D1][D1] = (c2[1] * c2[1]) * traces[0];
    s[D1][D2] = (c2[1] * c5[1]) * traces[1];
    s[D2][D2] = (c5[1] * c5[1]) * traces[2];
}

static void noise_with_zero(const float p[], const float traces[PVID_NOISE_TRACES], float s[][PVID_MAX_P])
{
    noise_of(p, traces, s);
    for (int i = 0; i <= C; i++) {
        s[i][C] = 0.0f;
    }
}

const pvid_model_f32 pvid_kapitza_weak_f32 = {
    .n_theta = PVID_KAPITZA_WEAK_THETA,
    .n_p = PVID_KAPITZA_WEAK_P,
    .n_moments = (PVID_KAPITZA_WEAK_THETA * (PVID_KAPITZA_WEAK_THETA + 1)) / 2,
    .n_c = 16,
    .positive = 7u,
    .c_row = c_row,
    .c_column = c_column,
    .theta = theta_of,
    .jacobian = jacobian_of,
    .noise = noise_with_zero,
};

#if PVID_KAPITZA_HAS_FRICTION
static void friction_theta_of(const float p[], float theta[])
{
    theta_of(p, theta);
    theta[8] = p[PVID_KAPITZA_C1];
    theta[9] = p[PVID_KAPITZA_C2];
}

static const uint8_t friction_c_row[18] = {1, 3, 4, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7, 5, 6, 7, 8, 9};
static const uint8_t friction_c_column[18] = {
    W, W, W, W, W, D1, D1, D2, D2, D2, D2, D2, D2, C, C, C, PVID_KAPITZA_C1, PVID_KAPITZA_C2};

static void friction_jacobian_of(const float p[], float c[])
{
    jacobian_of(p, c);
    c[16] = 1.0f;
    c[17] = 1.0f;
}

const pvid_model_f32 pvid_kapitza_friction_f32 = {
    .n_theta = PVID_KAPITZA_FRICTION_THETA,
    .n_p = PVID_KAPITZA_FRICTION_P,
    .n_gated = PVID_KAPITZA_WEAK_P,
    .n_moments = (PVID_KAPITZA_FRICTION_THETA * (PVID_KAPITZA_FRICTION_THETA + 1)) / 2,
    .n_c = 18,
    .positive = 7u,
    .c_row = friction_c_row,
    .c_column = friction_c_column,
    .theta = friction_theta_of,
    .jacobian = friction_jacobian_of,
    .noise = noise_with_zero,
};
#endif

const pvid_model_f32 pvid_kapitza_weak_zeroed_f32 = {
    .n_theta = PVID_KAPITZA_ZEROED_THETA,
    .n_p = PVID_KAPITZA_P,
    .n_moments = (PVID_KAPITZA_ZEROED_THETA * (PVID_KAPITZA_ZEROED_THETA + 1)) / 2,
    .n_c = 8,
    .positive = 7u,
    .c_row = zeroed_c_row,
    .c_column = zeroed_c_column,
    .theta = zeroed_theta_of,
    .jacobian = zeroed_jacobian_of,
    .noise = noise_of,
};
