/* Signals of a tick, exact:  SAMPLED  x_k,   HELD  -x_(k-2) + 13 x_(k-1) + 13 x_k - x_(k+1),   JUMP  x_k - x_(k-1).
 * With a held signal k is the tick before the present one. Before the first sample since a restart all were equal to
 * it.
 *
 * A jet is the rescaled sum  x 2^bits + sum_i w_i ((x_(+i) - x) + (x_(-i) - x)) of even order (without the leading x
 * above order 0) or  sum_i w_i (x_(+i) - x_(-i)) of odd order, i = 1..half. */
#include "fourier/fourier_front_q31.h"

#include <stddef.h>

#include "fourier/rescale_q31.h"

/* Pairs a tick, at least: fewer cost less than what a tick does for them beside. */
#define LEAST_PAIRS 16u

static size_t lesser(size_t a, size_t b)
{
    return (a < b) ? a : b;
}

uint16_t pvid_fourier_front_half_q31(const pvid_fourier_design_q31 *design)
{
    uint16_t half = 0;
    for (size_t i = 0; i < design->model->jets; i++) {
        half = (design->filter[i].half > half) ? design->filter[i].half : half;
    }
    return half;
}

static size_t pairs_of(const pvid_fourier_design_q31 *design)
{
    size_t pairs = 0;
    for (size_t i = 0; i < design->model->jets; i++) {
        pairs += design->filter[i].half;
    }
    return pairs;
}

static size_t pairs_per_tick(const pvid_fourier_design_q31 *design)
{
    const size_t ticks = (design->decimation > 1u) ? ((size_t)design->decimation / 2u) : 1u;
    const size_t each = (pairs_of(design) + (ticks - 1u)) / ticks;
    return (each > LEAST_PAIRS) ? each : LEAST_PAIRS;
}

uint32_t pvid_fourier_front_job_q31(const pvid_fourier_design_q31 *design)
{
    const size_t each = pairs_per_tick(design);
    const size_t ticks = (pairs_of(design) + (each - 1u)) / each;
    return (uint32_t)((ticks > 0u) ? ticks : 1u);
}

void pvid_fourier_front_init_q31(pvid_fourier_front_q31 *self, const pvid_fourier_design_q31 *design)
{
    const pvid_fourier_model_q31 *model = design->model;
    self->plain = true;
    self->held = false;
    for (size_t i = 0; i < model->signals; i++) {
        self->plain = self->plain && (model->signal[i].source == (uint8_t)PVID_SIGNAL_SAMPLED);
        self->held = self->held || (model->signal[i].source == (uint8_t)PVID_SIGNAL_HELD);
    }
    self->half = pvid_fourier_front_half_q31(design);
    self->length = (uint16_t)((2u * self->half) + design->decimation);
    self->pairs_per_tick = (uint16_t)pairs_per_tick(design);
    pvid_fourier_front_reset_q31(self, design);
}

void pvid_fourier_front_reset_q31(pvid_fourier_front_q31 *self, const pvid_fourier_design_q31 *design)
{
    self->head = 0;
    self->seen = false;
    self->jet = design->model->jets;
    self->wait = (uint16_t)(self->half + pvid_fourier_front_lead_q31(design) + 1u);
}

/* The samples before: all equal to the first one since a restart. */
static void remember(pvid_fourier_front_q31 *self, size_t samples, const int32_t counts[])
{
    for (size_t i = 0; i < samples; i++) {
        self->before[2][i] = self->seen ? self->before[1][i] : counts[i];
        self->before[1][i] = self->seen ? self->before[0][i] : counts[i];
        self->before[0][i] = counts[i];
    }
    self->seen = true;
}

/* Of this tick, or of the one before if a signal is held. */
static int32_t signal_of(const pvid_fourier_front_q31 *self, pvid_fourier_signal signal, const int32_t counts[])
{
    const size_t i = signal.sample;
    const int32_t now = self->held ? self->before[0][i] : counts[i];
    const int32_t last = self->held ? self->before[1][i] : self->before[0][i];
    if (signal.source == (uint8_t)PVID_SIGNAL_HELD) {
        return (13 * (last + now)) - (self->before[2][i] + counts[i]);
    }
    return (signal.source == (uint8_t)PVID_SIGNAL_JUMP) ? (now - last) : now;
}

/* Writes the signals of a tick to the ring. Returns false if there are none: the next sample is missing. */
static bool store(pvid_fourier_front_q31 *self, const pvid_fourier_model_q31 *model, const int32_t counts[])
{
    const pvid_fourier_signal *signal = model->signal;
    const size_t signals = model->signals;
    int32_t *place = &self->ring[self->head * signals];
    if (self->plain) {
        for (size_t i = 0; i < signals; i++) {
            place[i] = counts[signal[i].sample];
        }
    } else {
        const bool any = self->seen || !self->held;
        if (!self->seen) {
            remember(self, model->samples, counts);
        }
        if (!any) {
            return false;
        }
        for (size_t i = 0; i < signals; i++) {
            place[i] = signal_of(self, signal[i], counts);
        }
        remember(self, model->samples, counts);
    }
    self->head = (uint16_t)((self->head + 1u == self->length) ? 0u : (self->head + 1u));
    return true;
}

/* Completes the present jet and every one behind it that needs no pairs. */
static void complete(pvid_fourier_front_q31 *self, const pvid_fourier_design_q31 *design)
{
    const pvid_fourier_model_q31 *model = design->model;
    const int32_t *instant = &self->ring[(size_t)self->centre * model->signals];
    const uint8_t jets = model->jets;
    uint8_t place = self->jet;
    for (; (place < jets) && (self->pair == design->filter[place].half); place++) {
        const pvid_fourier_filter_q31 *filter = &design->filter[place];
        const pvid_fourier_jet jet = model->jet[place];
        const int64_t x = (jet.order == 0u) ? instant[jet.signal] : 0;
        const int64_t sum = self->sum + (x * ((int64_t)1 << filter->bits));
        self->value[place] = pvid_fourier_rescaled_q31(sum, &filter->rescale);
        self->pair = 0;
        self->sum = 0;
    }
    self->jet = place;
}

static void begin(pvid_fourier_front_q31 *self, const pvid_fourier_design_q31 *design)
{
    /* the newest signals are before head, the instant `half` before those */
    const uint16_t back = (uint16_t)(self->half + 1u);
    self->centre = (uint16_t)((self->head >= back) ? (self->head - back) : ((self->head + self->length) - back));
    self->wait = design->decimation;
    self->jet = 0;
    self->pair = 0;
    self->sum = 0;
    complete(self, design);
}

/* A weight times a pair of signals. On a core without a long multiplication a product that fits 32 bits is shorter. */
static inline int64_t product(bool is_wide, int32_t weight, int32_t pair)
{
#if defined(__ARM_ARCH_6M__)
    return is_wide ? pvid_product_q31(weight, pair) : (int64_t)(weight * pair);
#else
    (void)is_wide;
    return (int64_t)weight * pair;
#endif
}

/* Up to `left` pairs of the present jet that are contiguous in the ring. Returns their number. */
static size_t add_pairs(pvid_fourier_front_q31 *self, const pvid_fourier_design_q31 *design, size_t left)
{
    const pvid_fourier_filter_q31 *filter = &design->filter[self->jet];
    const pvid_fourier_jet jet = design->model->jet[self->jet];
    const size_t stride = design->model->signals;
    const size_t length = self->length;
    const size_t outwards = (size_t)self->pair + 1u;
    const size_t ahead = self->centre + outwards;
    const size_t newer = (ahead >= length) ? (ahead - length) : ahead;
    const size_t older = (self->centre >= outwards) ? (self->centre - outwards) : ((self->centre + length) - outwards);
    const size_t room = lesser(length - newer, older + 1u);
    const size_t pairs = lesser(lesser(left, (size_t)filter->half - self->pair), room);
    const PVID_TABLE int32_t *weight = &filter->weights[self->pair];
    const int32_t *after = &self->ring[(newer * stride) + jet.signal];
    const int32_t *before = &self->ring[(older * stride) + jet.signal];
    int64_t sum = self->sum;
    if ((jet.order % 2u) != 0u) {
        for (size_t i = 0; i < pairs; i++) {
            sum += product(filter->is_wide, weight[i], after[i * stride] - *before);
            before -= stride;
        }
    } else {
        const int32_t twice = 2 * self->ring[(self->centre * stride) + jet.signal];
        for (size_t i = 0; i < pairs; i++) {
            sum += product(filter->is_wide, weight[i], (after[i * stride] + *before) - twice);
            before -= stride;
        }
    }
    self->sum = sum;
    self->pair = (uint16_t)(self->pair + pairs);
    complete(self, design);
    return pairs;
}

bool pvid_fourier_front_step_q31(pvid_fourier_front_q31 *self, const pvid_fourier_design_q31 *design,
                                 const int32_t counts[])
{
    const size_t jets = design->model->jets;
    if (!store(self, design->model, counts)) {
        return false;
    }
    self->wait--;
    if (self->wait == 0u) {
        begin(self, design);
    } else if (self->jet == jets) {
        return false;
    } else {
        /* the job goes on */
    }
    size_t left = self->pairs_per_tick;
    for (size_t runs = left; (runs > 0u) && (left > 0u) && (self->jet < jets); runs--) { /* each has a pair at least */
        left -= add_pairs(self, design, left);
    }
    return self->jet == jets;
}
