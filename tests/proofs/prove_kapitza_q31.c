/* The models: theta, its Jacobian and the formats of both of any p and any formats that the estimator takes; the rows
 * of the strong form from any derivatives within their limit and any shifts. theta and C stay within +-2^60. */
#include "prove.h"

#include "pvid/kapitza_strong_q31.h"
#include "pvid/kapitza_weak_q31.h"

static void any_model(const pvid_model_q31 *model)
{
    int32_t p[PVID_MAX_P];
    int8_t p_bits[PVID_MAX_P];
    int64_t theta[PVID_MAX_THETA_Q31];
    int64_t c[PVID_MAX_C_Q31];
    int16_t theta_bits[PVID_MAX_THETA_Q31];
    int16_t c_bits[PVID_MAX_C_Q31];
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        p[i] = any_i32(-INT32_MAX, INT32_MAX);
        p_bits[i] = (int8_t)any_i32(-128, 127);
    }
    model->theta(p, theta);
    model->jacobian(p, c);
    model->formats(p_bits, theta_bits, c_bits);
    for (size_t i = 0; i < model->n_theta; i++) {
        /*@ assert -0x1000000000000000 <= theta[i] <= 0x1000000000000000; */
    }
    for (size_t k = 0; k < model->n_c; k++) {
        /*@ assert -0x1000000000000000 <= c[k] <= 0x1000000000000000; */
    }
}

static uint8_t any_shift(void)
{
    return (uint8_t)any_u32(0, 62);
}

static void any_row(void)
{
    pvid_strong_row_q31 shifts = {.n_a = any_shift(), .n_e = any_shift(), .part = any_shift(), .y = any_shift()};
    for (size_t k = 0; k < 4u; k++) {
        shifts.n_phi2[k] = any_shift();
    }
    for (size_t k = 0; k < 5u; k++) {
        shifts.n_phi0[k] = any_shift();
    }
    int32_t phi[PVID_ORDERS];
    int32_t u[PVID_Y_ORDERS_Q31];
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        phi[k] = any_i32(-PVID_DERIVATIVE_LIMIT_Q31, PVID_DERIVATIVE_LIMIT_Q31);
    }
    for (size_t k = 0; k < PVID_Y_ORDERS_Q31; k++) {
        u[k] = any_i32(-PVID_DERIVATIVE_LIMIT_Q31, PVID_DERIVATIVE_LIMIT_Q31);
    }
    int32_t y;
    int32_t n[PVID_KAPITZA_STRONG_THETA];
    (void)pvid_kapitza_strong_row_q31(&shifts, phi, u, &y, n);
}

void main(void)
{
    any_model(&pvid_kapitza_weak_q31);
    any_model(&pvid_kapitza_weak_zeroed_q31);
    any_model(&pvid_kapitza_strong_q31);
    any_row();
}
