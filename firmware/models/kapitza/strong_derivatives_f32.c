#include "number/uncontracted.h"

#include "strong_derivatives_f32.h"

#include "number/finite_f32.h"
#include "number/unroll.h"

/* Whether the bank has the weights of pvid_five_points_f32, wherever they are stored. */
static bool is_five_points(const pvid_fir_bank_f32 *bank)
{
    bool equal = (bank->half == 2u) && (bank->block <= 1u);
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
    const pvid_fir_bank_f32 *bank = &config->bank;
    self->stride = bank->stride;
    self->length = pvid_fir_length_f32(bank);
    self->five_points = is_five_points(bank) ? 1u : 0u;
    const uint32_t block = pvid_fir_block_f32(bank);
    const float rate = config->sample_rate_hz / (float)(block * bank->stride);
    const float inverse_l1 = 1.0f / config->l1;
    const float rate2 = rate * rate;
    self->phi_scale[0] = 1.0f / (float)block;
    self->phi_scale[1] = (self->five_points != 0u) ? (rate2 / 12.0f) : (rate2 * self->phi_scale[0]);
    self->phi_scale[2] = (rate2 * rate) * ((self->five_points != 0u) ? 0.5f : self->phi_scale[0]);
    self->phi_scale[3] = (rate2 * rate2) * self->phi_scale[0];
    for (size_t i = 0; i < 3u; i++) {
        self->u_scale[i] = self->phi_scale[i + 1u] * inverse_l1;
    }
    pvid_strong_window_reset_f32(self);
    return PVID_OK;
}

PVID_COLD void pvid_strong_window_reset_f32(pvid_strong_window_f32 *self)
{
    self->head = 0;
    self->at = 0;
    self->missing = self->length;
    self->five_points = (self->five_points != 0u) ? 1u : 0u;
    for (size_t i = 0; i < self->length; i++) {
        self->samples[i][0] = 0.0f;
        self->samples[i][1] = 0.0f;
    }
}

PVID_NOINLINE bool pvid_strong_window_takes_f32(pvid_strong_window_f32 *self, const pvid_fir_bank_f32 *bank, float phi,
                                                float y)
{
    const size_t head = self->head;
    const uint32_t samples = (uint32_t)self->at + 1u;
    float *point = self->samples[head];
    point[0] = (samples == 1u) ? phi : (point[0] + phi);
    point[1] = (samples == 1u) ? y : (point[1] + y);
    if (samples < bank->block) {
        self->at = (uint16_t)samples;
        return false;
    }
    self->at = 0;
    self->head = (uint16_t)pvid_strong_after_f32(self, head, 1);
    if (self->missing > 0u) {
        self->missing--;
    }
    if ((self->missing == 0u) && (self->five_points != 0u)) {
        self->five_points = PVID_FIVE_POINTS_READY;
    }
    return self->missing == 0u;
}

/* Adds the products of the next samples on either side with their weights. */
static inline void add_pair(pvid_strong_filters_f32 *sums, float after, float before, const float weights[PVID_ORDERS])
{
    const float even = (after - sums->middle) + (before - sums->middle);
    sums->order0 += weights[0] * even;
    sums->order2 += weights[2] * even;
    sums->order3 += weights[3] * (after - before);
    sums->order4 += weights[4] * even;
}

PVID_NOINLINE void pvid_strong_window_filter_f32(const pvid_strong_window_f32 *self, const pvid_fir_bank_f32 *bank,
                                                 pvid_strong_filters_f32 sums[2])
{
    const size_t half = bank->half;
    const float *weight = bank->weights;
    pvid_fir_walk at = pvid_fir_centre_f32(self->stride, self->length, self->head);
    const float *middle = self->samples[at.newer];
    /* -0 + x is x for every x */
    pvid_strong_filters_f32 phi = {middle[0], -0.0f, -0.0f, -0.0f, -0.0f};
    pvid_strong_filters_f32 y = {middle[1], -0.0f, -0.0f, -0.0f, -0.0f};
    for (size_t i = 0; i < half; i++) {
        pvid_fir_outwards(&at);
        const float *after = self->samples[at.newer];
        const float *before = self->samples[at.older];
        const float weights[PVID_ORDERS] = {weight[i], 0.0f, weight[(2u * half) + i], weight[(3u * half) + i],
                                            weight[(4u * half) + i]};
        add_pair(&phi, after[0], before[0], weights);
        add_pair(&y, after[1], before[1], weights);
    }
    sums[0] = phi;
    sums[1] = y;
}
