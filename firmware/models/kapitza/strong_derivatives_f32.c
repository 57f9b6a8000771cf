#include "number/uncontracted.h"

#include "strong_derivatives_f32.h"

#include "number/finite_f32.h"
#include "number/unroll.h"

/* Whether the bank has the weights of pvid_five_points_f32, wherever they are stored. */
static bool is_five_points(const pvid_fir_bank_f32 *bank)
{
    bool equal = (bank->half == 2u) && (bank->block == 1u);
    for (size_t i = 0; equal && (i < (size_t)PVID_ORDERS * 2u); i++) {
        equal = pvid_bits_f32(bank->weights[i]) == pvid_bits_f32(pvid_five_points_f32[i]);
    }
    return equal;
}

PVID_COLD pvid_status pvid_strong_window_init_f32(pvid_strong_window_f32 *self, const pvid_strong_config_f32 *config)
{
    const pvid_status status = pvid_fir_bank_is_valid_f32(&config->bank, config->sample_rate_hz);
    if (status != PVID_OK) {
        return status;
    }
    pvid_fir_take_bank_f32(&self->bank, &config->bank);
    self->length = (uint16_t)((2u * self->bank.half * self->bank.stride) + 1u);
    self->five_points = is_five_points(&self->bank);
    const float rate = config->sample_rate_hz / (float)self->bank.stride;
    const float inverse_l1 = 1.0f / config->l1;
    const float rate2 = rate * rate;
    self->phi_scale[0] = 1.0f / (float)self->bank.block;
    self->phi_scale[1] = self->five_points ? (rate2 / 12.0f) : (rate2 * self->phi_scale[0]);
    self->phi_scale[2] = (rate2 * rate) * (self->five_points ? 0.5f : self->phi_scale[0]);
    self->phi_scale[3] = (rate2 * rate2) * self->phi_scale[0];
    for (size_t i = 0; i < 3u; i++) {
        self->u_scale[i] = self->phi_scale[i + 1u] * inverse_l1;
    }
    pvid_strong_window_reset_f32(self);
    return PVID_OK;
}

PVID_COLD void pvid_strong_window_reset_f32(pvid_strong_window_f32 *self)
{
    const size_t places = (size_t)pvid_fir_places_f32(&self->bank);
    self->head = 0;
    self->at = 0;
    self->missing = (uint16_t)(self->length + self->bank.block - 1u);
    for (size_t i = 0; i < places; i++) {
        self->samples[i][0] = 0.0f;
        self->samples[i][1] = 0.0f;
    }
}

void pvid_strong_window_blocks_f32(pvid_strong_window_f32 *self, size_t head)
{
    const size_t block = self->bank.block;
    float *tail = self->samples[self->length];
    for (size_t i = 0; i < 2u; i++) {
        self->samples[head][i] = pvid_block_sum_f32(&tail[i], 2, block, self->at, self->samples[head][i]);
    }
    self->at = pvid_block_next_f32(block, self->at);
}

/* Not inlined: one copy for both channels. */
PVID_SELDOM pvid_strong_filters_f32 pvid_strong_window_filter_f32(const pvid_strong_window_f32 *self, size_t channel)
{
    const size_t half = self->bank.half;
    const float *weight = self->bank.weights;
    pvid_fir_walk at = pvid_fir_centre_f32(self->bank.stride, self->length, self->head);
    const float middle = self->samples[at.newer][channel];
    pvid_fir_outwards(&at);
    pvid_strong_filters_f32 sums =
        pvid_strong_begin_f32(weight, half, middle, self->samples[at.newer][channel], self->samples[at.older][channel]);
    for (size_t i = 1; i < half; i++) {
        pvid_fir_outwards(&at);
        pvid_strong_add_f32(&sums, &weight[i], half, self->samples[at.newer][channel],
                            self->samples[at.older][channel]);
    }
    return sums;
}
