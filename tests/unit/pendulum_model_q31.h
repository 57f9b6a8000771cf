/* A fixed-point model in formats of its own, written by hand: theta = (d1, d1 w, d2, d2 w, d2 w^2, d2 c, d2 c w,
 * d2 c w^2) of p = (w, d1, d2, c). */
#ifndef PENDULUM_MODEL_Q31_H
#define PENDULUM_MODEL_Q31_H

#include "number/integer_q31.h"
#include "pvid/model_q31.h"

enum { W, D1, D2, C };

/* p has 31 bits: a single factor is shifted up to 46 bits, a product of two down to 46; a third factor shifts by
 * 31. */
#define UP 15
#define DOWN 16
#define ONE_BITS (30 + UP)

static int64_t scale_up(int64_t x)
{
    return x * ((int64_t)1 << UP);
}

static int64_t product(int32_t a, int32_t b)
{
    return pvid_round_shift_q31(pvid_product_q31(a, b), DOWN);
}

static void theta_of(const int32_t p[], int64_t theta[])
{
    theta[0] = scale_up(p[D1]);
    theta[1] = product(p[D1], p[W]);
    theta[2] = scale_up(p[D2]);
    theta[3] = product(p[D2], p[W]);
    theta[4] = pvid_times_q31(theta[3], p[W]);
    theta[5] = product(p[D2], p[C]);
    theta[6] = pvid_times_q31(theta[5], p[W]);
    theta[7] = pvid_times_q31(theta[6], p[W]);
}

static const uint8_t c_row[16] = {1, 3, 4, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7, 5, 6, 7};
static const uint8_t c_column[16] = {W, W, W, W, W, D1, D1, D2, D2, D2, D2, D2, D2, C, C, C};

static void jacobian_of(const int32_t p[], int64_t c[])
{
    int64_t theta[8];
    theta_of(p, theta);
    c[0] = theta[0];
    c[1] = theta[2];
    c[2] = 2 * theta[3];
    c[3] = theta[5];
    c[4] = 2 * theta[6];
    c[5] = (int64_t)1 << ONE_BITS;
    c[6] = scale_up(p[W]);
    c[7] = (int64_t)1 << ONE_BITS;
    c[8] = scale_up(p[W]);
    c[9] = product(p[W], p[W]);
    c[10] = scale_up(p[C]);
    c[11] = product(p[C], p[W]);
    c[12] = pvid_times_q31(c[11], p[W]);
    c[13] = theta[2];
    c[14] = theta[3];
    c[15] = theta[4];
}

static void formats_of(const int8_t p_bits[], int16_t theta_bits[], int16_t c_bits[])
{
    theta_bits[0] = (int16_t)(p_bits[D1] + UP);
    theta_bits[1] = (int16_t)(p_bits[D1] + p_bits[W] - DOWN);
    theta_bits[2] = (int16_t)(p_bits[D2] + UP);
    theta_bits[3] = (int16_t)(p_bits[D2] + p_bits[W] - DOWN);
    theta_bits[4] = (int16_t)(theta_bits[3] + p_bits[W] - 31);
    theta_bits[5] = (int16_t)(p_bits[D2] + p_bits[C] - DOWN);
    theta_bits[6] = (int16_t)(theta_bits[5] + p_bits[W] - 31);
    theta_bits[7] = (int16_t)(theta_bits[6] + p_bits[W] - 31);
    c_bits[0] = theta_bits[0];
    c_bits[1] = theta_bits[2];
    c_bits[2] = theta_bits[3];
    c_bits[3] = theta_bits[5];
    c_bits[4] = theta_bits[6];
    c_bits[5] = ONE_BITS;
    c_bits[6] = (int16_t)(p_bits[W] + UP);
    c_bits[7] = ONE_BITS;
    c_bits[8] = c_bits[6];
    c_bits[9] = (int16_t)(p_bits[W] + p_bits[W] - DOWN);
    c_bits[10] = (int16_t)(p_bits[C] + UP);
    c_bits[11] = (int16_t)(p_bits[C] + p_bits[W] - DOWN);
    c_bits[12] = (int16_t)(c_bits[11] + p_bits[W] - 31);
    c_bits[13] = theta_bits[2];
    c_bits[14] = theta_bits[3];
    c_bits[15] = theta_bits[4];
}

static const pvid_model_q31 pendulum_model_q31 = {
    .n_theta = 8,
    .n_p = 4,
    .n_c = 16,
    .positive = 7u,
    .c_row = c_row,
    .c_column = c_column,
    .theta = theta_of,
    .jacobian = jacobian_of,
    .formats = formats_of,
};

#endif
