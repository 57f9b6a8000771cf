#include "number/uncontracted.h"

/* Every tick compares each sample with its range (weak_front_f32.h). A sample beyond it counts for the present step
 * and for all later ones that contain it.
 *
 * At every step each sample x adds x - r and (x - r)^2 to s and q, r the half's first sample. Its variance in a half of
 * N steps is (q - s^2/N) / N. A sensor that stops moving, or begins to, inside a window would be taken for motion of
 * the mechanism: both halves must move. */
#include "weak/limits_f32.h"

#include "number/exact.h"

void pvid_weak_limits_init_f32(pvid_weak_limits_f32 *self, const pvid_weak_config_f32 *config, uint16_t delay)
{
    self->range = config->range;
    self->drive_min = config->drive_min;
    self->delay = delay;
    for (size_t i = 0; (config->drive_min != NULL) && (i < config->design->model->samples); i++) {
        self->moves |= (config->drive_min[i] > 0.0f) ? ((uint32_t)1u << i) : 0u;
    }
    pvid_weak_limits_reset_f32(self);
}

void pvid_weak_limits_reset_f32(pvid_weak_limits_f32 *self)
{
    self->beyond = 0;
    self->out[0] = false;
    self->out[1] = false;
}

void pvid_weak_limits_step_f32(pvid_weak_limits_f32 *self, size_t samples, const float sample[], size_t half,
                               bool first)
{
    self->out[half] = (!first && self->out[half]) || (self->beyond > 0u);
    self->beyond = (uint16_t)((self->beyond > 0u) ? (self->beyond - 1u) : 0u);
    const size_t count = PVID_COUNT(PVID_MAX_SAMPLES, samples);
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < count; i++) {
        if (((self->moves >> i) & 1u) != 0u) {
            pvid_weak_spread_f32 *spread = &self->spread[i];
            if (first) {
                spread->reference = sample[i];
                spread->sum = 0.0f;
                spread->square = 0.0f;
            }
            const float x = sample[i] - spread->reference;
            spread->sum += x;
            spread->square += x * x;
        }
    }
}

PVID_COLD void pvid_weak_limits_half_f32(pvid_weak_limits_f32 *self, size_t samples, size_t half, uint16_t hop)
{
    const float n = (float)hop;
    bool still = false;
    for (size_t i = 0; i < samples; i++) {
        const pvid_weak_spread_f32 *one = &self->spread[i];
        const float variance = (one->square - ((one->sum * one->sum) / n)) / n;
        still = still || ((((self->moves >> i) & 1u) != 0u) && (variance < (self->drive_min[i] * self->drive_min[i])));
    }
    self->still[half] = still;
}

bool pvid_weak_limits_beyond_f32(const pvid_weak_limits_f32 *self)
{
    return self->out[0] || self->out[1];
}

bool pvid_weak_limits_still_f32(const pvid_weak_limits_f32 *self)
{
    return self->still[0] || self->still[1] || self->doubt[0] || self->doubt[1];
}
