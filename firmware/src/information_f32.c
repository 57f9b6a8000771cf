#include "pvid/information.h"

#include <stddef.h>

/* exp(-x), 0 <= x <= 4, by the series of exp(x): the core has no libm but sqrtf. Accurate to a few
 * ulp; called once, in init. */
static float decay(float x)
{
    float sum = 1.0f;
    for (size_t k = 24; k > 0u; k--) {
        sum = 1.0f + ((x / (float)k) * sum);
    }
    return 1.0f / sum;
}

/* Rows between folds: long enough to be cheap, short enough for `low` to keep 17 bits of a term and
 * for forgetting to be smooth (a sixteenth of its time constant). */
#define BLOCK_MAX 64u

void pvid_information_init_f32(pvid_information_f32 *self, const pvid_model_f32 *model, float forgetting_groups)
{
    self->n_moments = model->n_moments;
    self->n_theta = model->n_theta;
    self->block = BLOCK_MAX;
    self->age = 0;
    self->retention = 1.0f;
    if (forgetting_groups > 0.0f) {
        if (forgetting_groups < 16.0f * (float)BLOCK_MAX) {
            self->block = (uint16_t)((forgetting_groups < 32.0f) ? 1.0f : (forgetting_groups / 16.0f));
        }
        self->retention = decay((float)self->block / forgetting_groups);
    }
    for (size_t i = 0; i < PVID_MAX_SUMS; i++) {
        self->high[i] = 0.0f;
        self->low[i] = 0.0f;
    }
}

static size_t number_of_sums(const pvid_information_f32 *self)
{
    return (size_t)self->n_moments + self->n_theta + 2u;
}

/* low[i] += a x[i] for i < count, and sums[i] = high[i] + low[i]. */
static void accumulate_scaled(float a, const float x[], size_t count, const float high[], float *restrict low,
                              float *restrict sums)
{
    for (size_t i = 0; i < count; i++) {
        low[i] += a * x[i];
        sums[i] = high[i] + low[i];
    }
}

static void accumulate_all(const float n[], size_t n_theta, float y, const float high[], float *restrict low,
                           float *restrict sums)
{
    const float one = 1.0f;
    size_t k = 0;
    for (size_t i = 0; i < n_theta; i++) {
        accumulate_scaled(n[i], &n[i], n_theta - i, &high[k], &low[k], &sums[k]);
        k += n_theta - i;
    }
    accumulate_scaled(y, n, n_theta, &high[k], &low[k], &sums[k]);
    k += n_theta;
    accumulate_scaled(y, &y, 1, &high[k], &low[k], &sums[k]);
    accumulate_scaled(one, &one, 1, &high[k + 1u], &low[k + 1u], &sums[k + 1u]);
}

void pvid_information_add_f32(pvid_information_f32 *self, const pvid_model_f32 *model, const float n[], float y,
                              float sums[PVID_MAX_SUMS])
{
    if (model->accumulate != NULL) {
        model->accumulate(n, y, self->high, self->low, sums);
    } else {
        accumulate_all(n, model->n_theta, y, self->high, self->low, sums);
    }
}

void pvid_information_end_group_f32(pvid_information_f32 *self)
{
    self->age++;
    if (self->age < self->block) {
        return;
    }
    self->age = 0;
    const size_t sums = number_of_sums(self);
    const float retention = self->retention;
    for (size_t i = 0; i < sums; i++) {
        const float high = self->high[i] * retention;
        const float low = self->low[i] * retention;
        const float total = high + low; /* Knuth's two-sum: total + error = high + low exactly */
        const float part = total - high;
        const float error = (high - (total - part)) + (low - part);
        self->high[i] = total;
        self->low[i] = error;
    }
}

void pvid_information_read_f32(const pvid_information_f32 *self, float sums[PVID_MAX_SUMS])
{
    const size_t n = number_of_sums(self);
    for (size_t i = 0; i < n; i++) {
        sums[i] = self->high[i] + self->low[i];
    }
}
