/* Signals of a tick, exact:  SAMPLED  x_k,   HELD  -x_(k-2) + 13 x_(k-1) + 13 x_k - x_(k+1),   JUMP  x_k - x_(k-1),
 * LAST  x_(k-1). With a held signal k is the tick before the present one. Before the first sample since a restart all
 * were equal to it.
 *
 * A block of D ticks gives one output of each signal, the sum with weights 1, 2, .., D, .., 2, 1 about the block's
 * first tick: with  a += x,  b += a  from 0 in every block, b + D a' - b', a' and b' those of the block before. It is
 * exact: D^2 |x| fits an int32. It is then shifted to 28 bits.
 *
 * A jet is the sum  w_0 x + sum_i w_i ((x_(+i) - x) + (x_(-i) - x)) of even order (without w_0 above order 0) or
 * sum_i w_i (x_(+i) - x_(-i)) of odd order, i = 1..half, shifted; x are outputs. They stand twice in the line, one
 * length apart: so the last ones are always contiguous. */
#include "weak/weak_front_q31.h"

#include <string.h>

#include "number/integer_q31.h"
#include "number/unroll.h"
#include "weak/weak_signals.h"

uint16_t pvid_weak_front_half_q31(const pvid_weak_design_q31 *design)
{
    uint16_t half = 0;
    for (size_t i = 0; i < design->model->jets; i++) {
        half = (design->filter[i].half > half) ? design->filter[i].half : half;
    }
    return half;
}

uint32_t pvid_weak_front_length_q31(const pvid_weak_design_q31 *design)
{
    const uint32_t steps = (2u * (uint32_t)pvid_weak_front_half_q31(design)) + 1u;
    return (uint32_t)design->model->signals * (3u + (2u * steps));
}

void pvid_weak_front_init_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design, const int32_t offset[])
{
    const pvid_weak_model_q31 *model = design->model;
    self->needs = pvid_weak_needs(model->signal, model->signals);
    self->plain = pvid_weak_signals_are_samples(model->signal, model->signals, model->samples);
    self->offset = offset;
    self->signals = model->signals;
    self->decimation = design->decimation;
    self->half = pvid_weak_front_half_q31(design);
    pvid_weak_front_reset_q31(self);
}

/* Outputs before those of the first step: the first block has none before it; and signals of several samples are right
 * from the second tick on. */
static uint16_t lost(const pvid_weak_front_q31 *self)
{
    if (self->decimation > 1u) {
        return 1;
    }
    return (uint16_t)(((self->needs != PVID_WEAK_NEEDS_NOTHING) && (self->half < 2u)) ? (2u - self->half) : 0u);
}

uint16_t pvid_weak_front_lead_q31(const pvid_weak_front_q31 *self)
{
    return (uint16_t)((uint32_t)self->decimation * ((uint32_t)lost(self) + self->half));
}

void pvid_weak_front_reset_q31(pvid_weak_front_q31 *self)
{
    self->head = 0;
    self->seen = false;
    self->missing = (uint16_t)(lost(self) + (2u * self->half) + 1u);
    self->wait = self->decimation;
    memset(self->line, 0, 3u * (size_t)self->signals * sizeof self->line[0]);
}

/* The samples before: all equal to the first one since a restart. */
static void remember(pvid_weak_front_q31 *self, size_t samples, const int32_t counts[])
{
    for (size_t i = 0; i < samples; i++) {
        self->before[2][i] = self->seen ? self->before[1][i] : counts[i];
        self->before[1][i] = self->seen ? self->before[0][i] : counts[i];
        self->before[0][i] = counts[i];
    }
    self->seen = true;
}

/* Of this tick, or of the one before if a signal is held. */
static int32_t signal_of(const pvid_weak_front_q31 *self, pvid_weak_signal signal, const int32_t counts[])
{
    const size_t i = signal.sample;
    const bool held = self->needs == PVID_WEAK_NEEDS_NEXT;
    const int32_t now = held ? self->before[0][i] : counts[i];
    const int32_t last = held ? self->before[1][i] : self->before[0][i];
    if (signal.source == (uint8_t)PVID_SIGNAL_HELD) {
        return (13 * (last + now)) - (self->before[2][i] + counts[i]);
    }
    if (signal.source == (uint8_t)PVID_SIGNAL_LAST) {
        return last;
    }
    return (signal.source == (uint8_t)PVID_SIGNAL_JUMP) ? (now - last) : now;
}

PVID_NOINLINE bool pvid_weak_front_derive_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design,
                                              const int32_t reading[])
{
    const pvid_weak_model_q31 *model = design->model;
    const bool first = !self->seen;
    int32_t counts[PVID_MAX_SAMPLES];
    for (size_t i = 0; i < model->samples; i++) {
        counts[i] = pvid_weak_count_q31(reading[i], self->offset[i]);
        if (!pvid_weak_is_within_q31(counts[i], design->full_scale[i])) {
            return false;
        }
    }
    if (first) {
        remember(self, model->samples, counts);
    }
    if (first && (self->needs == PVID_WEAK_NEEDS_NEXT)) {
        self->wait++; /* the next sample is missing */
    } else {
        for (size_t i = 0; i < model->signals; i++) {
            int32_t *sums = &self->line[2u * i];
            sums[0] += signal_of(self, model->signal[i], counts);
            sums[1] += sums[0];
        }
    }
    if (self->needs != PVID_WEAK_NEEDS_NOTHING) {
        remember(self, model->samples, counts);
    }
    return true;
}

/* A jet at a step; x: the signal there, its neighbours `stride` numbers apart. Beyond an int32 it saturates, which is
 * beyond its reach. */
static int32_t jet_of(const pvid_weak_filter_q31 *filter, uint8_t order, const int32_t *x, size_t stride)
{
    const PVID_TABLE int32_t *weight = filter->weights;
    const int32_t *after = x;
    const int32_t *before = x;
    const int32_t centre = *x;
    const bool odd = (order % 2u) != 0u;
    int64_t sum = 0;
    if (order == 0u) {
        sum = pvid_short_product_q31(*weight, centre);
    }
    for (size_t left = filter->half; left > 0u; left--) {
        weight++;
        after += stride;
        before -= stride;
        sum += pvid_short_product_q31(*weight, odd ? (*after - *before) : ((*after + *before) - (2 * centre)));
    }
    return (int32_t)pvid_clamp_q31(pvid_round_shift_q31(sum, filter->down), INT32_MAX);
}

bool pvid_weak_front_early_q31(const pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design, int32_t jet[],
                               bool *first)
{
    const uint32_t length = (2u * (uint32_t)self->half) + 1u;
    const uint32_t number = ((uint32_t)lost(self) + length) - ((uint32_t)self->missing + 1u);
    const uint32_t newest = ((self->head == 0u) ? length : self->head) - 1u;
    const size_t row = (size_t)newest + 3u;
    const int32_t *output = &self->line[row * self->signals];
    const int64_t ticks = self->decimation;
    *first = number == 0u;
    for (size_t i = 0; i < design->model->jets; i++) {
        const pvid_weak_jet one = design->model->jet[i];
        const pvid_weak_filter_q31 *filter = &design->filter[i];
        int64_t x = output[one.signal];
        if (*first) { /* it lacks what was before it: its weights D .. 1 are to have the sum of all */
            x = (x * 2 * ticks) / (ticks + 1);
        }
        const int64_t whole = (one.order == 0u) ? (*filter->weights * x) : 0;
        jet[i] = (int32_t)pvid_clamp_q31(pvid_round_shift_q31(whole, filter->down), INT32_MAX);
    }
    return number < ((uint32_t)lost(self) + self->half);
}

bool pvid_weak_front_step_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design, int32_t jet[])
{
    const pvid_weak_model_q31 *model = design->model;
    const size_t signals = PVID_COUNT(PVID_EXACT_SIGNALS, self->signals);
    const size_t jets = PVID_COUNT(PVID_EXACT_JETS, model->jets);
    const size_t length = (2u * (size_t)self->half) + 1u;
    int32_t *sums = self->line;
    int32_t *carry = &sums[2u * signals];
    int32_t *outputs = &carry[signals];
    int32_t *place = &outputs[self->head * signals];
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < signals; i++) {
        const int32_t once = sums[2u * i];
        const int32_t twice = sums[(2u * i) + 1u];
        const int32_t output = pvid_floor_shift_32_q31(twice + carry[i], design->down[i]);
        carry[i] = ((int32_t)self->decimation * once) - twice;
        sums[2u * i] = 0;
        sums[(2u * i) + 1u] = 0;
        place[i] = output;
        place[(length * signals) + i] = output;
    }
    self->wait = self->decimation;
    self->head = (uint16_t)((self->head + 1u == length) ? 0u : (self->head + 1u));
    if (self->missing > 1u) {
        self->missing--;
        return false;
    }
    const int32_t *centre = &outputs[((size_t)self->head + self->half) * signals];
    for (size_t i = 0; i < jets; i++) {
        const pvid_weak_jet one = model->jet[i];
        jet[i] = jet_of(&design->filter[i], one.order, &centre[one.signal], signals);
    }
    return true;
}
