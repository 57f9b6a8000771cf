/* The motion of a block and its residuals, whatever its steps are. A part of refine_pass_f32.c. */
#ifndef PVID_REFINE_MOTION_F32_H
#define PVID_REFINE_MOTION_F32_H

#include <stddef.h>

#include "number/unroll.h"
#include "refine/refine_front_f32.h"
#include "refine_model_f32.h"

#define N_Q PVID_REFINE_COORDINATES
#define RATES (PVID_REFINE_STATES - N_Q) /* place of the rates in the state; without rates any place */
#define MIDDLE (PVID_REFINE_SUB / 2)

/* Accelerations without derivatives, out of line: one copy of the model. */
PVID_NOINLINE static void accelerations(const float m[], const float state[], const float u[], float a[])
{
    pvid_refine_motion(m, state, &state[RATES], u, a);
}

/* Residuals of a state whose accelerations are the newest ones. */
PVID_ALWAYS_INLINE void residuals(pvid_refine_pass_f32 *self, const float r[], const float state[], const float u[],
                                  const float measured[], float e[])
{
    float z[PVID_REFINE_OUTPUTS];
#if PVID_REFINE_SKEW
    float late[PVID_REFINE_STATES];
    const float *skew = self->skew;
    PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
    {
        const float a = self->difference[i][0];
        const float jerk = self->difference[i][1];
#if PVID_REFINE_ORDER == 2
        late[RATES + i] = state[RATES + i] + (skew[0] * a);
        late[i] = state[i] + ((skew[0] * state[RATES + i]) + ((skew[1] * a) + (skew[2] * jerk)));
#else
        late[i] = state[i] + ((skew[0] * a) + ((skew[1] / self->h) * jerk));
#endif
    }
#else
    const float *late = state;
#endif
    pvid_refine_output(self->constants, r, late, &late[RATES], u, z);
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++)
    {
#if PVID_REFINE_TURNING
        e[i] = pvid_refine_turned(measured[i] - z[i], self->turn[i]);
#else
        e[i] = measured[i] - z[i];
#endif
    }
}

/* By trapezoids. */
PVID_ALWAYS_INLINE void add_residuals(pvid_refine_pass_f32 *self, const float e[])
{
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++)
    {
        self->mean[i] += 0.5f * (self->last[i] + e[i]);
        self->last[i] = e[i];
    }
}

#if PVID_REFINE_STILL > 0
#define OF_STILL (PVID_REFINE_OUTPUTS * PVID_REFINE_STATES)
#else
#define OF_STILL 0 /* there are none: nothing is written */
#endif

/* dz/dq, dz/dv, dz/dr of the entries that do not move, each [output][entry]. */
PVID_ALWAYS_INLINE void output_derivatives(const pvid_refine_pass_f32 *self, const float r[], const float x[],
                                           const float u[], float derivatives[])
{
    pvid_refine_output_jacobian(self->constants, r, x, &x[RATES], u, derivatives,
                                &derivatives[PVID_REFINE_OUTPUTS * RATES], &derivatives[OF_STILL]);
}

#if PVID_REFINE_SKEW
/* Derivative of output i by the skew, from those by the coordinates and their rates. */
PVID_ALWAYS_INLINE float slip_of(const pvid_refine_pass_f32 *self, const float derivatives[], size_t i)
{
    float sum = 0.0f;
    PVID_UNROLL for (size_t k = 0; k < N_Q; k++)
    {
        const float a = self->difference[k][0];
#if PVID_REFINE_ORDER == 2
        sum += derivatives[(i * N_Q) + k] * (self->state[RATES + k] + (self->skew[0] * a));
#else
        sum += derivatives[(i * N_Q) + k] * a;
#endif
#if PVID_REFINE_OUTPUT_RATES
        sum += derivatives[((PVID_REFINE_OUTPUTS + i) * N_Q) + k] * a;
#endif
    }
    return sum;
}

/* Derivatives of the outputs by the skew, at the middle of the big step. */
PVID_ALWAYS_INLINE void slip(pvid_refine_pass_f32 *self, const float r[], const float u[])
{
#if PVID_REFINE_OUTPUT_LINEAR
    float derivatives[PVID_REFINE_OUTPUTS * (PVID_REFINE_STATES + PVID_REFINE_STILL)];
    output_derivatives(self, r, self->state, u, derivatives); /* constants */
#else
    const float *derivatives = self->output_column;
    (void)r;
    (void)u;
#endif
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++)
    {
        self->slip[i] = slip_of(self, derivatives, i);
    }
}
#endif

#endif
