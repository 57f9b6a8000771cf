#include "number/uncontracted.h"

#include "judge/gate_f32.h"

#include <stddef.h>

#include "number/fingerprint_numbers_f32.h"
#include "number/finite_f32.h"
#include "number/unroll.h"
#include "pvid/fnv_word.h"

#define GROWTH 9.21034f /* ln 1e4: consecutive outliers multiply the scale by 1e4 within patience_s */
#define WIDEST 1.0e3f   /* largest relative growth of the scale by one outlier */

PVID_COLD pvid_status pvid_gate_init_f32(pvid_gate_f32 *self, const pvid_gate_config_f32 *config, float rate_hz,
                                         float memory, float floor)
{
    PVID_ASSERT((self != NULL) && (config != NULL));
    if ((self == NULL) || (config == NULL)) {
        return PVID_BAD_POINTER;
    }
    if (!pvid_within_f32(config->sigmas, 2.0f, 1.0e3f) && !pvid_within_f32(config->sigmas, 0.0f, 0.0f)) {
        return PVID_BAD_GATE_SIGMAS;
    }
    if (!pvid_within_f32(config->patience_s, 0.0f, 1.0e12f)) {
        return PVID_BAD_GATE_PATIENCE;
    }
    const float residuals = config->patience_s * rate_hz;
    float growth = 0.0f;
    if (config->patience_s > 0.0f) {
        growth = (residuals > (GROWTH / WIDEST)) ? (GROWTH / residuals) : WIDEST;
    }
    self->limit = config->sigmas * config->sigmas;
    self->memory = (memory >= 1.0f) ? memory : 1.0f;
    self->floor = floor;
    self->widening = 1.0f + growth;
    self->judged = 0.0f;
    self->scale = floor;
    self->usual = floor;
    return PVID_OK;
}

PVID_COLD bool pvid_gate_passes_f32(pvid_gate_f32 *self, float square)
{
    if (!(self->limit > 0.0f) || !pvid_finite_f32(square)) {
        return true;
    }
    if (self->judged < self->memory) {
        self->judged += 1.0f;
    } else if (square > (self->limit * self->scale)) {
        const float wider = self->scale * self->widening;
        self->scale = (wider < PVID_GATE_SCALE_MAX) ? wider : PVID_GATE_SCALE_MAX;
        return false;
    } else {
        /* the memory is complete */
    }
    return pvid_gate_accept_f32(self, square);
}

PVID_COLD pvid_gate_verdict pvid_gate_judge_f32(pvid_gate_f32 *self, float square)
{
    const bool widened = self->scale > self->usual;
    if (!pvid_gate_passes_f32(self, square)) {
        return PVID_GATE_REJECTS;
    }
    if (!pvid_finite_f32(square)) {
        return PVID_GATE_ACCEPTS;
    }
    const bool opens = widened && (square > (self->limit * self->usual));
    self->usual = self->scale;
    return opens ? PVID_GATE_OPENS : PVID_GATE_ACCEPTS;
}

uint32_t pvid_fingerprint_gate_f32(uint32_t hash, const pvid_gate_config_f32 *config)
{
    return pvid_fingerprint_float(pvid_fingerprint_float(hash, config->sigmas), config->patience_s);
}
