#include "pvid/differentiator.h"

#include <stddef.h>

#include "finite_f32.h"

const float pvid_five_points_f32[PVID_ORDERS * 2] = {
    0.0f,         0.0f,          /* order 0: the centre itself */
    8.0f / 12.0f, -1.0f / 12.0f, /* order 1 */
    16.0f / 12.0f, -1.0f / 12.0f, /* order 2 */
    -1.0f,        0.5f,          /* order 3 */
    -4.0f,        1.0f,          /* order 4 */
};

static bool bank_is_valid(const pvid_fir_bank_f32 *bank)
{
    if ((bank->weights == NULL) || (bank->half < 2u) || (bank->stride < 1u) ||
        ((2uL * bank->half * bank->stride) + 1uL > PVID_MAX_WINDOW)) {
        return false;
    }
    for (uint32_t i = 0; i < (uint32_t)PVID_ORDERS * bank->half; i++) {
        if (!pvid_finite_f32(bank->weights[i])) {
            return false;
        }
    }
    return true;
}

pvid_status pvid_differentiator_init_f32(pvid_differentiator_f32 *self, const pvid_fir_bank_f32 *bank,
                                         float sample_rate_hz)
{
    PVID_ASSERT((self != NULL) && (bank != NULL));
    if (!bank_is_valid(bank)) {
        return PVID_BAD_BANK;
    }
    if (!pvid_within_f32(sample_rate_hz, 1.0e-3f, 1.0e6f)) {
        return PVID_BAD_SAMPLE_RATE;
    }
    self->bank = *bank;
    self->length = (uint16_t)((2u * bank->half * bank->stride) + 1u);
    const float rate = sample_rate_hz / (float)bank->stride;
    self->rate_power[0] = 1.0f;
    for (size_t k = 1; k < PVID_ORDERS; k++) {
        self->rate_power[k] = self->rate_power[k - 1] * rate;
    }
    pvid_differentiator_reset_f32(self);
    return PVID_OK;
}

void pvid_differentiator_reset_f32(pvid_differentiator_f32 *self)
{
    self->head = 0;
    self->filled = 0;
    for (size_t i = 0; i < self->length; i++) {
        self->history[i] = 0.0f;
    }
}

bool pvid_differentiator_step_f32(pvid_differentiator_f32 *self, float sample, float out[PVID_ORDERS])
{
    const uint16_t length = self->length;
    const uint16_t half = self->bank.half;
    const uint16_t stride = self->bank.stride;
    self->history[self->head] = sample;
    self->head = (uint16_t)((self->head + 1u == length) ? 0u : (self->head + 1u));
    if (self->filled < length) {
        self->filled++;
        if (self->filled < length) {
            return false;
        }
    }
    /* head is now the oldest sample; the centre stands half * stride after it */
    uint16_t centre = (uint16_t)(self->head + (half * stride));
    centre = (uint16_t)((centre >= length) ? (centre - length) : centre);
    uint16_t newer = centre;
    uint16_t older = centre;
    const float middle = self->history[centre];
    const float *weight = self->bank.weights;
    float sum0 = 0.0f;
    float sum1 = 0.0f;
    float sum2 = 0.0f;
    float sum3 = 0.0f;
    float sum4 = 0.0f;
    for (size_t i = 0; i < half; i++) {
        newer = (uint16_t)(newer + stride);
        newer = (uint16_t)((newer >= length) ? (newer - length) : newer);
        older = (uint16_t)((older < stride) ? (older + length - stride) : (older - stride));
        const float after = self->history[newer];
        const float before = self->history[older];
        const float even = (after - middle) + (before - middle);
        const float odd = after - before;
        sum0 += weight[0] * even;
        sum1 += weight[half] * odd;
        sum2 += weight[2 * half] * even;
        sum3 += weight[3 * half] * odd;
        sum4 += weight[4 * half] * even;
        weight++;
    }
    out[0] = middle + sum0;
    out[1] = sum1 * self->rate_power[1];
    out[2] = sum2 * self->rate_power[2];
    out[3] = sum3 * self->rate_power[3];
    out[4] = sum4 * self->rate_power[4];
    return true;
}
