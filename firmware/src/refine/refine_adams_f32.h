/* Steps of Adams: Adams-Bashforth-Nystroem of order 7 predicts from backward differences, one evaluation a step; the
 * seventh difference corrects prediction to Adams-Moulton's of order 8. The first six steps of a block are three double
 * steps of Runge-Kutta (order 4), their middles quintic Hermite polynomials. One Jacobian at the middle of a big step.
 * A part of refine_pass_f32.c. */
#ifndef PVID_REFINE_ADAMS_F32_H
#define PVID_REFINE_ADAMS_F32_H

#include <stddef.h>
#include <string.h>

#include "refine/refine_kick_f32.h"
#include "refine/refine_motion_f32.h"

#if !PVID_REFINE_RUNGE_KUTTA

#define AB PVID_REFINE_AB
#define STARTS 3u /* double steps */

/* Jobs of a pass. START once; MEAN to END are Runge-Kutta's over two steps. */
enum { CLEAR, START, MEAN, MEAN_AGAIN, FULL, END, STEP, KICK, COLUMNS, MORE_COLUMNS, ROWS, MORE_ROWS };

/* Steps from that of a job to the one whose signals it needs. */
static const uint8_t pvid_refine_ahead[] = {0, 0, 1, 1, 2, 2, 1};

/* Weights of the backward differences in the change of the position (h^2) and of the velocity (h); the last one's is
 * that of the corrector. */
#if PVID_REFINE_ORDER == 2
static const float of_position[AB + 1] = {1.0f / 2.0f,  1.0f / 6.0f,       1.0f / 8.0f,      19.0f / 180.0f,
                                          3.0f / 32.0f, 863.0f / 10080.0f, 275.0f / 3456.0f, 33953.0f / 453600.0f};
#endif
static const float of_velocity[AB + 1] = {
    1.0f,           1.0f / 2.0f,         5.0f / 12.0f,      3.0f / 8.0f, 251.0f / 720.0f,
    95.0f / 288.0f, 19087.0f / 60480.0f, 5257.0f / 17280.0f};

static inline void begin_steps(pvid_refine_pass_f32 *self, const pvid_refine_steps_f32 *steps)
{
    (void)steps;
    self->starts = STARTS;
}

static inline void clear_steps(pvid_refine_pass_f32 *self)
{
    memset(self->difference, 0, sizeof self->difference);
}

PVID_NOINLINE static void predict(pvid_refine_pass_f32 *self)
{
    const float h = self->h;
    PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
    {
        const float *difference = self->difference[i];
        float velocity = of_velocity[AB - 1] * difference[AB - 1];
#if PVID_REFINE_ORDER == 2
        float position = of_position[AB - 1] * difference[AB - 1];
#endif
        PVID_UNROLL for (size_t k = AB - 1; k > 0u; k--)
        {
            velocity += of_velocity[k - 1u] * difference[k - 1u];
#if PVID_REFINE_ORDER == 2
            position += of_position[k - 1u] * difference[k - 1u];
#endif
        }
#if PVID_REFINE_ORDER == 2
        self->state[i] += h * (self->state[RATES + i] + (h * position));
#endif
        self->state[RATES + i] += h * velocity;
    }
}

/* New accelerations `a`: the differences, and at a predicted state its correction. */
PVID_ALWAYS_INLINE void renew(pvid_refine_pass_f32 *self, const float a[], bool corrects)
{
    const float h = self->h;
    PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
    {
        float *difference = self->difference[i];
        float newest = a[i];
        PVID_UNROLL for (size_t k = 0; k < AB; k++)
        {
            const float before = difference[k];
            difference[k] = newest;
            newest -= before;
        }
        if (corrects) {
            const float kick = h * newest;
#if PVID_REFINE_ORDER == 2
            self->state[i] += (h * of_position[AB]) * kick;
#endif
            self->state[RATES + i] += of_velocity[AB] * kick;
        }
    }
}

/* A state with the rate k, h after x. */
static void advanced(const float x[], const float rates[], const float k[], float h, float out[])
{
    for (size_t i = 0; i < N_Q; i++) {
#if PVID_REFINE_ORDER == 2
        out[i] = x[i] + (h * rates[i]);
#else
        (void)rates;
#endif
        out[RATES + i] = x[RATES + i] + (h * k[i]);
    }
}

/* Runge-Kutta over 2 h: the first two slopes at its middle. scratch: k1, k2. */
static void mean_slope(pvid_refine_pass_f32 *self, const float u[])
{
    const float h = self->h; /* half of the double step */
    const bool again = self->job == (uint8_t)MEAN_AGAIN;
    const float *x = self->state;
    float at[PVID_REFINE_STATES];
    float rates[N_Q];
    float k0[N_Q];
    for (size_t i = 0; i < N_Q; i++) {
        k0[i] = self->difference[i][0];
        rates[i] = again ? (x[RATES + i] + (h * k0[i])) : x[RATES + i];
    }
    advanced(x, rates, again ? self->scratch[0] : k0, h, at);
    accelerations(self->constants, at, u, self->scratch[again ? 1 : 0]);
}

/* The slope k3 at its end, behind k1. */
static void full_slope(pvid_refine_pass_f32 *self, const float u[])
{
    const float h = self->h;
    const float *x = self->state;
    float at[PVID_REFINE_STATES];
    float rates[N_Q];
    for (size_t i = 0; i < N_Q; i++) {
        rates[i] = x[RATES + i] + (h * self->scratch[0][i]);
    }
    advanced(x, rates, self->scratch[1], 2.0f * h, at);
    accelerations(self->constants, at, u, self->slope);
}

/* Its end. scratch: the state at the end, the state at the middle. */
static void end_double(pvid_refine_pass_f32 *self, const float u[])
{
    const float h2 = 2.0f * self->h;
    const float *x = self->state;
    float at[PVID_REFINE_STATES];
    float end[PVID_REFINE_STATES];
    float a[N_Q];
    float *middle = self->scratch[1];
    for (size_t i = 0; i < N_Q; i++) {
        const float k0 = self->difference[i][0];
        const float mean = self->scratch[0][i] + self->scratch[1][i];
#if PVID_REFINE_ORDER == 2
        at[i] = h2 * (x[RATES + i] + ((h2 / 6.0f) * (k0 + mean)));
        end[i] = x[i] + at[i];
#endif
        at[RATES + i] = (h2 / 6.0f) * ((k0 + (2.0f * mean)) + self->slope[i]);
        end[RATES + i] = x[RATES + i] + at[RATES + i];
    }
    accelerations(self->constants, end, u, a);
    for (size_t i = 0; i < N_Q; i++) {
        const float k0 = self->difference[i][0];
#if PVID_REFINE_ORDER == 2
        middle[i] =
            ((x[i] + (0.5f * at[i])) - ((h2 * 0.15625f) * at[RATES + i])) + (((h2 * h2) * 0.015625f) * (k0 + a[i]));
        middle[RATES + i] =
            (((1.875f * at[i]) / h2) - (0.4375f * (x[RATES + i] + end[RATES + i]))) + ((h2 * 0.03125f) * (a[i] - k0));
#else
        middle[i] = (x[i] + (0.5f * at[i])) + ((h2 * 0.125f) * (k0 - a[i]));
#endif
    }
    memcpy(self->scratch[0], end, sizeof end);
}

/* What the columns need, at the middle of the big step; `a`: the accelerations there. */
PVID_NOINLINE static void differentiate(pvid_refine_pass_f32 *self, const float r[], const float u[], float a[])
{
    const float *x = self->state;
    pvid_refine_jacobian(self->constants, x, &x[RATES], u, a, self->kick, &self->kick[N_Q * RATES],
                         &self->kick[N_Q * PVID_REFINE_STATES]);
#if !PVID_REFINE_OUTPUT_LINEAR
    output_derivatives(self, r, x, u, self->output_column);
#else
    (void)r;
#endif
}

/* The first accelerations of a block, and the residuals there. */
static void start(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    float a[N_Q];
    accelerations(self->constants, self->state, signals->u, a);
    for (size_t i = 0; i < N_Q; i++) {
        self->difference[i][0] = a[i];
    }
    residuals(self, r, self->state, signals->u, signals->z, self->last);
}

/* A step: of Adams-Bashforth, or the first or second one behind Runge-Kutta; `signals` are those of its end. At the
 * middle of a big step the derivatives are needed: there the work is longest, and the state has been moved there by the
 * job before. */
PVID_NOINLINE static void step(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    const bool middle = self->at == (uint8_t)(MIDDLE - 1);
    const bool started = self->starts == 0u;
    const float *x = self->state;
    float a[N_Q];
    float e[PVID_REFINE_OUTPUTS];
    if (started) {
        if (!middle) {
            predict(self);
        }
    } else if ((self->at & 1u) != 0u) {
        memcpy(self->state, self->scratch[0], sizeof self->state);
        self->starts--;
    } else {
        x = self->scratch[1];
    }
    if (middle) {
        differentiate(self, r, signals->u, a);
    } else {
        accelerations(self->constants, x, signals->u, a);
    }
    renew(self, a, started);
    residuals(self, r, x, signals->u, signals->z, e);
    add_residuals(self, e);
#if PVID_REFINE_SKEW
    if (middle) {
        slip(self, r, signals->u);
    }
#endif
    self->at++;
    if (started && (self->at == (uint8_t)(MIDDLE - 1))) {
        predict(self);
    }
}

/* Behind a big step. */
static inline void end_steps(pvid_refine_pass_f32 *self)
{
    (void)self;
}

/* The next step's first job. */
static uint8_t job_of_step(const pvid_refine_pass_f32 *self)
{
    return ((self->starts > 0u) && ((self->at & 1u) == 0u)) ? (uint8_t)MEAN : (uint8_t)STEP;
}

static uint8_t job_behind_step(const pvid_refine_pass_f32 *self)
{
    if (self->at == (uint8_t)MIDDLE) {
        return KICK;
    }
    return (self->at == (uint8_t)PVID_REFINE_SUB) ? (uint8_t)COLUMNS : job_of_step(self);
}

/* The jobs of a block's beginning, behind CLEAR. */
static inline void first_steps(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    switch (self->job) {
    case START:
        start(self, r, signals);
        break;
    case FULL:
        full_slope(self, signals->u);
        break;
    case END:
        end_double(self, signals->u);
        break;
    default:
        mean_slope(self, signals->u);
        break;
    }
}

/* The kick's jobs. */
static inline void kick_job(pvid_refine_pass_f32 *self)
{
    make_kick(self);
    self->job = job_of_step(self);
}

/* Signals of a job, `entry`: the last one that it needs. */
static inline void read_signals(const pvid_refine_pass_f32 *self, const pvid_refine_front_f32 *front, uint32_t entry,
                                pvid_refine_signals_f32 *signals)
{
    (void)self;
    pvid_refine_front_read_f32(front, entry, signals);
}

#endif

#endif
