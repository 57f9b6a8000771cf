#include "number/uncontracted.h"

/* Signals of a tick:  SAMPLED  x_k,   HELD  (-x_(k-2) + 13 x_(k-1) + 13 x_k - x_(k+1)) / 24,   JUMP  dt/12 (x_k -
 * x_(k-1)). With a held signal k is the tick before the present one. Before the first sample since a restart all were
 * equal to it.
 *
 * A jet is x + sum_i w_i ((x_(+i) - x) + (x_(-i) - x)) of even order (without the leading x above 0) or sum_i w_i
 * (x_(+i) - x_(-i)) of odd order, i = 1..half, added outwards from the instant of the step. */
#include "fourier/fourier_front_f32.h"

#include <stddef.h>

#include "fourier/fourier_schedule.h"
#include "number/unroll.h"

#define HELD_SCALE (1.0f / 24.0f)

/* Samples that the signals need beside those of their tick: none, the last one, or the next one and two before. */
#define NOTHING 0u
#define LAST 1u
#define NEXT 2u

static size_t minimum(size_t a, size_t b)
{
    return (a < b) ? a : b;
}

uint16_t pvid_fourier_front_half_f32(const pvid_fourier_design_f32 *design)
{
    uint16_t half = 0;
    for (size_t i = 0; i < design->model->jets; i++) {
        half = (design->filter[i].half > half) ? design->filter[i].half : half;
    }
    return half;
}

uint32_t pvid_fourier_front_pairs_f32(const pvid_fourier_design_f32 *design)
{
    uint32_t pairs = 0;
    for (size_t i = 0; i < design->model->jets; i++) {
        pairs += design->filter[i].half;
    }
    return pairs;
}

void pvid_fourier_front_init_f32(pvid_fourier_front_f32 *self, const pvid_fourier_design_f32 *design,
                                 float sample_rate_hz)
{
    const pvid_fourier_model_f32 *model = design->model;
    const uint32_t pairs = pvid_fourier_front_pairs_f32(design);
    self->needs = NOTHING;
    for (size_t i = 0; i < model->signals; i++) {
        const uint8_t source = model->signal[i].source;
        if (source == (uint8_t)PVID_SIGNAL_HELD) {
            self->needs = NEXT;
        } else if ((source == (uint8_t)PVID_SIGNAL_JUMP) && (self->needs == NOTHING)) {
            self->needs = LAST;
        } else {
            /* the sample itself */
        }
    }
    const uint32_t ticks = pvid_fourier_job_ticks(design->decimation, pairs);
    self->half = pvid_fourier_front_half_f32(design);
    self->length = (uint16_t)((2u * self->half) + design->decimation);
    self->pairs_per_tick = (uint16_t)((pairs + (ticks - 1u)) / ticks);
    self->step_wait = (uint16_t)((uint32_t)design->decimation - pvid_fourier_step_place(design->decimation, ticks));
    self->work_wait = (uint16_t)((uint32_t)design->decimation - pvid_fourier_work_place(design->decimation, ticks));
    self->jump_scale = 1.0f / (12.0f * sample_rate_hz);
    pvid_fourier_front_reset_f32(self, design);
}

uint16_t pvid_fourier_front_lead_f32(const pvid_fourier_front_f32 *self)
{
    /* two ticks at least: signals of several samples are right there */
    return (self->half > 2u) ? self->half : 2u;
}

void pvid_fourier_front_reset_f32(pvid_fourier_front_f32 *self, const pvid_fourier_design_f32 *design)
{
    self->head = 0;
    self->seen = 0;
    self->begun = false;
    self->busy = false;
    self->jet = design->model->jets;
    self->wait = (uint16_t)(self->half + pvid_fourier_front_lead_f32(self) + 1u);
}

/* The samples before: all equal to the first one since a restart. */
static void remember(pvid_fourier_front_f32 *self, size_t samples, const float sample[])
{
    const bool first = self->seen == 0u;
    for (size_t i = 0; i < samples; i++) {
        self->before[2][i] = first ? sample[i] : self->before[1][i];
        self->before[1][i] = first ? sample[i] : self->before[0][i];
        self->before[0][i] = sample[i];
    }
    self->seen = 1;
}

/* A signal of the tick before, from the next sample and the three before it. */
static float held_signal(const pvid_fourier_front_f32 *self, const pvid_fourier_signal *signal, float next)
{
    const size_t i = signal->sample;
    const float x = self->before[0][i];
    if (signal->source == (uint8_t)PVID_SIGNAL_HELD) {
        return (((-self->before[2][i] + (13.0f * self->before[1][i])) + (13.0f * x)) - next) * HELD_SCALE;
    }
    return (signal->source == (uint8_t)PVID_SIGNAL_JUMP) ? (self->jump_scale * (x - self->before[1][i])) : x;
}

/* A signal of this tick. */
static float plain_signal(const pvid_fourier_front_f32 *self, const pvid_fourier_signal *signal, float x)
{
    return (signal->source == (uint8_t)PVID_SIGNAL_JUMP) ? (self->jump_scale * (x - self->before[0][signal->sample]))
                                                         : x;
}

/* Signals that need samples of other ticks. Returns false if there are none: the next sample is missing. */
PVID_SELDOM static bool place_derived(pvid_fourier_front_f32 *self, const pvid_fourier_model_f32 *model,
                                      const float sample[], float place[])
{
    const bool first = self->seen == 0u;
    if (first) {
        remember(self, model->samples, sample);
    }
    const bool any = !first || (self->needs < NEXT);
    for (size_t i = 0; any && (i < model->signals); i++) {
        const pvid_fourier_signal *signal = &model->signal[i];
        const float x = sample[signal->sample];
        place[i] = (self->needs == NEXT) ? held_signal(self, signal, x) : plain_signal(self, signal, x);
    }
    remember(self, model->samples, sample);
    return any;
}

/* Writes the signals of a tick to the ring. Returns false if there are none. */
static inline bool store(pvid_fourier_front_f32 *self, const pvid_fourier_model_f32 *model, const float sample[])
{
    float *place = &self->ring[(size_t)self->head * model->signals];
    if (self->needs != NOTHING) {
        if (!place_derived(self, model, sample, place)) {
            return false;
        }
    } else {
        for (size_t i = 0; i < model->signals; i++) {
            place[i] = sample[model->signal[i].sample];
        }
    }
    self->head = (uint16_t)((self->head + 1u == self->length) ? 0u : (self->head + 1u));
    return true;
}

/* Begins the next jet of the job: those with half 0 are complete at once. */
static void begin_jet(pvid_fourier_front_f32 *self, const pvid_fourier_design_f32 *design)
{
    const pvid_fourier_model_f32 *model = design->model;
    const float *instant = &self->ring[(size_t)self->centre * model->signals];
    while ((self->jet < model->jets) && (design->filter[self->jet].half == 0u)) {
        self->jet_value[self->jet] = instant[model->jet[self->jet].signal];
        self->jet++;
    }
    self->pair = 0;
    self->newer = self->centre;
    self->older = self->centre;
    self->sum = 0.0f;
}

PVID_SELDOM static void begin_job(pvid_fourier_front_f32 *self, const pvid_fourier_design_f32 *design)
{
    /* the newest signals are before head, the instant `half` before those */
    const uint16_t back = (uint16_t)(self->half + 1u);
    self->centre = (uint16_t)((self->head >= back) ? (self->head - back) : ((self->head + self->length) - back));
    self->wait = design->decimation;
    self->begun = true;
    self->busy = true;
    self->jet = 0;
    begin_jet(self, design);
}

/* Pairs of a filter of even order, outwards; x: the signal at the instant. */
static inline float add_even(const float *weight, const float *after, const float *before, size_t stride, size_t pairs,
                             float x, float sum)
{
    for (size_t i = 0; i < pairs; i++) {
        sum += weight[i] * ((*after - x) + (*before - x));
        after += stride;
        before -= stride;
    }
    return sum;
}

/* Of odd order. */
static inline float add_odd(const float *weight, const float *after, const float *before, size_t stride, size_t pairs,
                            float sum)
{
    for (size_t i = 0; i < pairs; i++) {
        sum += weight[i] * (*after - *before);
        after += stride;
        before -= stride;
    }
    return sum;
}

/* Up to `left` pairs of the present jet that are contiguous in the ring. Returns their number. */
static size_t add_pairs(pvid_fourier_front_f32 *self, const pvid_fourier_design_f32 *design, size_t left)
{
    const pvid_fourier_filter_f32 *filter = &design->filter[self->jet];
    const pvid_fourier_jet *jet = &design->model->jet[self->jet];
    const size_t stride = design->model->signals;
    const size_t newer = (self->newer + 1u == self->length) ? 0u : (self->newer + 1u);
    const size_t older = (self->older == 0u) ? (self->length - 1u) : (self->older - 1u);
    const size_t room = minimum(self->length - newer, older + 1u);
    const size_t pairs = minimum(minimum(left, (size_t)filter->half - self->pair), room);
    const float *weight = &filter->weights[self->pair];
    const float *after = &self->ring[(newer * stride) + jet->signal];
    const float *before = &self->ring[(older * stride) + jet->signal];
    const float x = self->ring[(self->centre * stride) + jet->signal];
    const float sum = ((jet->order % 2u) != 0u) ? add_odd(weight, after, before, stride, pairs, self->sum)
                                                : add_even(weight, after, before, stride, pairs, x, self->sum);
    self->pair = (uint16_t)(self->pair + pairs);
    if (self->pair == filter->half) {
        self->jet_value[self->jet] = (jet->order == 0u) ? (x + sum) : sum;
        self->jet++;
        begin_jet(self, design);
    } else {
        self->sum = sum;
        self->newer = (uint16_t)(newer + (pairs - 1u));
        self->older = (uint16_t)(older - (pairs - 1u));
    }
    return pairs;
}

/* A part of the job. */
PVID_SELDOM static void advance_job(pvid_fourier_front_f32 *self, const pvid_fourier_design_f32 *design)
{
    const size_t jets = design->model->jets;
    size_t left = self->pairs_per_tick;
    for (size_t runs = left; (runs > 0u) && (left > 0u) && (self->jet < jets); runs--) { /* each has a pair at least */
        left -= add_pairs(self, design, left);
    }
    self->busy = self->jet < jets;
}

bool pvid_fourier_front_step_f32(pvid_fourier_front_f32 *self, const pvid_fourier_design_f32 *design,
                                 const float sample[])
{
    if (!store(self, design->model, sample)) {
        return false;
    }
    const uint16_t wait = (uint16_t)(self->wait - 1u);
    self->wait = wait;
    if (wait == 0u) {
        begin_job(self, design);
    }
    if (self->busy) {
        advance_job(self, design);
    }
    return (self->wait == self->step_wait) && self->begun;
}
