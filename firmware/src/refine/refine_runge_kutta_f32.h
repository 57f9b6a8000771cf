/* Steps of Runge-Kutta (order 4), which follow relaxations and friction: a step has parts, more of them where a sign
 * may change. The columns are those of a linear motion with the mean of the Jacobians of a big step: at one instant a
 * Jacobian either does not contain a reversal, or is dominated by it. A part of refine_pass_f32.c. */
#ifndef PVID_REFINE_RUNGE_KUTTA_F32_H
#define PVID_REFINE_RUNGE_KUTTA_F32_H

#include <stddef.h>
#include <string.h>

#include "refine/refine_kick_f32.h"
#include "refine/refine_motion_f32.h"

#if PVID_REFINE_RUNGE_KUTTA

#if PVID_REFINE_ORDER != 1
#error "steps of Runge-Kutta are those of equations of the first order"
#endif

#define DOUBLED (64u * PVID_REFINE_SUB) /* parts of a big step that the factor of its columns is made from */
/* The sign may change in the next step if its argument is at most this many times its change over the last step; one
 * that changes in another step is as exact as that step. */
#define REACH 2.0f

/* Jobs of a pass. START once; SLOPES and STEP are the two halves of a part of a step. */
enum { CLEAR, START, SLOPES, STEP, KICK, DOUBLE, SPREAD, COLUMNS, MORE_COLUMNS, ROWS, MORE_ROWS };

/* Steps from that of a job to the one whose signals it needs: a cubic goes on beyond the end of the step. */
static const uint8_t pvid_refine_ahead[] = {0, 0, 2, 2};

static inline void begin_steps(pvid_refine_pass_f32 *self, const pvid_refine_steps_f32 *steps)
{
    self->some_parts = steps->parts;
    self->fine_parts = steps->fine_parts;
    self->parts = (PVID_REFINE_SIGNS > 0) ? steps->fine_parts : steps->parts;
    self->part = 0;
    self->part_s = steps->h / (float)self->parts;
}

static inline void clear_steps(pvid_refine_pass_f32 *self)
{
    memset(self->difference, 0, sizeof self->difference);
    memset(self->kick, 0, sizeof self->kick);
}

/* F over twice the time: 2 F + F K F. */
static void double_factor(pvid_refine_pass_f32 *self)
{
    float rates[N_Q][N_Q];
    float half[N_Q][N_Q];
    float more[N_Q][N_Q];
    memcpy(rates, self->kick, sizeof rates);
    multiply(rates, self->factor, half);
    multiply(self->factor, half, more);
    for (size_t i = 0; i < N_Q; i++) {
        for (size_t j = 0; j < N_Q; j++) {
            self->factor[i][j] = (2.0f * self->factor[i][j]) + more[i][j];
        }
    }
}

/* Adds the derivatives at the beginning of a part to their mean over the big step; `a`: the rates there. */
PVID_NOINLINE static void differentiate(pvid_refine_pass_f32 *self, const float u[], float a[])
{
    const float share = 1.0f / (float)((uint32_t)PVID_REFINE_SUB * (uint32_t)self->parts);
    const float *x = self->state;
    float found[N_Q * (PVID_REFINE_STATES + PVID_REFINE_MOVING)];
    pvid_refine_jacobian(self->constants, x, &x[RATES], u, a, found, &found[N_Q * RATES],
                         &found[N_Q * PVID_REFINE_STATES]);
    for (size_t i = 0; i < (size_t)(N_Q * (PVID_REFINE_STATES + PVID_REFINE_MOVING)); i++) {
        self->kick[i] += share * found[i];
    }
}

#if PVID_REFINE_SKEW
/* New rates `a`, and their change. */
static void renew(pvid_refine_pass_f32 *self, const float a[])
{
    for (size_t i = 0; i < N_Q; i++) {
        self->difference[i][1] = a[i] - self->difference[i][0];
        self->difference[i][0] = a[i];
    }
}
#endif

/* The residuals at the beginning of a block. */
static void start(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
#if PVID_REFINE_SIGNS > 0
    pvid_refine_signs(self->constants, self->state, &self->state[RATES], signals->u, self->argument);
#endif
#if PVID_REFINE_SKEW
    float a[N_Q];
    accelerations(self->constants, self->state, signals->u, a);
    renew(self, a);
    for (size_t i = 0; i < N_Q; i++) {
        self->difference[i][1] = 0.0f;
    }
#endif
    residuals(self, r, self->state, signals->u, signals->z, self->last);
}

/* A state with the rate k, h after x. */
static void advanced(const float x[], const float k[], float h, float out[])
{
    PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
    {
        out[i] = x[i] + (h * k[i]);
    }
}

/* How many parts the next step has, which begins with inputs u. */
static void divide(pvid_refine_pass_f32 *self, const float u[])
{
    self->part = 0;
#if PVID_REFINE_SIGNS > 0
    float argument[PVID_REFINE_SIGNS];
    bool may_change = false;
    pvid_refine_signs(self->constants, self->state, &self->state[RATES], u, argument);
    for (size_t i = 0; i < PVID_REFINE_SIGNS; i++) {
        const float change = REACH * (argument[i] - self->argument[i]);
        may_change = may_change || ((argument[i] * argument[i]) <= (change * change));
        self->argument[i] = argument[i];
    }
    self->parts = may_change ? self->fine_parts : self->some_parts;
    self->part_s = self->h / (float)self->parts;
#else
    (void)u;
#endif
}

/* The first two slopes of a part of a step. */
PVID_NOINLINE static void slopes(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    float at[PVID_REFINE_STATES];
    if ((self->at == (uint8_t)MIDDLE) && (self->part == 0u)) {
#if !PVID_REFINE_OUTPUT_LINEAR
        output_derivatives(self, r, self->state, signals->u, self->output_column);
#endif
#if PVID_REFINE_SKEW
        slip(self, r, signals->u);
#endif
        (void)r;
    }
    differentiate(self, signals->u, self->slope);
    advanced(self->state, self->slope, 0.5f * self->part_s, at);
    accelerations(self->constants, at, signals->middle, self->scratch[0]);
}

/* The other two, and its end. */
PVID_NOINLINE static void step(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    const float h = self->part_s;
    const float *second = self->scratch[0];
    float at[PVID_REFINE_STATES];
    float third[N_Q];
    float fourth[N_Q];
    float e[PVID_REFINE_OUTPUTS];
    advanced(self->state, second, 0.5f * h, at);
    accelerations(self->constants, at, signals->middle, third);
    advanced(self->state, third, h, at);
    accelerations(self->constants, at, signals->end, fourth);
    PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
    {
        const float mean = second[i] + third[i];
        self->state[i] += (h / 6.0f) * ((self->slope[i] + (2.0f * mean)) + fourth[i]);
    }
    self->part++;
    if (self->part < self->parts) {
        return;
    }
    divide(self, signals->end);
#if PVID_REFINE_SKEW
    accelerations(self->constants, self->state, signals->end, third);
    renew(self, third);
#endif
    residuals(self, r, self->state, signals->end, signals->z, e);
    add_residuals(self, e);
    self->at++;
}

/* Behind a big step. */
static inline void end_steps(pvid_refine_pass_f32 *self)
{
    memset(self->kick, 0, sizeof self->kick);
}

/* The next step's first job. */
static uint8_t job_of_step(const pvid_refine_pass_f32 *self)
{
    (void)self;
    return SLOPES;
}

static uint8_t job_behind_step(const pvid_refine_pass_f32 *self)
{
    return ((self->part == 0u) && (self->at == (uint8_t)PVID_REFINE_SUB)) ? (uint8_t)KICK : (uint8_t)SLOPES;
}

/* START and SLOPES. */
static inline void first_steps(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    if (self->job == (uint8_t)START) {
        start(self, r, signals);
    } else {
        slopes(self, r, signals);
    }
}

/* The kick's jobs: the factor over a short time, doubled up to the big step, applied. */
static inline void kick_job(pvid_refine_pass_f32 *self)
{
    switch (self->job) {
    case KICK:
        self->doubled = DOUBLED;
        make_factor(self->kick, ((float)PVID_REFINE_SUB * self->h) / (float)self->doubled, self->factor);
        self->job = DOUBLE;
        break;
    case DOUBLE:
        double_factor(self);
        self->doubled = (uint16_t)(self->doubled / 2u);
        self->job = (self->doubled > 1u) ? (uint8_t)DOUBLE : (uint8_t)SPREAD;
        break;
    default:
        spread(self->kick, self->factor);
        self->job = COLUMNS;
        break;
    }
}

/* Signals of a job, `entry`: the last one that it needs. Of a part of a step its first half takes the inputs at the
 * beginning and the middle, its other half those at the middle and the end, and the outputs. */
static inline void read_signals(const pvid_refine_pass_f32 *self, const pvid_refine_front_f32 *front, uint32_t entry,
                                pvid_refine_signals_f32 *signals)
{
    const uint32_t begin = entry - 2u; /* of the step */
    const float part = 1.0f / (float)self->parts;
    const float from = (float)self->part * part;
    const float to = (float)(self->part + 1u) * part;
    switch (self->job) {
    case START:
        pvid_refine_front_read_f32(front, entry, signals);
        break;
    case SLOPES:
        pvid_refine_front_between_f32(front, begin, from, signals->u);
        pvid_refine_front_between_f32(front, begin, 0.5f * (from + to), signals->middle);
        break;
    default:
        pvid_refine_front_between_f32(front, begin, 0.5f * (from + to), signals->middle);
        pvid_refine_front_between_f32(front, begin, to, signals->end);
        pvid_refine_front_outputs_f32(front, entry - 1u, signals->z);
        break;
    }
}

#endif

#endif
