/* Any state of an estimator that its functions keep. */
#ifndef ANY_ESTIMATOR_Q31_H
#define ANY_ESTIMATOR_Q31_H

#include "prove.h"

#include "number/integer_q31.h"
#include "pvid/estimator_q31.h"
#include "solve/kinds.h"

/* Of every sum: what the end of a group leaves by Cauchy and Schwarz, 2^60, or a step of b and rr, 2^61, and on top of
 * that 16 rows of a group. */
#define SUM_BOUND ((int64_t)3 << 60)
#define EXPONENT_BOUND 1000

/* A model of three kinds of rows with the most theta and non-zeros of C, and with any values of them. */
static const uint8_t blocks_end[3] = {4, 5, PVID_MAX_THETA_Q31};
static const uint8_t blocks_row[PVID_MAX_C_Q31] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0, 4, 10, 1, 2, 3, 5, 6, 7, 8, 9};
static const uint8_t blocks_column[PVID_MAX_C_Q31] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 3};

#define DENSE_C 16u
static const uint8_t dense_row[DENSE_C] = {1, 3, 4, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7, 5, 6, 7};
static const uint8_t dense_column[DENSE_C] = {0, 0, 0, 0, 0, 1, 1, 2, 2, 2, 2, 2, 2, 3, 3, 3};

static void blocks_theta(const int32_t p[], int64_t theta[])
{
    (void)p;
    for (size_t i = 0; i < PVID_MAX_THETA_Q31; i++) {
        theta[i] = any_i64(-((int64_t)1 << 60), (int64_t)1 << 60);
    }
}

static void blocks_jacobian(const int32_t p[], int64_t c[])
{
    (void)p;
    for (size_t k = 0; k < PVID_MAX_C_Q31; k++) {
        c[k] = any_i64(-((int64_t)1 << 60), (int64_t)1 << 60);
    }
}

static void blocks_formats(const int8_t p_bits[], int16_t theta_bits[], int16_t c_bits[])
{
    (void)p_bits;
    for (size_t i = 0; i < PVID_MAX_THETA_Q31; i++) {
        theta_bits[i] = (int16_t)any_i32(-500, 500);
    }
    for (size_t k = 0; k < PVID_MAX_C_Q31; k++) {
        c_bits[k] = (int16_t)any_i32(-500, 500);
    }
}

static const pvid_model_q31 blocks = {
    .n_theta = PVID_MAX_THETA_Q31,
    .n_p = 4,
    .n_kinds = 3,
    .n_c = PVID_MAX_C_Q31,
    .positive = 5u,
    .kind_end = blocks_end,
    .c_row = blocks_row,
    .c_column = blocks_column,
    .theta = blocks_theta,
    .jacobian = blocks_jacobian,
    .formats = blocks_formats,
};

/* The same with one kind of rows. */
static const pvid_model_q31 dense = {
    .n_theta = 8,
    .n_p = 4,
    .n_c = DENSE_C,
    .positive = 7u,
    .c_row = dense_row,
    .c_column = dense_column,
    .theta = blocks_theta,
    .jacobian = blocks_jacobian,
    .formats = blocks_formats,
};

static void numbers_theta(const pvid_scaled_q31 p[], pvid_scaled_q31 theta[])
{
    (void)p;
    for (size_t i = 0; i < PVID_MAX_THETA_Q31; i++) {
        theta[i].m = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
        theta[i].e = any_i32(-EXPONENT_BOUND, EXPONENT_BOUND);
    }
}

static void numbers_jacobian(const pvid_scaled_q31 p[], pvid_scaled_q31 c[])
{
    (void)p;
    for (size_t k = 0; k < PVID_MAX_C_Q31; k++) {
        c[k].m = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
        c[k].e = any_i32(-EXPONENT_BOUND, EXPONENT_BOUND);
    }
}

static const pvid_scaled_model_q31 numbers_of_any_size = {numbers_theta, numbers_jacobian, &pvid_read_scaled_q31};

/* The same with numbers of any size. */
static const pvid_model_q31 numbers = {
    .n_theta = PVID_MAX_THETA_Q31,
    .n_p = 4,
    .n_kinds = 3,
    .n_c = PVID_MAX_C_Q31,
    .positive = 5u,
    .kind_end = blocks_end,
    .c_row = blocks_row,
    .c_column = blocks_column,
    .scaled = &numbers_of_any_size,
};

static inline void any_sums(const pvid_model_q31 *model, pvid_information_q31 *sums)
{
    sums->n_theta = model->n_theta;
    const size_t moments = pvid_kinds_moments(model->n_theta, model->n_kinds, model->kind_end);
    sums->n_sums = (uint16_t)(moments + model->n_theta + 2u);
    sums->exponent = (uint8_t)any_u32(0, 100);
    sums->block = (uint16_t)any_u32(1, 64);
    sums->age = (uint16_t)any_u32(0, 63);
    sums->retention = any_i32(1, INT32_MAX);
    sums->row_weight = any_u32(1, 65536);
    for (size_t i = 0; i < PVID_MAX_SUMS_Q31; i++) {
        sums->sums[i] = any_i64(-SUM_BOUND, SUM_BOUND);
    }
    sums->sums[sums->n_sums - 2u] = any_i64(0, SUM_BOUND);
    sums->sums[sums->n_sums - 1u] = any_i64(0, SUM_BOUND);
}

static inline void any_parameters(pvid_estimator_q31 *self)
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        const int32_t least = (((self->model->positive >> a) & 1u) != 0u) ? 1 : -INT32_MAX;
        self->p[a] = any_i32(least, INT32_MAX);
        self->settings.lower[a] = any_i32(least, INT32_MAX);
        self->settings.upper[a] = any_i32(least, INT32_MAX);
        self->settings.start_sd[a] = any_i32(1, INT32_MAX);
        self->settings.prior[a] = any_i32(0, INT32_MAX);
        self->settings.prior_exponent[a] = (int16_t)any_i32(-200, 200);
        self->settings.p_bits[a] = (int8_t)any_i32(-64, 64);
    }
}

static inline void any_formats(pvid_estimator_q31 *self)
{
    for (size_t i = 0; i < self->model->n_theta; i++) {
        self->theta[i] = any_i64(-((int64_t)1 << 60), (int64_t)1 << 60);
        self->mantissa[i] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
        self->shift[i] = (int16_t)any_i32(-2 * EXPONENT_BOUND, 2 * EXPONENT_BOUND);
        self->align[i] = (int16_t)any_i32(-EXPONENT_BOUND, EXPONENT_BOUND);
        self->theta_bits[i] = (int16_t)any_i32(-EXPONENT_BOUND, EXPONENT_BOUND);
        self->fresh[i] = any_i64(-SUM_BOUND, SUM_BOUND);
    }
    for (size_t k = 0; k < self->model->n_c; k++) {
        self->c_exponent[k] = (int16_t)any_i32(-EXPONENT_BOUND, EXPONENT_BOUND);
    }
}

static inline void any_state(const pvid_model_q31 *model, pvid_estimator_q31 *self)
{
    self->model = model;
    any_sums(model, &self->information);
    any_parameters(self);
    any_formats(self);
    self->settings.n_p = model->n_p;
    self->settings.positive = (uint8_t)model->positive;
    self->settings.blocked = (uint8_t)any_u32(0, 255);
    self->settings.row_sd = any_i32(1, INT32_MAX);
    self->settings.gain = any_i32(0, PVID_ONE_Q30);
    self->settings.correlation = any_u32((uint32_t)1 << 16, (uint32_t)1 << 31);
    self->settings.step_limit = any_u32(1, 58982);
    self->settings.kappa_min = any_i32(0, PVID_ONE_Q30);
    self->settings.noise_margin = any_u32(0, (uint32_t)1 << 30);
    self->settings.dead_zone = any_u32(0, (uint32_t)100 << 16);
    self->noise_rows = (uint16_t)any_u32(0, UINT16_MAX);
    for (size_t i = 0; i < sizeof self->noise_table / sizeof self->noise_table[0]; i++) {
        self->noise_table[i] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30 + 2047);
    }
    self->group_rss = any_i64(0, PVID_WIDE);
    self->group_weight = any_i64(0, PVID_WIDE);
    self->expected.m = any_i32(0, PVID_ONE_Q30);
    self->expected.e = any_i32(-2000, 2000);
    self->divider = (uint16_t)any_u32(1, UINT16_MAX);
    self->phase = (uint16_t)any_u32(0, UINT16_MAX);
    Frama_C_make_unknown((char *)&self->counters, sizeof self->counters);
}

#endif
