#include "number/uncontracted.h"

#include "pvid/differentiator.h"

#include <stddef.h>

#include "strong/differentiator_f32.h"
#include "number/init.h"
#include "number/finite_f32.h"
#include "number/unroll.h"
#include "strong/fir_window.h"

const float pvid_five_points_f32[PVID_ORDERS * 2] = {
    0.0f,          0.0f,          /* order 0: the centre itself */
    8.0f / 12.0f,  -1.0f / 12.0f, /* order 1 */
    16.0f / 12.0f, -1.0f / 12.0f, /* order 2 */
    -1.0f,         0.5f,          /* order 3 */
    -4.0f,         1.0f,          /* order 4 */
};

PVID_COLD pvid_status pvid_fir_bank_is_valid_f32(const pvid_fir_bank_f32 *bank, float sample_rate_hz)
{
    const pvid_status window = pvid_fir_window(bank->half, bank->stride);
    if (window != PVID_OK) {
        return window;
    }
    if (bank->weights == NULL) {
        return PVID_BAD_BANK;
    }
    for (uint32_t i = 0; i < (uint32_t)PVID_ORDERS * bank->half; i++) {
        if (!pvid_finite_f32(bank->weights[i])) {
            return PVID_BAD_BANK;
        }
    }
    return pvid_within_f32(sample_rate_hz, 1.0e-3f, 1.0e6f) ? PVID_OK : PVID_BAD_SAMPLE_RATE;
}

static pvid_status prepare(pvid_differentiator_f32 *self, const pvid_fir_bank_f32 *bank, float sample_rate_hz)
{
    const pvid_status status = pvid_fir_bank_is_valid_f32(bank, sample_rate_hz);
    if (status != PVID_OK) {
        return status;
    }
    self->bank = *bank;
    self->bank.block = (uint16_t)pvid_fir_block_f32(bank);
    self->length = pvid_fir_length_f32(bank);
    const float rate = sample_rate_hz / (float)(pvid_fir_block_f32(bank) * bank->stride);
    float power = 1.0f / (float)self->bank.block;
    for (size_t i = 0; i < PVID_ORDERS; i++) {
        self->scale[i] = power;
        power *= rate;
    }
    pvid_differentiator_reset_f32(self);
    return PVID_OK;
}

PVID_COLD pvid_status pvid_differentiator_init_layout_f32(pvid_differentiator_f32 *self, const pvid_fir_bank_f32 *bank,
                                                          float sample_rate_hz, uint32_t layout)
{
    if (layout != PVID_LAYOUT) {
        return PVID_BAD_LAYOUT;
    }
    const pvid_status status = pvid_init_is_given(self, bank) ? prepare(self, bank, sample_rate_hz) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

PVID_COLD void pvid_differentiator_reset_f32(pvid_differentiator_f32 *self)
{
    self->head = 0;
    self->at = 0;
    self->missing = self->length;
    for (size_t i = 0; i < self->length; i++) {
        self->history[i] = 0.0f;
    }
}

bool pvid_differentiator_step_f32(pvid_differentiator_f32 *self, float sample, float out[PVID_ORDERS])
{
    const bool ready = self->bank.weights != NULL;
    PVID_ASSERT(ready);
    if (!ready || !pvid_fir_push_f32(self, sample)) {
        return false;
    }
    const size_t half = self->bank.half;
    const float *weight = self->bank.weights;
    pvid_fir_walk walk = pvid_fir_centre_f32(self->bank.stride, self->length, self->head);
    const float middle = self->history[walk.newer];
    pvid_fir_outwards(&walk);
    pvid_fir_sums_f32 sums =
        pvid_fir_begin_f32(weight, half, middle, self->history[walk.newer], self->history[walk.older]);
    for (size_t i = 1; i < half; i++) {
        pvid_fir_outwards(&walk);
        pvid_fir_add_f32(&sums, &weight[i], half, self->history[walk.newer], self->history[walk.older]);
    }
    pvid_fir_end_f32(self, &sums, out);
    return true;
}
