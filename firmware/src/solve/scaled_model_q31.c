#include "solve/scaled_model_q31.h"

#include <stddef.h>

#include "number/integer_q31.h"
#include "number/scaled_q31.h"

#define THETA_MAX ((int64_t)1 << 60)
#define THETA_BITS 40          /* of theta at the start, or of what a standard deviation of p changes it by */
#define FORMAT_LIMIT 500       /* of theta */
#define LENGTH_OF_ZERO (-9000) /* never the largest */

/* p as numbers in its unit. */
static void numbers_of(const pvid_estimator_q31 *self, const int32_t p[], pvid_scaled_q31 numbers[])
{
    for (size_t a = 0; a < self->model->n_p; a++) {
        numbers[a] = pvid_scaled_of_q31(p[a], -(int32_t)self->settings.p_bits[a]);
    }
}

static void scaled_theta(const pvid_estimator_q31 *self, const int32_t p[], int64_t theta[])
{
    pvid_scaled_q31 numbers[PVID_MAX_P];
    pvid_scaled_q31 found[PVID_MAX_THETA_Q31];
    numbers_of(self, p, numbers);
    self->model->scaled->theta(numbers, found);
    for (size_t i = 0; i < self->model->n_theta; i++) {
        theta[i] = pvid_clamp_q31(pvid_scaled_fixed_q31(found[i], self->theta_bits[i]), THETA_MAX);
    }
}

static void scaled_jacobian(const pvid_estimator_q31 *self, int64_t value[], int32_t exponent[])
{
    pvid_scaled_q31 numbers[PVID_MAX_P];
    pvid_scaled_q31 c[PVID_MAX_C_Q31];
    numbers_of(self, self->p, numbers);
    self->model->scaled->jacobian(numbers, c);
    for (size_t k = 0; k < self->model->n_c; k++) {
        value[k] = c[k].m;
        exponent[k] += c[k].e;
    }
}

/* Bits of |x| before the point. */
static int32_t length_of(pvid_scaled_q31 x)
{
    return (x.m == 0) ? LENGTH_OF_ZERO : ((int32_t)pvid_bit_length_q31(pvid_magnitude_q31(x.m)) + x.e);
}

static void scaled_formats(const pvid_estimator_q31 *self, const pvid_estimator_config_q31 *config, int16_t bits[])
{
    const pvid_model_q31 *model = self->model;
    pvid_scaled_q31 numbers[PVID_MAX_P];
    pvid_scaled_q31 theta[PVID_MAX_THETA_Q31];
    pvid_scaled_q31 c[PVID_MAX_C_Q31];
    int32_t length[PVID_MAX_THETA_Q31];
    numbers_of(self, config->start, numbers);
    model->scaled->theta(numbers, theta);
    model->scaled->jacobian(numbers, c);
    for (size_t i = 0; i < model->n_theta; i++) {
        length[i] = length_of(theta[i]);
    }
    numbers_of(self, config->start_sd, numbers);
    for (size_t k = 0; k < model->n_c; k++) {
        const int32_t change = length_of(pvid_scaled_times_q31(c[k], numbers[model->c_column[k]]));
        const size_t i = model->c_row[k];
        length[i] = (change > length[i]) ? change : length[i];
    }
    for (size_t i = 0; i < model->n_theta; i++) {
        bits[i] = (int16_t)pvid_clamp_q31(THETA_BITS - (int64_t)length[i], FORMAT_LIMIT);
    }
}

const struct pvid_scaled_adapter_q31 pvid_read_scaled_q31 = {scaled_theta, scaled_jacobian, scaled_formats};
