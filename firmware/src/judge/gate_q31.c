#include "judge/gate_q31.h"

#include <stddef.h>

#include "number/fingerprint_numbers_q31.h"
#include "number/integer_q31.h"
#include "number/scaled_q31.h"
#include "number/unroll.h"
#include "pvid/fnv_word.h"

#define SIGMAS_MIN ((uint32_t)2 << 16)
#define SIGMAS_MAX ((uint32_t)1000 << 16)
#define PATIENCE_MAX ((uint32_t)1 << 30)
#define GROWTH 150902 /* ln 1e4 in Q14: consecutive outliers multiply the scale by 1e4 within the patience */
#define GROWTH_BITS 14

/* Largest scale, 2^100 [square of a residual]: far beyond any accepted row. */
static const pvid_scaled_q31 scale_max = {(int32_t)1 << 29, 71};

PVID_COLD pvid_status pvid_gate_init_q31(pvid_gate_q31 *self, const pvid_gate_config_q31 *config, uint32_t memory,
                                         pvid_scaled_q31 floor)
{
    PVID_ASSERT((self != NULL) && (config != NULL));
    if ((self == NULL) || (config == NULL)) {
        return PVID_BAD_POINTER;
    }
    if ((config->sigmas != 0u) && ((config->sigmas < SIGMAS_MIN) || (config->sigmas > SIGMAS_MAX))) {
        return PVID_BAD_GATE_SIGMAS;
    }
    if (config->patience_groups > PATIENCE_MAX) {
        return PVID_BAD_GATE_PATIENCE;
    }
    const pvid_scaled_q31 one = pvid_scaled_of_q31(1, 0);
    self->limit = pvid_scaled_of_q31((int64_t)config->sigmas * config->sigmas, -32);
    self->floor = floor;
    self->widening = one;
    if (config->patience_groups > 0u) {
        const pvid_scaled_q31 growth = pvid_scaled_of_q31(GROWTH, -GROWTH_BITS);
        const pvid_scaled_q31 patience = pvid_scaled_of_q31(config->patience_groups, 0);
        self->widening = pvid_scaled_plus_q31(one, pvid_scaled_over_q31(growth, patience));
    }
    self->scale = floor;
    self->usual = floor;
    self->part = one;
    self->memory = (memory >= 1u) ? memory : 1u;
    self->judged = 0;
    return PVID_OK;
}

/* scale within floor..scale_max. Where exponents are more than one apart they alone decide. */
static pvid_scaled_q31 clamped(pvid_scaled_q31 scale, pvid_scaled_q31 floor)
{
    if ((scale.e < (floor.e - 1)) || pvid_scaled_exceeds_q31(floor, scale)) {
        return floor;
    }
    return ((scale.e > (scale_max.e + 1)) || pvid_scaled_exceeds_q31(scale, scale_max)) ? scale_max : scale;
}

/* Returns whether a square is at most limit times scale. The mantissas' product is at least 2^58: in most cases the
 * exponents decide. */
static bool is_usual(const pvid_gate_q31 *self, pvid_scaled_q31 square)
{
    return ((square.e + 30) <= ((self->limit.e + self->scale.e) + 58)) ||
           !pvid_scaled_exceeds_q31(square, pvid_scaled_times_q31(self->limit, self->scale));
}

bool pvid_gate_passes_q31(pvid_gate_q31 *self, pvid_scaled_q31 square)
{
    if (self->limit.m == 0) {
        return true;
    }
    const bool warming_up = self->judged < self->memory;
    const bool passes = warming_up || is_usual(self, square);
    pvid_scaled_q31 scale = self->scale;
    if (passes) {
        if (warming_up) {
            self->judged++;
            self->part = pvid_scaled_over_q31(pvid_scaled_of_q31(1, 0), pvid_scaled_of_q31(self->judged, 0));
        }
        scale = pvid_scaled_plus_q31(scale, pvid_scaled_times_q31(pvid_scaled_minus_q31(square, scale), self->part));
    } else {
        scale = pvid_scaled_times_q31(scale, self->widening);
    }
    self->scale = clamped(scale, self->floor);
    return passes;
}

pvid_gate_verdict pvid_gate_judge_q31(pvid_gate_q31 *self, pvid_scaled_q31 square)
{
    const bool widened = pvid_scaled_exceeds_q31(self->scale, self->usual);
    if (!pvid_gate_passes_q31(self, square)) {
        return PVID_GATE_REJECTS;
    }
    const bool opens = widened && pvid_scaled_exceeds_q31(square, pvid_scaled_times_q31(self->limit, self->usual));
    self->usual = self->scale;
    return opens ? PVID_GATE_OPENS : PVID_GATE_ACCEPTS;
}

uint32_t pvid_fingerprint_gate_q31(uint32_t hash, const pvid_gate_config_q31 *config)
{
    return pvid_fnv_word(pvid_fnv_word(hash, config->sigmas), config->patience_groups);
}
