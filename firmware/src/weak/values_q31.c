/* As in weak_step_f32.c: with the jets of step k the gains and integrands of step k - 1 follow, and with those the
 * channels of step k - 2.
 *
 *   sgn_(k-1)  from the arguments v at k - 2, k - 1, k: the mean of sgn over the step, v linear there
 *   I^1        I_j = I_(j-1) + (-f_(j-2) + 13 f_(j-1) + 13 f_j - f_(j+1)) dt/24, the integral of a cubic
 *   I^2        += dt/2 (I_j + I_(j-1)) + dt^2/60 (f_(j+1) - f_(j-2) - 8 (f_j - f_(j-1)))
 *
 * In dt/120 and dt^2/240 both are integers; the shift of what a step adds to the second one is rounded. Before the
 * first step v and f go on in a straight line. */
#include "weak/values_q31.h"

#include <stddef.h>
#include <string.h>

#include "number/exact.h"
#include "pvid/elementary_q31.h"
#include "number/rescale_q31.h"

void pvid_weak_values_init_q31(pvid_weak_values_q31 *self, uint16_t lead)
{
    memset(self, 0, sizeof *self);
    self->lead = lead;
}

void pvid_weak_values_reset_q31(pvid_weak_values_q31 *self)
{
    self->known = 0;
    self->index = 0;
    self->half = 0;
    memset(self->owed, 0, sizeof self->owed);
}

void pvid_weak_values_begin_q31(pvid_weak_values_q31 *self, const pvid_weak_design_q31 *design, const int32_t jet[],
                                bool first)
{
    int32_t rate[2 * PVID_MAX_INTEGRANDS];
    const bool within = design->model->prepare(jet, rate);
    for (size_t i = 0; i < design->model->runs; i++) {
        const int64_t x = within ? (int64_t)rate[i] : 0;
        self->run[i] = first ? x : (self->run[i] + (2 * x));
    }
}

/* The runs at the first step: what came before it counts where the derivatives, `newest`, do not depend on those of
 * signals; else that of the first step. */
static void end_lead(pvid_weak_values_q31 *self, const pvid_weak_design_q31 *design, const int32_t jet[],
                     const int32_t newest[])
{
    const pvid_weak_model_q31 *model = design->model;
    int32_t plain[PVID_MAX_INPUTS];
    int32_t rate[2 * PVID_MAX_INTEGRANDS];
    for (size_t i = 0; i < model->jets; i++) {
        plain[i] = (model->jet[i].order == 0u) ? jet[i] : 0;
    }
    const bool within = model->prepare(plain, rate);
    for (size_t i = 0; i < model->runs; i++) {
        const bool known = (self->lead > 0u) && within && (rate[i] == newest[i]);
        const int64_t held = (2 * ((int64_t)newest[i] * (int64_t)self->lead)) / (int64_t)design->decimation;
        self->run[i] = known ? (self->run[i] + newest[i]) : held;
    }
}

/* Mean of sgn over a step: v 2/|g| within +-1, with the slope g = (after - before)/2; 0 for 0. Q30. */
static int32_t mean_sign(int64_t before, int32_t v, int32_t after)
{
    const int64_t part = 4 * (int64_t)pvid_fixed_magnitude_q31(v);
    const int64_t whole = (int64_t)pvid_magnitude_q31(after - before);
    if (part >= whole) {
        return pvid_sign_q31(v);
    }
    const int32_t mean = (int32_t)((part * PVID_ONE_Q30) / whole);
    return (v < 0) ? -mean : mean;
}

/* Signs and runs at the step before the newest, whose arguments and derivatives are `newest`; then moves on. */
static void complete_inputs(pvid_weak_values_q31 *self, const pvid_weak_design_q31 *design, const int32_t newest[])
{
    const pvid_weak_model_q31 *model = design->model;
    int32_t *run = &self->now[PVID_COUNT(PVID_EXACT_JETS, model->jets)];
    int32_t *sign = &run[PVID_COUNT(PVID_EXACT_RUNS, model->runs)];
    for (size_t i = 0; i < PVID_COUNT(PVID_EXACT_RUNS, model->runs); i++) {
        run[i] = pvid_rescaled_q31(self->run[i], &design->run[i]);
    }
    for (size_t i = 0; i < PVID_COUNT(PVID_EXACT_SIGNS, model->signs); i++) {
        const int32_t v = self->v[0][i];
        const int32_t width = design->sign_width[i];
        const int32_t next = newest[model->runs + i];
        const int64_t before = (self->known > 1u) ? self->v[1][i] : ((2 * (int64_t)v) - next);
        sign[i] = (width > 0) ? pvid_tanh_q31(v, width) : mean_sign(before, v, next);
    }
}

static void take_newest(pvid_weak_values_q31 *self, const pvid_weak_design_q31 *design, const int32_t jet[],
                        const int32_t newest[])
{
    const pvid_weak_model_q31 *model = design->model;
    if (!self->ran && (PVID_COUNT(PVID_EXACT_RUNS, model->runs) > 0u) && (model->prepare != NULL)) {
        end_lead(self, design, jet, newest);
    }
    for (size_t i = 0; i < PVID_COUNT(PVID_EXACT_RUNS, model->runs); i++) {
        const int64_t rise = (self->known > 0u) ? ((int64_t)self->rate[i] + newest[i]) : 0; /* 0: over a gap */
        self->run[i] = pvid_clamp_q31(self->run[i] + rise, PVID_WIDE);
        self->rate[i] = newest[i];
    }
    for (size_t i = 0; i < PVID_COUNT(PVID_EXACT_SIGNS, model->signs); i++) {
        self->v[1][i] = self->v[0][i];
        self->v[0][i] = newest[model->runs + i];
    }
    for (size_t i = 0; i < PVID_COUNT(PVID_EXACT_JETS, model->jets); i++) {
        self->now[i] = jet[i];
    }
    self->ran = true;
}

/* x and what is owed, 2^-s of it rounded down; the rest stays owed: 0 to 2^s - 1. */
static inline int32_t shifted_with(int32_t *owed, int32_t x, uint32_t s)
{
    const int32_t whole = x + *owed;
    const int32_t down = pvid_floor_shift_32_q31(whole, s);
    *owed = (int32_t)((uint32_t)whole & (((uint32_t)1 << s) - 1u));
    return down;
}

/* Integrals at the step before that of the integrands f; at the first step of a half they begin anew. */
static void integrate(pvid_weak_values_q31 *self, const pvid_weak_design_q31 *design, const int32_t f[], bool begins)
{
    const size_t ended = (size_t)self->half ^ 1u;
    for (size_t i = 0; i < PVID_COUNT(PVID_EXACT_INTEGRANDS, design->model->integrands); i++) {
        const int32_t next = shifted_with(&self->owed[i], f[i], design->integral[i].down);
        const int32_t now = self->f[0][i];
        const int32_t last = self->f[1][i];
        const int32_t before = (self->known > 3u) ? self->f[2][i] : ((2 * last) - now);
        int32_t once = 0;
        int32_t twice = 0;
        self->f[0][i] = next;
        self->f[1][i] = now;
        self->f[2][i] = last;
        if (self->known > 2u) {
            once = self->once[i] + (5 * ((13 * (last + now)) - (before + next)));
            const int32_t rise = (self->once[i] + once) + (4 * ((next - before) - (8 * (now - last))));
            const int32_t half = pvid_floor_shift_32_q31(rise, (uint32_t)design->integral[i].twice - 1u);
            twice = self->twice[i] + pvid_floor_shift_32_q31(half + 1, 1);
        }
        if (begins) {
            self->edge[ended][0][i] = once;
            self->edge[ended][1][i] = twice;
            once = 0;
            twice = 0;
        }
        self->once[i] = once;
        self->twice[i] = twice;
    }
}

/* I^fold of a channel at the present step; that of 1 in dt/2, dt^2/48. */
static inline int32_t integral_of(const pvid_weak_values_q31 *self, const pvid_weak_channel *channel, uint32_t lift)
{
    const int32_t steps = (int32_t)self->index;
    const bool first = channel->fold == 1u;
    const size_t i = channel->integrand;
    if (i == PVID_WEAK_NONE) {
        return (int32_t)((uint32_t)(first ? (2 * steps) : (24 * steps * steps)) << lift);
    }
    return first ? self->once[i] : self->twice[i];
}

/* A value, |value| <= 2^30, or the nearest within +-2^28. */
static inline pvid_weak_entry_q31 entry_of(int32_t value)
{
    const int32_t most = 2 * PVID_WEAK_LIMIT_Q31;
    int32_t above = value + PVID_WEAK_LIMIT_Q31; /* 0..2^29 */
    if ((uint32_t)above > (uint32_t)most) {
        above = (value < 0) ? 0 : most;
    }
#if defined(__ARM_ARCH_6M__)
    const uint32_t both = (uint32_t)above;
    const pvid_weak_entry_q31 entry = {(uint16_t)(both & (((uint32_t)1 << PVID_WEAK_ENTRY_BITS_Q31) - 1u)),
                                       (uint16_t)(both >> PVID_WEAK_ENTRY_BITS_Q31)};
    return entry;
#else
    return above - PVID_WEAK_LIMIT_Q31;
#endif
}

static void write_channels(const pvid_weak_values_q31 *self, const pvid_weak_design_q31 *design,
                           pvid_weak_entry_q31 channel[])
{
    const size_t summed = PVID_COUNT(PVID_EXACT_CHANNELS, pvid_weak_summed_q31(design->model));
    for (size_t k = 0; k < summed; k++) {
        const pvid_weak_channel *one = &design->model->channel[k];
        const pvid_weak_format_q31 *format = &design->format[k];
        int32_t value = self->gain[one->gain];
        if (one->fold > 0u) {
            value = pvid_upper_product_q31(value, integral_of(self, one, format->lift));
        }
        value = pvid_floor_shift_32_q31(pvid_floor_shift_32_q31(value, (uint32_t)format->value - 1u) + 1, 1);
        channel[k * (size_t)PVID_WEAK_BLOCK_Q31] = entry_of(value);
    }
}

pvid_weak_outcome pvid_weak_values_step_q31(pvid_weak_values_q31 *self, const pvid_weak_design_q31 *design,
                                            const int32_t jet[], pvid_weak_entry_q31 channel[])
{
    const pvid_weak_model_q31 *model = design->model;
    int32_t newest[2 * PVID_MAX_INTEGRANDS]; /* `prepare` and `values` write all that is read */
    int32_t out[PVID_MAX_CHANNELS + PVID_MAX_INTEGRANDS];
    if ((model->prepare != NULL) && !model->prepare(jet, newest)) {
        return PVID_WEAK_BEYOND;
    }
    const bool complete = self->known > 1u;
    if (self->known > 0u) {
        complete_inputs(self, design, newest);
        if (!model->values(self->now, out)) {
            return PVID_WEAK_BEYOND;
        }
        integrate(self, design, &out[model->gains], complete && (self->index == 0u));
        if (complete) {
            write_channels(self, design, channel);
        }
        for (size_t i = 0; i < model->gains; i++) {
            self->gain[i] = out[i];
        }
    }
    take_newest(self, design, jet, newest);
    self->known = (uint8_t)((self->known < 4u) ? (self->known + 1u) : 4u);
    return complete ? PVID_WEAK_CHANNELS : PVID_WEAK_NO_CHANNELS;
}

void pvid_weak_values_next_q31(pvid_weak_values_q31 *self, uint16_t hop)
{
    self->index++;
    if (self->index == hop) {
        self->index = 0;
        self->half ^= 1u;
    }
}
