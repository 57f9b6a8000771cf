#include "number/uncontracted.h"

/* A_h and B_h = sum_k channel(t_k) (cos + i sin)(2 pi h k / (2 hop)), k = 0..hop - 1, of the two halves of a window.
 *
 * Steps are added in blocks of eight, k = c - 4 .. c + 3 about a centre c. With a = pi h / hop and, as soon as both are
 * known, s_j = x_(c+j) + x_(c-j) and d_j = x_(c+j) - x_(c-j) in the places of the two, the block's sum is
 *
 *   e^(i a c) (P + i Q),   P = x_c + sum_j s_j cos(a j) + x_(c-4) cos(4 a),   Q = sum_j d_j sin(a j) - x_(c-4) sin(4
 * a),
 *
 * j = 1..3: half as many products as from the steps one by one, none for h = 0. A block is added while the next one
 * fills, one harmonic after the other. The circle has all the factors: sin(pi j / hop) at j = h k mod 2 hop, the cosine
 * a quarter turn behind. Behind the last block of a window follow its S_h = A_h + (-1)^h B_h, where B_h of a channel
 * with an integral I = E_1 + I' (E_1 + E_2 of the first half at its end) gets what I' from the second half's own start
 * lacks:
 *
 *   fold 1:  B + E_1 B[plain]        fold 2:  (B + E_2 B[plain]) + E_1 B[ramp]
 *
 * The next window's first block is added afterwards, to the place of A: two halves of sums suffice. */
#include "weak/sums_f32.h"

#include <stddef.h>
#include <string.h>

#include "number/exact.h"

/* Place of a block's centre. */
#define CENTRE (PVID_WEAK_BLOCK / 2u)

void pvid_weak_sums_reset_f32(pvid_weak_sums_f32 *self, uint8_t harmonics)
{
    self->half = 0;
    self->halves = 0;
    self->filling = 0;
    self->index = 0;
    self->harmonic = harmonics;
    self->joined = harmonics;
}

/* s_j and d_j of the step `place` behind the centre and its partner. */
static void pair(float (*block)[PVID_MAX_CHANNELS], size_t place, size_t number)
{
    const size_t channels = PVID_COUNT(PVID_EXACT_CHANNELS, number);
    float *after = block[place];
    float *before = block[(2u * CENTRE) - place];
    PVID_UNROLL_BY_FOUR
    for (size_t c = 0; c < channels; c++) {
        const float x = after[c];
        const float y = before[c];
        after[c] = x + y;
        before[c] = x - y;
    }
}

bool pvid_weak_sums_count_f32(pvid_weak_sums_f32 *self, uint16_t hop, size_t channels)
{
    const size_t place = self->index % PVID_WEAK_BLOCK;
    if (place > CENTRE) {
        pair(self->block[self->filling], place, channels);
    }
    self->index++;
    if (place + 1u < PVID_WEAK_BLOCK) {
        return false;
    }
    self->start = (uint16_t)(self->index - PVID_WEAK_BLOCK);
    self->target = self->half;
    self->harmonic = 0;
    self->filling = (uint8_t)(PVID_MAX_BLOCKS - 1u - self->filling);
    if (self->index < hop) {
        return false;
    }
    self->index = 0;
    self->half ^= 1u;
    self->halves = (uint8_t)((self->halves < 2u) ? (self->halves + 1u) : 2u);
    return true;
}

void pvid_weak_sums_join_f32(pvid_weak_sums_f32 *self, float edge[2][PVID_MAX_INTEGRANDS])
{
    memcpy(self->edge, edge, sizeof self->edge);
    self->joined = 0;
}

/* What the sums of a half begin with. */
static const float nothing[PVID_MAX_CHANNELS][2];

/* The block's sum of harmonic 0: the steps themselves. */
static void add_plain(size_t channels, const float x[], const float last[][2], float sum[][2])
{
    for (size_t c = 0; c < channels; c++) {
        float even = x[CENTRE * PVID_MAX_CHANNELS];
        PVID_UNROLL
        for (size_t j = 1; j < CENTRE; j++) {
            even += x[(CENTRE + j) * PVID_MAX_CHANNELS];
        }
        sum[c][0] = last[c][0] + (even + x[0]);
        sum[c][1] = 0.0f;
        x = &x[1];
    }
}

/* The block's sum of another harmonic, of a channel. */
static inline void add_channel(const float x[], const float cosine[], const float sine[], const float last[2],
                               float sum[2])
{
    float even = x[CENTRE * PVID_MAX_CHANNELS];
    float odd = 0.0f;
    PVID_UNROLL
    for (size_t j = 1; j < CENTRE; j++) {
        const float part = sine[j] * x[(CENTRE - j) * PVID_MAX_CHANNELS];
        even += cosine[j] * x[(CENTRE + j) * PVID_MAX_CHANNELS];
        odd = (j == 1u) ? part : (odd + part);
    }
    even += cosine[CENTRE] * x[0];
    odd -= sine[CENTRE] * x[0];
    sum[0] = (last[0] + (cosine[0] * even)) - (sine[0] * odd);
    sum[1] = (last[1] + (sine[0] * even)) + (cosine[0] * odd);
}

void pvid_weak_sums_add_f32(pvid_weak_sums_f32 *self, const pvid_weak_design_f32 *design, size_t number)
{
    const size_t channels = PVID_COUNT(PVID_EXACT_CHANNELS, number);
    const uint32_t h = self->harmonic;
    float (*sum)[2] = self->sum[self->target][h];
    const float (*last)[2] = (self->start == 0u) ? nothing : (const float (*)[2])sum;
    const float *x = self->block[PVID_MAX_BLOCKS - 1u - self->filling][0];
    self->harmonic++;
    if (h == 0u) {
        add_plain(channels, x, last, sum);
        return;
    }
    const uint32_t turn = 2u * (uint32_t)design->hop;
    const float *of_sine = design->circle;
    const float *of_cosine = &of_sine[design->hop / 2u];
    float cosine[CENTRE + 1u]; /* of 0 the centre's own, of j those of j steps */
    float sine[CENTRE + 1u];
    uint32_t at = (h * (self->start + CENTRE)) % turn;
    cosine[0] = of_cosine[at];
    sine[0] = of_sine[at];
    at = 0;
    PVID_UNROLL
    for (size_t j = 1; j <= CENTRE; j++) {
        at += h; /* at most 4 H: within a turn */
        cosine[j] = of_cosine[at];
        sine[j] = of_sine[at];
    }
    for (size_t c = 0; c < channels; c += 2u) { /* two of them: gcc does not unroll a loop of constant length in part */
        add_channel(&x[c], cosine, sine, last[c], sum[c]);
        if ((c + 1u) < channels) {
            add_channel(&x[c + 1u], cosine, sine, last[c + 1u], sum[c + 1u]);
        }
    }
}

/* I^1 or I^2 of an integrand at the end of the window's first half. */
static float edge_of(const pvid_weak_sums_f32 *self, const pvid_weak_channel *one, size_t fold, float half_time)
{
    if (one->integrand == PVID_WEAK_NONE) {
        return (fold == 1u) ? half_time : (0.5f * (half_time * half_time));
    }
    return self->edge[fold - 1u][one->integrand];
}

void pvid_weak_sums_join_one_f32(pvid_weak_sums_f32 *self, const pvid_weak_design_f32 *design, size_t number, float dt,
                                 float window[][PVID_MAX_CHANNELS][2])
{
    const size_t channels = PVID_COUNT(PVID_EXACT_CHANNELS, number);
    const float half_time = dt * (float)design->hop;
    const size_t h = self->joined;
    self->joined++;
    const float (*a)[2] = (const float (*)[2])self->sum[self->target ^ 1u][h];
    const float (*b)[2] = (const float (*)[2])self->sum[self->target][h];
    for (size_t c = 0; c < channels; c++) {
        const pvid_weak_channel *one = &design->model->channel[c];
        float re = b[c][0];
        float im = b[c][1];
        if (one->fold == 1u) {
            const float once = edge_of(self, one, 1, half_time);
            re += once * b[one->plain][0];
            im += once * b[one->plain][1];
        } else if (one->fold == 2u) {
            const float once = edge_of(self, one, 1, half_time);
            const float twice = edge_of(self, one, 2, half_time);
            re = (re + (twice * b[one->plain][0])) + (once * b[one->ramp][0]);
            im = (im + (twice * b[one->plain][1])) + (once * b[one->ramp][1]);
        } else {
            /* no integral */
        }
        window[h][c][0] = ((h % 2u) != 0u) ? (a[c][0] - re) : (a[c][0] + re);
        window[h][c][1] = ((h % 2u) != 0u) ? (a[c][1] - im) : (a[c][1] + im);
    }
}
