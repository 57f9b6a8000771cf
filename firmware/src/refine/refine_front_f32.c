#include "number/uncontracted.h"

/* Means x of `ratio` samples, of an input that is held from tick to tick of its means about the ticks (with Runge-Kutta
 * its mean from an entry to the next, without droop), of an integral of its values; x - droop (x_-1
 * - 2 x + x_+1): the mean's droop undone to second order (the weights undo the rest). Second derivatives: w_0 x + sum_i
 * w_i (x_-i + x_+i), i = 1..half.
 *
 * Gate of wild samples: a mean that is off by s makes the fourth differences s (1, -4, 6, -4, 1); with 6 s beyond
 * outlier_gate times the usual (the largest of the period before) and its neighbours opposite and more than PART of it,
 * the mean is that of a wild sample. A jump makes 1, -3, 3, -1 and a kink 1, -2, 1: these stay, and raise the usual. An
 * output is missing then; of an input s is taken off, the rest is the cubic through the neighbours. */
#include "refine/refine_front_f32.h"

#include <stddef.h>
#include <string.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#if PVID_REFINE_TURNING
#include "refine_model_f32.h"
#endif

#define INPUTS PVID_REFINE_INPUTS
#define SIGNALS PVID_REFINE_SIGNALS
#define TAPS ((2 * PVID_REFINE_HALF) + 1) /* of the filter */
#define LENGTH (TAPS + PVID_REFINE_LATE)  /* of a line */
#define PERIOD 64u                        /* entries */
#define PART 0.58f                        /* between a kink's 1/2 and 2/3 */
#define LARGEST 3.4e38f
#define FULL_SCALE 32767.0f
#define MASK ((uint32_t)PVID_REFINE_RING - 1u)

PVID_COLD void pvid_refine_front_init_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config)
{
    const float ratio = (float)config->ratio;
    self->share = 1.0f / ratio;
    self->behind = PVID_REFINE_LATE;
#if PVID_REFINE_RUNGE_KUTTA
    self->middle = (uint8_t)(config->ratio - ((config->ratio - 1u) / 2u));
    self->between = (config->ratio & 1u) == 0u;
    self->flat = config->ratio == 1u;
#endif
    for (size_t i = 0; i < SIGNALS; i++) {
        const pvid_refine_signal_f32 *signal = &config->signal[i];
        const float steps = 1.0f / (ratio * ratio); /* the droop of a held input's own steps stays */
        self->droop[i] = ((signal->source == (uint8_t)PVID_SIGNAL_HELD) ? (1.0f + steps) : (1.0f - steps)) / 24.0f;
        self->to_counts[i] = signal->scale * (FULL_SCALE / signal->range);
        self->from_counts[i] = signal->range / FULL_SCALE;
        self->sample[i] = signal->sample;
        self->derived[i] = signal->order == 2;
#if PVID_REFINE_INTEGRALS
        if (PVID_REFINE_IS_INPUT(i)) {
            self->half_tick[i] = (signal->order == -1) ? (0.5f / config->sample_rate_hz) : 0.0f;
        }
#endif
#if PVID_REFINE_TURNING
        if (!PVID_REFINE_IS_INPUT(i)) {
            const bool turns = pvid_refine_turning[i - INPUTS] != 0u;
            self->turn[i - INPUTS] = turns ? (65536.0f * self->from_counts[i]) : 0.0f;
        }
#endif
#if PVID_REFINE_RUNGE_KUTTA
        if (PVID_REFINE_IS_INPUT(i)) {
            self->held_between[i] = signal->source == (uint8_t)PVID_SIGNAL_HELD;
        }
#endif
        self->behind = self->derived[i] ? (uint8_t)(PVID_REFINE_HALF + PVID_REFINE_LATE) : self->behind;
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
    self->postponed = false;
    memset(self->sum, 0, sizeof self->sum);
    memset(self->rest, 0, sizeof self->rest);
    memset(self->past, 0, sizeof self->past);
    for (size_t i = 0; i < SIGNALS; i++) {
        self->peak[i] = LARGEST;
        self->usual[i] = LARGEST;
    }
}

uint32_t pvid_refine_front_first_f32(const pvid_refine_front_f32 *self)
{
    const uint32_t complete = (uint32_t)self->behind - PVID_REFINE_LATE;
#if PVID_REFINE_RUNGE_KUTTA
    return complete + 1u; /* a step needs the entry before */
#else
    return complete;
#endif
}

uint32_t pvid_refine_front_room_f32(const pvid_refine_front_f32 *self)
{
    return (uint32_t)PVID_REFINE_RING - self->behind;
}

#if PVID_REFINE_RUNGE_KUTTA
/* Weights of four entries at `t`, 0..1 from the second to the third one: of the cubic through them. */
static void weights_of_samples(float t, float weight[])
{
    const float before = t + 1.0f;
    const float behind = t - 1.0f;
    const float last = t - 2.0f;
    weight[0] = ((t * behind) * last) * (-1.0f / 6.0f);
    weight[1] = ((before * behind) * last) * 0.5f;
    weight[2] = ((before * t) * last) * -0.5f;
    weight[3] = ((before * t) * behind) * (1.0f / 6.0f);
}

/* The same for means of the steps behind the entries: of the parabola with these means. A step of one tick is flat. */
static void weights_of_means(const pvid_refine_front_f32 *self, float t, float weight[])
{
    const float place = self->flat ? 0.0f : (t - 0.5f);
    const float bend = self->flat ? 0.0f : (0.5f * ((place * place) - (1.0f / 12.0f)));
    weight[0] = bend - (0.5f * place);
    weight[1] = 1.0f - (2.0f * bend);
    weight[2] = bend + (0.5f * place);
    weight[3] = 0.0f;
}

void pvid_refine_front_between_f32(const pvid_refine_front_f32 *self, uint32_t entry, float t, float input[])
{
    float weight[2][4];
    weights_of_samples(t, weight[0]);
    weights_of_means(self, t, weight[1]);
    for (size_t i = 0; PVID_REFINE_IS_INPUT(i); i++) {
        const float *own = weight[self->held_between[i] ? 1 : 0];
        float sum = 0.0f;
        for (uint32_t j = 0; j < 4u; j++) {
            sum += own[j] * (float)self->ring[(entry + j - 1u) & MASK][i];
        }
        input[i] = sum * self->from_counts[i];
    }
}
#endif

/* Sizes of floats by their bits, which order as they do; NaN is the largest. */
#define SIZE_BITS 0x7FFFFFFFu
#define SIGN 0x80000000u
#define HALF_BITS 0x3F000000u       /* 0.5 */
#define FULL_SCALE_BITS 0x46FFFE00u /* 32767 */

/* x and what rounding left of the entry before, rounded to the nearest count: the errors of neighbours cancel for slow
 * signals. INT16_MIN if it is not finite or beyond full scale. */
static int16_t counts(float *rest, float x)
{
    const float whole = x + *rest;
    const uint32_t bits = pvid_bits_f32(whole);
    if ((bits & SIZE_BITS) >= FULL_SCALE_BITS) {
        *rest = 0.0f;
        return INT16_MIN;
    }
    const int16_t rounded = (int16_t)(int32_t)(whole + pvid_from_bits_f32((bits & SIGN) | HALF_BITS));
    *rest = whole - (float)rounded;
    return rounded;
}

#if PVID_REFINE_TURNING
#define MOST_COUNTS 2.0e9f

/* The same without whole turns. */
static int16_t counts_of_turning(float *rest, float x)
{
    const float whole = x + *rest;
    if (!((whole > -MOST_COUNTS) && (whole < MOST_COUNTS))) {
        *rest = 0.0f;
        return INT16_MIN;
    }
    const float half = (whole < 0.0f) ? -0.5f : 0.5f;
    const int32_t rounded = (int32_t)(whole + half);
    const int32_t within = (int32_t)(((uint32_t)rounded + 0x8000u) & 0xFFFFu) - 0x8000;
    *rest = whole - (float)rounded;
    return (int16_t)((within == INT16_MIN) ? (INT16_MIN + 1) : within);
}
#endif

/* The second derivative in the middle of the oldest means of a line. */
static float second_derivative(const float line[], const float weights[])
{
    float sum = weights[0] * line[PVID_REFINE_HALF];
    PVID_UNROLL for (size_t i = 1; i <= PVID_REFINE_HALF; i++)
    {
        sum += weights[i] * (line[PVID_REFINE_HALF - i] + line[PVID_REFINE_HALF + i]);
    }
    return sum;
}

/* A mean with its droop undone, of the entry `next`; its second derivative is that of an earlier entry. Returns the
 * count that is written: INT16_MIN beyond the range; 0 until the filter has all its means. */
static int16_t enter(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config, size_t signal, float x)
{
    uint32_t entry = self->next;
    float value = x;
    if (self->derived[signal]) {
        float *newest = &self->line[signal][self->place];
        newest[0] = x;
        newest[LENGTH] = x;
        if (entry < (uint32_t)(LENGTH - 1)) {
            return 0;
        }
        entry -= PVID_REFINE_HALF + PVID_REFINE_LATE;
        value = second_derivative(&newest[1], config->second);
    }
    const float scaled = value * self->to_counts[signal];
#if PVID_REFINE_TURNING
    const bool turns = (!PVID_REFINE_IS_INPUT(signal)) && (pvid_refine_turning[signal - INPUTS] != 0u);
    const int16_t count = turns ? counts_of_turning(&self->rest[signal], scaled) : counts(&self->rest[signal], scaled);
#else
    const int16_t count = counts(&self->rest[signal], scaled);
#endif
    self->ring[entry & MASK][signal] = count;
    return count;
}

#if !PVID_REFINE_RUNGE_KUTTA
/* The sum of a held input's means about the ticks: half of each of the two samples that bound the block is another
 * block's. */
static void about_the_ticks(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config, const float sample[])
{
    for (size_t i = 0; PVID_REFINE_IS_INPUT(i); i++) {
        if (config->signal[i].source == (uint8_t)PVID_SIGNAL_HELD) {
            const float last = sample[self->sample[i]] - self->reference[i];
            self->sum[i] += 0.5f * (self->held[i] - last);
            self->held[i] = last;
        }
    }
}
#endif

static float size_of(float x)
{
    return (x < 0.0f) ? -x : x;
}

/* Takes a wild mean out, that of the last entry but one: what it put into three entries. */
static void leave_out(pvid_refine_front_f32 *self, size_t signal, float off)
{
    const float neighbour = -(self->droop[signal] * off);
    const float part[3] = {neighbour, off - (2.0f * neighbour), neighbour};
    for (uint32_t back = 1; back <= 3u; back++) {
        if (self->derived[signal]) {
            const uint32_t place =
                (uint32_t)self->place + ((uint32_t)self->place < back ? (uint32_t)LENGTH : 0u) - back;
            self->line[signal][place] -= part[back - 1u];
            self->line[signal][place + LENGTH] = self->line[signal][place];
        } else {
            self->ring[(self->next - back) & MASK][signal] = INT16_MIN;
        }
    }
}

/* Whether a difference is opposite to one of that size, and a wild mean's neighbour. */
static bool is_beside(float opposite, float size)
{
    return (opposite > (PART * size)) && (opposite < size);
}

/* A fourth difference beyond the period's others: the one before it may be a wild mean's, by whose error the mean is
 * then off. One beyond the limit that is none adds to the usual ones when it is past. */
PVID_COLD static float judge(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config, size_t signal,
                             float newest)
{
    const float *past = self->past[signal];
    const float limit = config->outlier_gate * self->usual[signal];
    const float size = size_of(past[4]);
    const float sign = (past[4] < 0.0f) ? 1.0f : -1.0f;
    float off = 0.0f;
    if (size_of(newest) <= limit) {
        self->peak[signal] = size_of(newest);
    }
    if (size > limit) {
        if (is_beside(sign * newest, size) && is_beside(sign * past[5], size)) {
            off = past[4] * (1.0f / 6.0f);
            leave_out(self, signal, off);
        } else if ((size > size_of(newest)) && (size > size_of(past[5])) && (size > self->peak[signal])) {
            self->peak[signal] = size;
        } else {
            /* a larger one is beside it */
        }
    }
    return off;
}

/* The largest fourth differences of a period are the usual ones of the next. A period lasts on while a mean may be
 * wild, but not twice as long. */
PVID_COLD static void end_period(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config)
{
    for (size_t i = 0; i < SIGNALS; i++) {
        const bool large = size_of(self->past[i][4]) > (config->outlier_gate * self->usual[i]);
        if (large && !self->postponed) {
            self->postponed = true;
            return;
        }
    }
    self->postponed = false;
    for (size_t i = 0; i < SIGNALS; i++) {
        if ((config->outlier_gate > 0.0f) && ((!PVID_REFINE_IS_INPUT(i)) || self->derived[i])) {
            self->usual[i] = self->peak[i];
            self->peak[i] = 0.0f;
        }
    }
}

pvid_refine_entry pvid_refine_front_end_block_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config,
                                                  const float sample[])
{
    const bool known = self->means >= 2u;
#if PVID_REFINE_RUNGE_KUTTA
    (void)sample;
#else
    about_the_ticks(self, config, sample);
#endif
    for (size_t i = 0; PVID_REFINE_IS_INPUT(i); i++) {
        if (!pvid_finite_f32(self->sum[i])) {
            return PVID_REFINE_BROKEN;
        }
    }
    for (size_t i = 0; i < SIGNALS; i++) {
        float *past = self->past[i];
        const float x = self->sum[i] * self->share;
        const float middle = past[0];
        const float first = x - middle;
        const float second = first - past[1];
        float third = second - past[2];
        float fourth = third - past[3];
        if ((pvid_bits_f32(fourth) & SIZE_BITS) > pvid_bits_f32(self->peak[i])) {
            const float off = judge(self, config, i, fourth);
            third += off;
            fourth += 4.0f * off;
        }
        float entry = middle - (self->droop[i] * second);
#if PVID_REFINE_RUNGE_KUTTA
        if (PVID_REFINE_IS_INPUT(i) && self->held_between[i]) {
            entry = (self->held[i] + self->ahead[i]) * self->share;
            self->held[i] = self->sum[i] - self->ahead[i];
        }
#endif
        if (known) {
            const int16_t count = enter(self, config, i, entry);
            if (PVID_REFINE_IS_INPUT(i) && (count == INT16_MIN)) {
                return PVID_REFINE_BROKEN; /* beyond its range */
            }
        }
        past[0] = x;
        past[1] = first;
        past[2] = second;
        past[3] = third;
        past[5] = past[4];
        past[4] = fourth;
        self->sum[i] = 0.0f;
    }
    self->wait = config->ratio;
    if (!known) {
        self->means++;
        return PVID_REFINE_NOTHING;
    }
    self->next++;
    self->place = (uint16_t)((self->place == (uint16_t)(LENGTH - 1)) ? 0u : (self->place + 1u));
    if ((self->next & (PERIOD - 1u)) == 0u) {
        end_period(self, config);
    }
    return PVID_REFINE_ENTERED;
}

PVID_COLD void pvid_refine_front_refer_f32(pvid_refine_front_f32 *self, const pvid_refine_config_f32 *config,
                                           const float sample[])
{
    for (size_t i = 0; PVID_REFINE_IS_INPUT(i); i++) {
        const float x = sample[config->signal[i].sample];
#if PVID_REFINE_INTEGRALS
        self->before[i] = -x; /* the first trapezoid is empty */
#endif
        self->reference[i] = self->derived[i] ? x : 0.0f;
        self->held[i] = x - self->reference[i];
    }
    self->referred = true;
}
