#include "number/uncontracted.h"

/* Signals of a tick:  SAMPLED  x_k,   HELD  (-x_(k-2) + 13 x_(k-1) + 13 x_k - x_(k+1)) / 24,   JUMP  dt/12 (x_k -
 * x_(k-1)). With a held signal k is the tick before the present one. Before the first sample since a restart all were
 * equal to it.
 *
 * A block of D ticks gives one output of each signal, the mean with weights 1, 2, .., D, .., 2, 1 about the block's
 * first tick: with  a += x,  b += a  from 0 in every block, (b + D a' - b') / D^2, a' and b' those of the block before.
 * No sum lasts longer than a block, so that rounding does not add up.
 *
 * A jet is x + sum_i w_i ((x_(+i) - x) + (x_(-i) - x)) of even order (without the leading x above 0) or sum_i w_i
 * (x_(+i) - x_(-i)) of odd order, i = 1..half, added outwards from the instant of the step; x are outputs. They stand
 * twice in the line, one length apart: so the last ones are always contiguous. */
#include "weak/weak_front_f32.h"

#include <string.h>

#include "number/exact.h"
#include "weak/weak_signals.h"

#define HELD_SCALE (1.0f / 24.0f)

uint16_t pvid_weak_front_half_f32(const pvid_weak_design_f32 *design)
{
    uint16_t half = 0;
    for (size_t i = 0; i < design->model->jets; i++) {
        half = (design->compensator[i].half > half) ? design->compensator[i].half : half;
    }
    return half;
}

PVID_COLD uint32_t pvid_weak_front_length_f32(const pvid_weak_design_f32 *design)
{
    const uint32_t steps = (2u * (uint32_t)pvid_weak_front_half_f32(design)) + 1u;
    return (uint32_t)design->model->signals * (3u + (2u * steps));
}

PVID_COLD void pvid_weak_front_init_f32(pvid_weak_front_f32 *self, const pvid_weak_design_f32 *design,
                                        float sample_rate_hz)
{
    const pvid_weak_model_f32 *model = design->model;
    const float ticks = (float)design->decimation;
    self->needs = pvid_weak_needs(model->signal, model->signals);
    self->signals = model->signals;
    self->plain = pvid_weak_signals_are_samples(model->signal, model->signals, model->samples);
    self->decimation = design->decimation;
    self->half = pvid_weak_front_half_f32(design);
    self->ticks = ticks;
    self->scale = 1.0f / (ticks * ticks);
    self->jump_scale = 1.0f / (12.0f * sample_rate_hz);
    pvid_weak_front_reset_f32(self);
}

/* Outputs before those of the first step: the first block has none before it; and signals of several samples are right
 * from the second tick on. */
static uint16_t lost(const pvid_weak_front_f32 *self)
{
    if (pvid_weak_decimation(self->decimation) > 1u) {
        return 1;
    }
    return (uint16_t)(((self->needs != PVID_WEAK_NEEDS_NOTHING) && (self->half < 2u)) ? (2u - self->half) : 0u);
}

uint16_t pvid_weak_front_lead_f32(const pvid_weak_front_f32 *self)
{
    return (uint16_t)((uint32_t)self->decimation * ((uint32_t)lost(self) + self->half));
}

PVID_COLD bool pvid_weak_front_early_f32(const pvid_weak_front_f32 *self, const pvid_weak_design_f32 *design,
                                         float jet[], bool *first)
{
    const uint32_t length = (2u * (uint32_t)self->half) + 1u;
    const uint32_t number = ((uint32_t)lost(self) + length) - ((uint32_t)self->missing + 1u);
    const uint32_t newest = ((self->head == 0u) ? length : self->head) - 1u;
    const size_t row = (size_t)newest + 3u;
    const float *output = &self->line[row * self->signals];
    *first = number == 0u;
    /* The first block's output lacks what was before it: its weights D .. 1 are to have the sum 1. */
    const float scale = (number == 0u) ? ((2.0f * self->ticks) / (self->ticks + 1.0f)) : 1.0f;
    for (size_t i = 0; i < design->model->jets; i++) {
        const pvid_weak_jet one = design->model->jet[i];
        jet[i] = (one.order == 0u) ? (scale * output[one.signal]) : 0.0f;
    }
    return number < ((uint32_t)lost(self) + self->half);
}

void pvid_weak_front_reset_f32(pvid_weak_front_f32 *self)
{
    self->head = 0;
    self->seen = false;
    self->missing = (uint16_t)(lost(self) + (2u * self->half) + 1u);
    self->wait = self->decimation;
    memset(self->line, 0, 3u * (size_t)self->signals * sizeof self->line[0]);
}

#if !PVID_EXACT_PLAIN

/* The samples before: all equal to the first one since a restart. */
static void begin(pvid_weak_front_f32 *self, size_t samples, const float sample[])
{
    for (size_t i = 0; i < samples; i++) {
        self->before[2][i] = sample[i];
        self->before[1][i] = sample[i];
        self->before[0][i] = sample[i];
    }
    self->seen = true;
}

static void remember(pvid_weak_front_f32 *self, size_t count, const float sample[])
{
    const size_t samples = PVID_COUNT(PVID_MAX_SAMPLES, count);
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < samples; i++) {
        self->before[2][i] = self->before[1][i];
        self->before[1][i] = self->before[0][i];
        self->before[0][i] = sample[i];
    }
}

/* A held signal of the tick `now`, between the samples `next` and `last` with one more before it. */
static inline float held_signal(float before, float last, float now, float next)
{
    return (((-before + (13.0f * last)) + (13.0f * now)) - next) * HELD_SCALE;
}

/* A signal that is not the sample itself. */
static inline float other_signal(uint8_t source, float before, float last, float now, float next, float jump_scale)
{
    if (source == (uint8_t)PVID_SIGNAL_HELD) {
        return held_signal(before, last, now, next);
    }
    return (source == (uint8_t)PVID_SIGNAL_JUMP) ? (jump_scale * (now - last)) : last;
}

PVID_NOINLINE void pvid_weak_front_derive_f32(pvid_weak_front_f32 *self, const pvid_weak_model_f32 *model,
                                              const float sample[])
{
    const size_t signals = PVID_COUNT(PVID_EXACT_SIGNALS, model->signals);
    const bool next = self->needs == PVID_WEAK_NEEDS_NEXT; /* then the signals are those of the tick before */
    if (!self->seen) {
        begin(self, model->samples, sample);
        if (next) {
            self->wait++; /* the next sample is missing */
            return;
        }
    }
    const float *now = next ? self->before[0] : sample;
    const float *last = next ? self->before[1] : self->before[0];
    const pvid_weak_signal *signal = model->signal;
    float *sums = self->line;
    for (size_t left = signals; left > 0u; left--) {
        const size_t i = signal->sample;
        float x = now[i];
        if (signal->source != (uint8_t)PVID_SIGNAL_SAMPLED) {
            x = other_signal(signal->source, self->before[2][i], last[i], x, sample[i], self->jump_scale);
        }
        const float once = sums[0] + x;
        sums[0] = once;
        sums[1] += once;
        sums = &sums[2];
        signal++;
    }
    if (self->needs != PVID_WEAK_NEEDS_NOTHING) {
        remember(self, model->samples, sample);
    }
}

#endif

/* A jet at a step; x: the signal there, its neighbours `stride` numbers apart. */
static inline float jet_of(const pvid_weak_filter_f32 *filter, uint8_t order, const float *x, size_t stride)
{
    const float *weight = filter->weights; /* NULL if there is none */
    const float *after = x;
    const float *before = x;
    const float centre = *x;
    float sum = 0.0f;
    if ((order % 2u) != 0u) {
        for (size_t left = filter->half; left > 0u; left--) {
            after += stride;
            before -= stride;
            sum += *weight * (*after - *before);
            weight++;
        }
        return sum;
    }
    for (size_t left = filter->half; left > 0u; left--) {
        after += stride;
        before -= stride;
        sum += *weight * ((*after - centre) + (*before - centre));
        weight++;
    }
    return (order == 0u) ? (centre + sum) : sum;
}

bool pvid_weak_front_step_f32(pvid_weak_front_f32 *self, const pvid_weak_design_f32 *design, float jet[])
{
    const pvid_weak_model_f32 *model = design->model;
    const size_t signals = PVID_COUNT(PVID_EXACT_SIGNALS, self->signals);
    const size_t jets = PVID_COUNT(PVID_EXACT_JETS, model->jets);
    const size_t length = (2u * (size_t)self->half) + 1u;
    float *sums = self->line;
    float *carry = &sums[2u * signals];
    float *outputs = &carry[signals];
    float *place = &outputs[self->head * signals];
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < signals; i++) {
        const float once = sums[2u * i];
        const float twice = sums[(2u * i) + 1u];
        const float output = self->scale * (twice + carry[i]);
        carry[i] = (self->ticks * once) - twice;
        sums[2u * i] = 0.0f;
        sums[(2u * i) + 1u] = 0.0f;
        place[i] = output;
        place[(length * signals) + i] = output;
    }
    self->wait = self->decimation;
    self->head = (uint16_t)((self->head + 1u == length) ? 0u : (self->head + 1u));
    if (self->missing > 1u) {
        self->missing--;
        return false;
    }
    const float *centre = &outputs[((size_t)self->head + self->half) * signals];
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < jets; i++) {
        jet[i] = jet_of(&design->compensator[i], model->jet[i].order, &centre[model->jet[i].signal], signals);
    }
    return true;
}
