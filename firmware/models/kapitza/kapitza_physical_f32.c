#include "number/uncontracted.h"

#include "pvid/kapitza.h"

#include <math.h>

#include "number/finite_f32.h"

void pvid_kapitza_linear_f32(const pvid_kapitza_f32 *physical, float l1, float p[PVID_KAPITZA_P])
{
    const float big_l1 = l1 / physical->l2;
    const float ratio = physical->l2 / physical->rho2;
    const float big_l2 = ratio * ratio;
    p[PVID_KAPITZA_W] = physical->g / l1;
    p[PVID_KAPITZA_D1] = 1.0f + (big_l2 * (1.0f + big_l1));
    p[PVID_KAPITZA_D2] = big_l1 * big_l2;
}

/* Variance of a1 d1 + a2 d2. */
static float combined_variance(const pvid_estimate_f32 *estimate, float a1, float a2)
{
    const float own = (a1 * a1 * estimate->covariance[1][1]) + (a2 * a2 * estimate->covariance[2][2]);
    return own + (2.0f * a1 * a2 * estimate->covariance[1][2]);
}

static float root_or_zero(float x)
{
    return (x > 0.0f) ? sqrtf(x) : 0.0f;
}

bool pvid_kapitza_physical_f32(const pvid_estimate_f32 *estimate, float l1, pvid_kapitza_f32 *value,
                               pvid_kapitza_f32 *se)
{
    const float *p = estimate->p;
    const float w = p[PVID_KAPITZA_W];
    const float d2 = p[PVID_KAPITZA_D2];
    const float big_l2 = p[PVID_KAPITZA_D1] - d2 - 1.0f;
    if (!((w > 0.0f) && (d2 > 0.0f) && (big_l2 > 0.0f))) {
        return false;
    }
    const float root = sqrtf(big_l2);
    pvid_kapitza_f32 v;
    v.g = w * l1;
    v.l2 = (l1 * big_l2) / d2; /* l1/L1, L1 = d2/L2 */
    v.rho2 = (l1 * root) / d2; /* l2/sqrt(L2) */
    /* gradients over (d1, d2), with dL2 = dd1 - dd2 */
    const float l2_d1 = l1 / d2;
    const float l2_d2 = -(l1 + v.l2) / d2;
    const float rho2_d1 = l1 / (2.0f * root * d2);
    const float rho2_d2 = -rho2_d1 - (v.rho2 / d2);
    pvid_kapitza_f32 s;
    s.g = l1 * root_or_zero(estimate->covariance[0][0]);
    s.l2 = root_or_zero(combined_variance(estimate, l2_d1, l2_d2));
    s.rho2 = root_or_zero(combined_variance(estimate, rho2_d1, rho2_d2));
    if (!(pvid_finite_f32(v.g) && pvid_finite_f32(v.l2) && pvid_finite_f32(v.rho2) && pvid_finite_f32(s.g) &&
          pvid_finite_f32(s.l2) && pvid_finite_f32(s.rho2))) {
        return false;
    }
    *value = v;
    *se = s;
    return true;
}
