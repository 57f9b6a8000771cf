#include "number/uncontracted.h"

/* The sum of a constant over n steps of a half is G = sum_k e^(i a k), k = 0..n - 1, a = pi h / hop:
 *
 *   G = (1 - e^(i a n)) (1 + i q) / 2,   q = cot(a / 2) = (1 + cos a) / sin a,   h > 0;   n,   h = 0
 *
 * and its sum over a whole window is 0. Whatever of the signal is stored moves by the shift: samples, outputs, jets,
 * gains, steps of a block, and the sums by shift G. */
#include "pvid/weak.h"

#include "number/finite_f32.h"
#include "weak/sums_f32.h"

/* Whether the channel of this signal is the signal itself, in derivatives alone. */
static bool is_free(const pvid_weak_model_f32 *model, uint8_t sample, uint8_t channel)
{
    bool found = (sample < model->samples) && (channel < model->channels) &&
                 (model->channel[channel].gain != PVID_WEAK_NONE) && (model->channel[channel].fold == 0u);
    for (size_t i = 0; i < model->signals; i++) {
        found =
            found && ((model->signal[i].sample != sample) || (model->signal[i].source == (uint8_t)PVID_SIGNAL_SAMPLED));
    }
    for (size_t i = 0; i < model->kind[model->kinds - 1u].end; i++) {
        found = found && ((model->term[i].channel != channel) || (model->term[i].order > 0u));
    }
    return found;
}

/* Block sums, outputs and jets of a signal. */
static void move_signal(pvid_weak_f32 *self, size_t signal, float shift)
{
    pvid_weak_front_f32 *front = &self->front;
    const pvid_weak_model_f32 *model = self->design->model;
    const size_t signals = front->signals;
    const size_t outputs = 2u * ((2u * (size_t)front->half) + 1u);
    const uint32_t ticks = front->decimation;
    const float n = (front->wait < ticks) ? ((float)ticks - (float)front->wait) : 0.0f; /* in the block */
    float *sums = front->line;
    float *carry = &sums[2u * signals];
    sums[2u * signal] -= n * shift;
    sums[(2u * signal) + 1u] -= (0.5f * (n * (n + 1.0f))) * shift;
    carry[signal] -= (0.5f * (front->ticks * (front->ticks - 1.0f))) * shift;
    for (size_t i = 1; i <= outputs; i++) {
        carry[(i * signals) + signal] -= shift;
    }
    for (size_t i = 0; i < model->jets; i++) {
        if ((model->jet[i].signal == signal) && (model->jet[i].order == 0u)) {
            self->history.inputs[0][i] -= shift;
            self->history.inputs[1][i] -= shift;
        }
    }
}

/* The first `count` steps of a block: those behind the centre are sums with their partners, which are differences. */
static void move_block(float (*block)[PVID_MAX_CHANNELS], size_t channel, size_t count, float shift)
{
    const size_t centre = PVID_WEAK_BLOCK / 2u;
    for (size_t k = 0; k < count; k++) {
        if (k > centre) {
            block[k][channel] -= 2.0f * shift;
        } else if ((k == centre) || ((PVID_WEAK_BLOCK - k) >= count)) {
            block[k][channel] -= shift;
        } else {
            /* a difference */
        }
    }
}

/* The sum of harmonic h of n steps. */
static void move_sum(const pvid_weak_design_f32 *design, uint32_t h, uint32_t n, float shift, float sum[2])
{
    if (h == 0u) {
        sum[0] -= (float)n * shift;
        return;
    }
    const float *of_sine = design->circle;
    const float *of_cosine = &of_sine[design->hop / 2u];
    const uint32_t at = (h * n) % (2u * (uint32_t)design->hop);
    const float part = 1.0f - of_cosine[at];
    const float sine = of_sine[at];
    const float q = (1.0f + of_cosine[h]) / of_sine[h];
    sum[0] -= (0.5f * shift) * (part + (sine * q));
    sum[1] -= (0.5f * shift) * ((part * q) - sine);
}

bool pvid_weak_rebase_f32(pvid_weak_f32 *self, uint8_t sample, uint8_t channel, float shift)
{
    if ((self == NULL) || (self->design == NULL) || !pvid_finite_f32(shift) || (self->refine != NULL) ||
        !is_free(self->design->model, sample, channel)) {
        return false;
    }
    const pvid_weak_model_f32 *model = self->design->model;
    pvid_weak_sums_f32 *sums = &self->sums;
    for (size_t i = 0; i < model->signals; i++) {
        if (model->signal[i].sample == sample) {
            move_signal(self, i, shift);
        }
    }
#if !PVID_EXACT_PLAIN
    for (size_t i = 0; i < 3u; i++) {
        self->front.before[i][sample] -= shift;
    }
#endif
    const uint8_t gain = model->channel[channel].gain;
    self->history.out[0][gain] -= shift;
    self->history.out[1][gain] -= shift;
    self->limits.spread[sample].reference -= shift;
    const bool pending = sums->harmonic < self->harmonics;
    move_block(sums->block[sums->filling], channel, sums->index % PVID_WEAK_BLOCK, shift);
    if (pending) {
        const size_t other = (PVID_MAX_BLOCKS > 1) ? ((size_t)sums->filling ^ 1u) : 0u;
        move_block(sums->block[other], channel, PVID_WEAK_BLOCK, shift);
    }
    for (uint32_t h = 0; h < self->harmonics; h++) {
        const uint32_t added = sums->start + ((h < sums->harmonic) ? PVID_WEAK_BLOCK : 0u);
        move_sum(self->design, h, added, shift, sums->sum[sums->target][h][channel]);
        move_sum(self->design, h, self->design->hop, shift, sums->sum[sums->target ^ 1u][h][channel]);
    }
    return true;
}
