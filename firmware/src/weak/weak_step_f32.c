#include "number/uncontracted.h"

#include "number/short_loops.h"

/* Signs need the arguments of both neighbours, and an integral the next step's integrand. So with the jets of step k
 * the gains and integrands of step k - 1 follow, and with those the channels of step k - 2:
 *
 *   sign        width > 0:  tanh(v / width);   width 0: the mean of sgn over the step, v linear there,
 *               2 v_k / |g| within -1..1, g = (v_(k+1) - v_(k-1)) / 2  (at the first step v_1 - v_0)
 *   run         + dt/2 (r_(k-1) + r_k), r its derivative, with what rounding takes off kept (Kahan); from the first
 *               sample to the first step by the same rule over the outputs of the blocks there, or, if r depends on
 *               derivatives of signals, r stays that of the first step
 *   I^1_k       I^1_(k-1) + dt/24 (-f_(k-2) + 13 f_(k-1) + 13 f_k - f_(k+1))
 *   I^2_k       I^2_(k-1) + dt/2 (I^1_(k-1) + I^1_k) + dt^2/60 (f_(k+1) - f_(k-2) - 8 (f_k - f_(k-1)))
 *   of 1:       t and t^2/2
 *
 * The last term of I^2 removes the error of the trapezoids and that of I^1: I^2 is exact to order 6, I^1 to order 4.
 * Both integrals are 0 at the first step of a half window; their values there without that are the `edge`. */
#include "weak/weak_step_f32.h"

#include <stddef.h>

#include "number/exact.h"
#include "pvid/elementary.h"

void pvid_weak_step_init_f32(pvid_weak_history_f32 *self, float lead)
{
    self->lead = lead;
    pvid_weak_step_reset_f32(self);
}

PVID_COLD void pvid_weak_step_begin_f32(pvid_weak_history_f32 *self, const pvid_weak_design_f32 *design, float dt,
                                        const float jet[], bool first)
{
    float arguments[PVID_MAX_INPUTS];
    design->model->prepare(jet, arguments);
    for (size_t i = 0; i < design->model->runs; i++) {
        self->run[i] = first ? ((0.5f * dt) * arguments[i]) : (self->run[i] + (dt * arguments[i]));
    }
}

/* The runs at the first step, whose derivatives there are `rate`; `place` is written. */
PVID_COLD static void end_lead(pvid_weak_history_f32 *self, const pvid_weak_model_f32 *model, float dt,
                               const float jet[], const float rate[], float place[])
{
    float arguments[PVID_MAX_INPUTS]; /* without derivatives of signals */
    for (size_t i = 0; i < model->jets; i++) {
        place[i] = (model->jet[i].order == 0u) ? jet[i] : 0.0f;
    }
    model->prepare(place, arguments);
    for (size_t i = 0; i < model->runs; i++) {
        const bool known = (self->lead > 0.0f) && (arguments[i] >= rate[i]) && (arguments[i] <= rate[i]);
        self->run[i] = known ? (self->run[i] + ((0.5f * dt) * rate[i])) : (self->lead * rate[i]);
    }
    self->ran = true;
}

void pvid_weak_step_reset_f32(pvid_weak_history_f32 *self)
{
    self->known = 0;
}

/* Mean of sgn over a step, v linear there with this difference to the next step. */
static float mean_sign(float v, float slope)
{
    const float twice = 2.0f * v;
    const float size = pvid_magnitude_f32(slope);
    float sign = 0.0f;
    if (twice > size) {
        sign = 1.0f;
    } else if (twice < -size) {
        sign = -1.0f;
    } else if (size > 0.0f) {
        sign = twice / size;
    } else {
        sign = 0.0f;
    }
    return sign;
}

/* Signs of the step whose arguments are v[0]; `next`: those of the step behind it. */
static void find_signs(const pvid_weak_history_f32 *self, const pvid_weak_design_f32 *design, const float next[],
                       float sign[])
{
    const size_t signs = PVID_COUNT(PVID_EXACT_SIGNS, design->model->signs);
    for (size_t i = 0; i < signs; i++) {
        const float v = self->v[0][i];
        const float width = design->sign_width[i];
        const float slope = (self->known > 1u) ? (0.5f * (next[i] - self->v[1][i])) : (next[i] - v);
        sign[i] = (width > 0.0f) ? pvid_tanh_f32(v / width) : mean_sign(v, slope);
    }
}

/* Counts the step whose arguments are v[1], the half's first one or not, if one of its signs is in doubt. */
static void count_doubts(pvid_weak_history_f32 *self, const pvid_weak_design_f32 *design, bool first)
{
    const size_t signs = PVID_COUNT(PVID_EXACT_SIGNS, design->model->signs);
    bool doubt = false;
    for (size_t i = 0; i < signs; i++) {
        doubt = doubt || (pvid_magnitude_f32(self->v[1][i]) <= design->sign_doubt[i]);
    }
    self->doubts = (uint16_t)((first ? 0u : self->doubts) + (doubt ? 1u : 0u));
}

/* Moves the runs by a step; rate: their derivatives at its end. */
static void move_runs(pvid_weak_history_f32 *self, size_t runs, float half_dt, const float rate[])
{
    for (size_t i = 0; i < runs; i++) {
        const float rise = (half_dt * (self->rate[i] + rate[i])) + self->run_low[i];
        const float moved = self->run[i] + rise;
        self->run_low[i] = rise - (moved - self->run[i]);
        self->run[i] = moved;
    }
}

/* Integrals at the step whose integrands are `now`; `next`: those of the step behind it. */
static void integrate(pvid_weak_history_f32 *self, size_t integrands, float dt, const float now[], const float next[])
{
    const float part = dt / 24.0f;
    const float half = 0.5f * dt;
    const float bend = (dt * dt) / 60.0f;
    for (size_t i = 0; (self->known == 3u) && (i < integrands); i++) { /* a line before the second step */
        self->f[1][i] = (2.0f * self->f[0][i]) - now[i];
    }
    PVID_UNROLL_EXACT
    for (size_t i = 0; i < integrands; i++) {
        const float last = self->f[0][i];
        const float f = now[i];
        const float before = self->f[1][i];
        const float rise = part * (((-before + (13.0f * last)) + (13.0f * f)) - next[i]);
        const float from = self->integral[2u * i];
        const float once = from + rise;
        const float outside = (next[i] - before) - (8.0f * (f - last));
        const float twice = self->integral[(2u * i) + 1u] + ((half * (from + once)) + (bend * outside));
        self->integral[2u * i] = once;
        self->integral[(2u * i) + 1u] = twice;
        self->f[1][i] = last;
        self->f[0][i] = f;
    }
    for (size_t i = 0; (self->known <= 2u) && (i < (2u * integrands)); i++) { /* at the first step */
        self->integral[i] = 0.0f;
    }
}

/* A half window begins: the integrals begin anew. */
static void begin_half(pvid_weak_history_f32 *self, size_t integrands)
{
    for (size_t i = 0; i < integrands; i++) {
        self->edge[0][i] = self->integral[2u * i];
        self->edge[1][i] = self->integral[(2u * i) + 1u];
        self->integral[2u * i] = 0.0f;
        self->integral[(2u * i) + 1u] = 0.0f;
    }
}

bool pvid_weak_step_take_f32(pvid_weak_history_f32 *self, const pvid_weak_design_f32 *design, float dt, uint16_t index,
                             float channel[])
{
    const pvid_weak_model_f32 *model = design->model;
    float arguments[PVID_MAX_INPUTS]; /* of the newest step: derivatives of the runs, then arguments of sgn */
    const size_t runs = PVID_COUNT(PVID_EXACT_RUNS, model->runs);
    const size_t signs = PVID_COUNT(PVID_EXACT_SIGNS, model->signs);
    const size_t jets = PVID_COUNT(PVID_EXACT_JETS, model->jets);
    const size_t integrands = PVID_COUNT(PVID_EXACT_INTEGRANDS, model->integrands);
    const float *v = &arguments[runs];
    const bool complete = self->known > 1u;
    float *newest = self->inputs[self->newest];
    self->newest ^= 1u;
    float *before = self->inputs[self->newest];
    if (((runs + signs) > 0u) && (model->prepare != NULL)) {
        model->prepare(newest, arguments);
    }
    if (self->known > 0u) {
        find_signs(self, design, v, &before[jets + runs]);
        const float *now = self->out[self->latest];
        self->latest ^= 1u;
        float *next = self->out[self->latest];
        model->values(before, next);
        if (complete) {
            integrate(self, integrands, dt, &now[model->gains], &next[model->gains]);
            if (index == 0u) {
                begin_half(self, integrands);
            }
            if (design->sign_doubt != NULL) {
                count_doubts(self, design, index == 0u);
            }
            model->form(now, self->integral, dt * (float)index, channel);
        }
        move_runs(self, runs, 0.5f * dt, arguments);
    } else if ((runs > 0u) && !self->ran && (model->prepare != NULL)) {
        end_lead(self, model, dt, newest, arguments, before);
    } else {
        /* a gap: the runs stay */
    }
    for (size_t i = 0; i < signs; i++) {
        self->v[1][i] = self->v[0][i];
        self->v[0][i] = v[i];
    }
    for (size_t i = 0; i < runs; i++) {
        self->rate[i] = arguments[i];
        newest[jets + i] = self->run[i];
    }
    self->known = (uint8_t)((self->known < 4u) ? (self->known + 1u) : 4u);
    return complete;
}
