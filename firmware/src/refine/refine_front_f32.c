#include "number/uncontracted.h"

/* Means x of `ratio` samples, of an input that is held from tick to tick of its means about the ticks; x - droop (x_-1
 * - 2 x + x_+1): the mean's droop undone to second order (the weights undo the rest). Second derivatives: w_0 x + sum_i
 * w_i (x_-i + x_+i), i = 1..half. */
#include "refine/refine_front_f32.h"

#include <stddef.h>
#include <string.h>

#include "number/finite_f32.h"
#include "number/unroll.h"

#define INPUTS PVID_REFINE_INPUTS
#define SIGNALS PVID_REFINE_SIGNALS
#define LENGTH ((2 * PVID_REFINE_HALF) + 1) /* of a line */
#define FULL_SCALE 32767.0f
#define MASK ((uint32_t)PVID_REFINE_RING - 1u)

PVID_COLD void pvid_refine_front_init_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config)
{
    const float ratio = (float)config->ratio;
    self->share = 1.0f / ratio;
    self->behind = 0;
    for (size_t i = 0; i < SIGNALS; i++) {
        const pvid_refine_signal_f32 *signal = &config->signal[i];
        const float steps = 1.0f / (ratio * ratio); /* the droop of a held input's own steps stays */
        self->droop[i] = ((signal->source == (uint8_t)PVID_SIGNAL_HELD) ? (1.0f + steps) : (1.0f - steps)) / 24.0f;
        self->sample[i] = signal->sample;
        self->to_counts[i] = signal->scale * (FULL_SCALE / signal->range);
        self->from_counts[i] = signal->range / FULL_SCALE;
        self->behind = (signal->order == 2u) ? (uint8_t)PVID_REFINE_HALF : self->behind;
    }
    pvid_refine_front_reset_f32(self, config);
}

PVID_COLD void pvid_refine_front_reset_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config)
{
    self->wait = config->ratio;
    self->means = 0;
    self->referred = false;
    self->place = 0;
    self->next = 0;
    memset(self->sum, 0, sizeof self->sum);
    memset(self->rest, 0, sizeof self->rest);
}

uint32_t pvid_refine_front_first_f32(const pvid_refine_front_f32 *self)
{
    return self->behind;
}

uint32_t pvid_refine_front_room_f32(const pvid_refine_front_f32 *self)
{
    return (uint32_t)PVID_REFINE_RING - self->behind;
}

/* x and what rounding left of the entry before, rounded to the nearest count: the errors of neighbours cancel for slow
 * signals. INT16_MIN if it is not finite or beyond full scale. */
static int16_t counts(float *rest, float x)
{
    const float whole = x + *rest;
    if (!((whole > -FULL_SCALE) && (whole < FULL_SCALE))) {
        *rest = 0.0f;
        return INT16_MIN;
    }
    const int16_t rounded = (int16_t)(int32_t)((whole < 0.0f) ? (whole - 0.5f) : (whole + 0.5f));
    *rest = whole - (float)rounded;
    return rounded;
}

/* The second derivative in the middle of a line. */
static float second_derivative(const float line[], const float weights[])
{
    float sum = weights[0] * line[PVID_REFINE_HALF];
    PVID_UNROLL for (size_t i = 1; i <= PVID_REFINE_HALF; i++)
    {
        sum += weights[i] * (line[PVID_REFINE_HALF - i] + line[PVID_REFINE_HALF + i]);
    }
    return sum;
}

/* A mean with its droop undone, of the entry `next`. */
static void enter(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config, size_t signal, float x)
{
    if (config->signal[signal].order == 2u) {
        float *newest = &self->line[signal][self->place];
        newest[0] = x;
        newest[LENGTH] = x;
        if (self->next >= (uint32_t)(LENGTH - 1)) {
            const float d = second_derivative(&newest[1], config->second);
            self->ring[(self->next - PVID_REFINE_HALF) & MASK][signal] =
                counts(&self->rest[signal], d * self->to_counts[signal]);
        }
    } else {
        self->ring[self->next & MASK][signal] = counts(&self->rest[signal], x * self->to_counts[signal]);
    }
}

/* The sum of a held input's means about the ticks: half of each of the two samples that bound the block is another
 * block's. */
static void about_the_ticks(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config, const float sample[])
{
    for (size_t i = 0; i < INPUTS; i++) {
        if (config->signal[i].source == (uint8_t)PVID_SIGNAL_HELD) {
            const float last = sample[self->sample[i]] - self->reference[i];
            self->sum[i] += 0.5f * (self->held[i] - last);
            self->held[i] = last;
        }
    }
}

pvid_refine_entry pvid_refine_front_end_block_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config,
                                                  const float sample[])
{
    const bool known = self->means >= 2u;
    about_the_ticks(self, config, sample);
    for (size_t i = 0; i < INPUTS; i++) {
        if (!pvid_finite_f32(self->sum[i])) {
            return PVID_REFINE_BROKEN;
        }
    }
    for (size_t i = 0; i < SIGNALS; i++) {
        const float x = self->sum[i] * self->share;
        const float middle = self->mean[0][i];
        if (known) {
            enter(self, config, i, middle - (self->droop[i] * ((self->mean[1][i] - (2.0f * middle)) + x)));
        }
        self->mean[1][i] = middle;
        self->mean[0][i] = x;
        self->sum[i] = 0.0f;
    }
    self->wait = config->ratio;
    if (!known) {
        self->means++;
        return PVID_REFINE_NOTHING;
    }
    self->next++;
    self->place = (uint16_t)((self->place == (uint16_t)(LENGTH - 1)) ? 0u : (self->place + 1u));
    return PVID_REFINE_ENTERED;
}

PVID_COLD void pvid_refine_front_refer_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config,
                                           const float sample[])
{
    for (size_t i = 0; i < INPUTS; i++) {
        const float x = sample[config->signal[i].sample];
        self->reference[i] = (config->signal[i].order == 2u) ? x : 0.0f;
        self->held[i] = x - self->reference[i];
    }
    self->referred = true;
}
