#include "number/uncontracted.h"

/* Motion: Adams-Bashforth-Nystroem of order 7 predicts from backward differences, one evaluation a step; the seventh
 * difference corrects prediction to Adams-Moulton's of order 8. The first six steps of a block are three double steps
 * of Runge-Kutta (order 4), their middles quintic Hermite polynomials.
 * Derivatives of the motion: leapfrog over four steps (drift, kick, drift) with one Jacobian at the middle; K replaced
 * by K + H^2/12 K^2, which gives the modes their frequencies. Their errors cost efficiency, not bias. Rows: the
 * residuals' mean over those steps by trapezoids, the columns at their middle. Outputs are those of the motion `skew`
 * seconds later, by its derivatives. */
#include "refine/refine_pass_f32.h"

#include <stddef.h>
#include <string.h>

#include "number/unroll.h"
#include "refine/refine_front_f32.h"
#include "refine_model_f32.h"

#define N_Q PVID_REFINE_COORDINATES
#define V (PVID_REFINE_STATES - N_Q) /* place of the rates in the state; without rates any place */
#define AB PVID_REFINE_AB
#define MIDDLE (PVID_REFINE_SUB / 2)

/* Jobs of a pass. START once; MEAN to END are Runge-Kutta's over two steps. */
enum { CLEAR, START, MEAN, MEAN_AGAIN, FULL, END, STEP, KICK, COLUMNS, MORE_COLUMNS, ROWS, MORE_ROWS };

#define STARTS 3u /* double steps */

/* Columns of the first of two jobs, and rows of the sums. */
#define HALF_OF_COLUMNS ((PVID_REFINE_COLUMNS + 1) / 2)
#define PART_OF_SUMS (PVID_REFINE_WIDTH / 3)
#define SUMS_BEFORE ((PART_OF_SUMS * ((2 * PVID_REFINE_WIDTH) + 1 - PART_OF_SUMS)) / 2)

/* Weights of the backward differences in the change of the position (h^2) and of the velocity (h); the last one's is
 * that of the corrector. */
#if PVID_REFINE_ORDER == 2
static const float of_position[AB + 1] = {1.0f / 2.0f,  1.0f / 6.0f,       1.0f / 8.0f,      19.0f / 180.0f,
                                          3.0f / 32.0f, 863.0f / 10080.0f, 275.0f / 3456.0f, 33953.0f / 453600.0f};
#endif
static const float of_velocity[AB + 1] = {
    1.0f,           1.0f / 2.0f,         5.0f / 12.0f,      3.0f / 8.0f, 251.0f / 720.0f,
    95.0f / 288.0f, 19087.0f / 60480.0f, 5257.0f / 17280.0f};

PVID_COLD void pvid_refine_pass_begin_f32(pvid_refine_pass_f32 *self, const float r[], const float start[], float h,
                                          float gate)
{
    self->h = h;
    self->gate = gate;
#if PVID_REFINE_SKEW
    const float skew = r[PVID_REFINE_MOVING];
    self->skew[0] = skew;
    self->skew[1] = (0.5f * skew) * skew;
    self->skew[2] = (self->skew[1] * skew) / (3.0f * h);
#endif
    pvid_refine_constants(r, self->constants);
    memcpy(self->state, start, sizeof self->state);
    self->job = CLEAR;
    self->at = 0;
    self->rows = 0;
    self->starts = STARTS;
    self->step = 0;
    self->used = 0;
}

static void clear(pvid_refine_pass_f32 *self)
{
    memset(self->difference, 0, sizeof self->difference);
    memset(self->column, 0, sizeof self->column);
    memset(self->sums.sum, 0, sizeof self->sums.sum);
    for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
        self->column[i][i] = 1.0f;
    }
    for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++) {
        self->mean[i] = 0.0f;
    }
}

/* ---- the motion ---- */

PVID_SELDOM static void predict(pvid_refine_pass_f32 *self)
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
        self->state[i] += h * (self->state[V + i] + (h * position));
#endif
        self->state[V + i] += h * velocity;
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
            self->state[V + i] += of_velocity[AB] * kick;
        }
    }
}

/* Accelerations without derivatives, out of line: one copy of the model. */
PVID_SELDOM static void accelerations(const float m[], const float state[], const float u[], float a[])
{
    pvid_refine_motion(m, state, &state[V], u, a);
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
        out[V + i] = x[V + i] + (h * k[i]);
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
        rates[i] = again ? (x[V + i] + (h * k0[i])) : x[V + i];
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
        rates[i] = x[V + i] + (h * self->scratch[0][i]);
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
        at[i] = h2 * (x[V + i] + ((h2 / 6.0f) * (k0 + mean)));
        end[i] = x[i] + at[i];
#endif
        at[V + i] = (h2 / 6.0f) * ((k0 + (2.0f * mean)) + self->slope[i]);
        end[V + i] = x[V + i] + at[V + i];
    }
    accelerations(self->constants, end, u, a);
    for (size_t i = 0; i < N_Q; i++) {
        const float k0 = self->difference[i][0];
#if PVID_REFINE_ORDER == 2
        middle[i] = ((x[i] + (0.5f * at[i])) - ((h2 * 0.15625f) * at[V + i])) + (((h2 * h2) * 0.015625f) * (k0 + a[i]));
        middle[V + i] =
            (((1.875f * at[i]) / h2) - (0.4375f * (x[V + i] + end[V + i]))) + ((h2 * 0.03125f) * (a[i] - k0));
#else
        middle[i] = (x[i] + (0.5f * at[i])) + ((h2 * 0.125f) * (k0 - a[i]));
#endif
    }
    memcpy(self->scratch[0], end, sizeof end);
}

/* Residuals of a state whose accelerations are the newest ones. */
PVID_ALWAYS_INLINE void residuals(pvid_refine_pass_f32 *self, const float r[], const float state[],
                                  const pvid_refine_signals_f32 *signals, float e[])
{
    float z[PVID_REFINE_OUTPUTS];
#if PVID_REFINE_SKEW
    float late[PVID_REFINE_STATES];
    const float *skew = self->skew;
    PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
    {
        const float a = self->difference[i][0];
        const float jerk = self->difference[i][1];
        late[V + i] = state[V + i] + (skew[0] * a);
        late[i] = state[i] + ((skew[0] * state[V + i]) + ((skew[1] * a) + (skew[2] * jerk)));
    }
#else
    const float *late = state;
#endif
    pvid_refine_output(self->constants, r, late, &late[V], signals->u, z);
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++)
    {
        e[i] = signals->z[i] - z[i];
    }
}

#if PVID_REFINE_ORDER == 2

/* An entry of x + H/2 D x. */
PVID_ALWAYS_INLINE float damped(const float D[], float half, const float x[], size_t row)
{
    float sum = D[row * N_Q] * x[0];
    PVID_UNROLL for (size_t k = 1; k < N_Q; k++)
    {
        sum += D[(row * N_Q) + k] * x[k];
    }
    return x[row] + (half * sum);
}

/* H (I + H/2 D) times K + H^2/12 K^2, D and B: the kick's mean velocity is that of the middle. */
static void make_kick(pvid_refine_pass_f32 *self)
{
    const float big = (float)PVID_REFINE_SUB * self->h;
    const float half = 0.5f * big;
    const float g = (big * big) * (1.0f / 12.0f);
    float *kick = self->kick;
    float K[N_Q * N_Q];
    float D[N_Q * N_Q];
    PVID_UNROLL for (size_t i = 0; i < (size_t)(N_Q * N_Q); i++)
    {
        K[i] = kick[i];
        D[i] = kick[(N_Q * N_Q) + i];
    }
    PVID_UNROLL for (size_t j = 0; j < N_Q; j++)
    {
        float of_q[N_Q];
        float of_v[N_Q];
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            float square = K[i * N_Q] * K[j];
            PVID_UNROLL for (size_t k = 1; k < N_Q; k++)
            {
                square += K[(i * N_Q) + k] * K[(k * N_Q) + j];
            }
            of_q[i] = big * (K[(i * N_Q) + j] + (g * square));
            of_v[i] = big * D[(i * N_Q) + j];
        }
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            kick[(i * N_Q) + j] = damped(D, half, of_q, i);
            kick[(N_Q * N_Q) + (i * N_Q) + j] = damped(D, half, of_v, i);
        }
    }
    PVID_UNROLL for (size_t j = 0; j < PVID_REFINE_MOVING; j++)
    {
        float of_r[N_Q];
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            of_r[i] = big * kick[(2 * N_Q * N_Q) + (j * N_Q) + i];
        }
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            kick[(2 * N_Q * N_Q) + (j * N_Q) + i] = damped(D, half, of_r, i);
        }
    }
}

#else

/* F = H (1 + HK/2 (1 + HK/3 (1 + HK/4))), then F K and F B: the columns' change over a big step with a constant K. */
static void make_kick(pvid_refine_pass_f32 *self)
{
    const float big = (float)PVID_REFINE_SUB * self->h;
    float factor[N_Q][N_Q] = {{0.0f}};
    float next[N_Q][N_Q];
    float K[N_Q * N_Q];
    memcpy(K, self->kick, sizeof K);
    for (size_t i = 0; i < N_Q; i++) {
        factor[i][i] = 1.0f;
    }
    for (size_t n = 4; n > 1u; n--) {
        const float part = big / (float)n;
        for (size_t i = 0; i < N_Q; i++) {
            for (size_t j = 0; j < N_Q; j++) {
                float sum = K[i * N_Q] * factor[0][j];
                for (size_t k = 1; k < N_Q; k++) {
                    sum += K[(i * N_Q) + k] * factor[k][j];
                }
                next[i][j] = (part * sum) + ((i == j) ? 1.0f : 0.0f);
            }
        }
        memcpy(factor, next, sizeof factor);
    }
    for (size_t i = 0; i < N_Q; i++) {
        for (size_t j = 0; j < N_Q; j++) {
            float sum = factor[i][0] * K[j];
            for (size_t k = 1; k < N_Q; k++) {
                sum += factor[i][k] * K[(k * N_Q) + j];
            }
            self->kick[(i * N_Q) + j] = big * sum;
        }
    }
    for (size_t j = 0; j < PVID_REFINE_MOVING; j++) {
        float *of_r = &self->kick[(N_Q * N_Q) + (j * N_Q)];
        float B[N_Q];
        memcpy(B, of_r, sizeof B);
        for (size_t i = 0; i < N_Q; i++) {
            float sum = factor[i][0] * B[0];
            for (size_t k = 1; k < N_Q; k++) {
                sum += factor[i][k] * B[k];
            }
            of_r[i] = big * sum;
        }
    }
}

#endif

/* dz/dq, dz/dv, dz/dr of the entries that do not move, each [output][entry]. */
PVID_ALWAYS_INLINE void output_derivatives(const pvid_refine_pass_f32 *self, const float r[], const float x[],
                                           const float u[], float derivatives[])
{
    pvid_refine_output_jacobian(self->constants, r, x, &x[V], u, derivatives, &derivatives[PVID_REFINE_OUTPUTS * V],
                                &derivatives[PVID_REFINE_OUTPUTS * PVID_REFINE_STATES]);
}

/* What the columns need, at the middle of the big step; `a`: the accelerations there. */
PVID_SELDOM static void differentiate(pvid_refine_pass_f32 *self, const float r[], const float u[], float a[])
{
    const float *x = self->state;
    pvid_refine_jacobian(self->constants, x, &x[V], u, a, self->kick, &self->kick[N_Q * V],
                         &self->kick[N_Q * PVID_REFINE_STATES]);
#if !PVID_REFINE_OUTPUT_LINEAR
    output_derivatives(self, r, x, u, self->output_column);
#else
    (void)r;
#endif
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
        sum += derivatives[(i * N_Q) + k] * (self->state[V + k] + (self->skew[0] * a));
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

/* The first accelerations of a block, and the residuals there. */
static void start(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    float a[N_Q];
    accelerations(self->constants, self->state, signals->u, a);
    for (size_t i = 0; i < N_Q; i++) {
        self->difference[i][0] = a[i];
    }
    residuals(self, r, self->state, signals, self->last);
}

/* A step: of Adams-Bashforth, or the first or second one behind Runge-Kutta; `signals` are those of its end. At the
 * middle of a big step the derivatives are needed: there the work is longest, and the state has been moved there by the
 * job before. */
PVID_SELDOM static void step(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
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
    residuals(self, r, x, signals, e);
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++)
    {
        self->mean[i] += 0.5f * (self->last[i] + e[i]);
        self->last[i] = e[i];
    }
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

/* ---- columns and rows ---- */

/* An entry of the rows of a big step: the outputs' derivatives by an unknown, whose column is `x` at the middle. */
PVID_ALWAYS_INLINE void entries(float row[][PVID_REFINE_WIDTH], size_t column, const float x[],
                                const float derivatives[], const float weight[])
{
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++)
    {
        const float *of_q = &derivatives[i * N_Q];
        float sum = of_q[0] * x[0];
        PVID_UNROLL for (size_t k = 1; k < N_Q; k++)
        {
            sum += of_q[k] * x[k];
        }
#if PVID_REFINE_OUTPUT_RATES
        const float *of_v = &derivatives[(PVID_REFINE_OUTPUTS + i) * N_Q];
        PVID_UNROLL for (size_t k = 0; k < N_Q; k++)
        {
            sum += of_v[k] * x[N_Q + k];
        }
#endif
        row[i][column] = (i == 0u) ? sum : (weight[i] * sum);
    }
}

/* The columns over a big step, and their entries in the rows. */
#if PVID_REFINE_ORDER == 2
PVID_ALWAYS_INLINE void columns(pvid_refine_pass_f32 *self, size_t first, size_t end, const float derivatives[],
                                const float weight[])
{
    float (*row)[PVID_REFINE_WIDTH] = &self->row[self->rows];
    const float half = (0.5f * (float)PVID_REFINE_SUB) * self->h;
#if PVID_REFINE_SKEW
    const float late = half + self->skew[0];
#endif
    float kick[2 * N_Q * N_Q];
    PVID_UNROLL for (size_t i = 0; i < (size_t)(2 * N_Q * N_Q); i++)
    {
        kick[i] = self->kick[i];
    }
    PVID_UNROLL for (size_t j = first; j < end; j++)
    {
        float *s = self->column[j];
        float x[PVID_REFINE_STATES];
        float next[N_Q];
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            x[i] = s[i] + (half * s[N_Q + i]);
        }
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            float sum = s[N_Q + i];
            PVID_UNROLL for (size_t k = 0; k < N_Q; k++)
            {
                sum += kick[(i * N_Q) + k] * x[k];
            }
            PVID_UNROLL for (size_t k = 0; k < N_Q; k++)
            {
                sum += kick[(N_Q * N_Q) + (i * N_Q) + k] * s[N_Q + k];
            }
            if (j >= PVID_REFINE_STATES) {
                sum += self->kick[(2 * N_Q * N_Q) + ((j - PVID_REFINE_STATES) * N_Q) + i];
            }
            next[i] = sum;
        }
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            const float rate = s[N_Q + i];
            const float twice = rate + next[i];
            x[N_Q + i] = 0.5f * twice;
#if PVID_REFINE_SKEW
            x[i] = s[i] + (late * rate); /* the kick between the middle and the skew is left out */
#endif
            s[i] += half * twice;
            s[N_Q + i] = next[i];
        }
        entries(row, j, x, derivatives, weight);
    }
}
#else
PVID_ALWAYS_INLINE void columns(pvid_refine_pass_f32 *self, size_t first, size_t end, const float derivatives[],
                                const float weight[])
{
    float (*row)[PVID_REFINE_WIDTH] = &self->row[self->rows];
    for (size_t j = first; j < end; j++) {
        float *s = self->column[j];
        float x[PVID_REFINE_STATES];
        float change[N_Q];
        for (size_t i = 0; i < N_Q; i++) {
            float sum =
                (j >= PVID_REFINE_STATES) ? self->kick[(N_Q * N_Q) + ((j - PVID_REFINE_STATES) * N_Q) + i] : 0.0f;
            for (size_t k = 0; k < N_Q; k++) {
                sum += self->kick[(i * N_Q) + k] * s[k];
            }
            change[i] = sum;
        }
        for (size_t i = 0; i < N_Q; i++) {
            x[i] = s[i] + (0.5f * change[i]);
            s[i] += change[i];
        }
        entries(row, j, x, derivatives, weight);
    }
}
#endif

/* The other entries of the rows of a big step. A row without residual, or beyond the gate, is 0. */
PVID_ALWAYS_INLINE void end_rows(pvid_refine_pass_f32 *self, const float derivatives[], const float weight[])
{
    for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++) {
        float *row = self->row[self->rows + i];
#if PVID_REFINE_SKEW
        row[PVID_REFINE_COLUMNS] = (i == 0u) ? self->slip[0] : (weight[i] * self->slip[i]);
#endif
#if PVID_REFINE_STILL
        float *still = &row[PVID_REFINE_COLUMNS + PVID_REFINE_SKEW];
        for (size_t j = 0; j < PVID_REFINE_STILL; j++) {
            const float entry = derivatives[(PVID_REFINE_OUTPUTS * PVID_REFINE_STATES) + (i * PVID_REFINE_STILL) + j];
            still[j] = (i == 0u) ? entry : (weight[i] * entry);
        }
#else
        (void)derivatives;
#endif
        const float mean = self->mean[i] * (1.0f / (float)PVID_REFINE_SUB);
        const float e = (i == 0u) ? mean : (weight[i] * mean);
        self->mean[i] = 0.0f;
        row[PVID_REFINE_WIDTH - 1] = e;
        if ((e >= -self->gate) && (e <= self->gate)) {
            self->used++;
        } else {
            memset(row, 0, sizeof self->row[0]);
        }
    }
    self->rows = (uint8_t)(self->rows + PVID_REFINE_OUTPUTS);
}

/* The end of a big step: the first columns, or the others and what completes the rows. */
PVID_SELDOM static void end_big_step(pvid_refine_pass_f32 *self, const float r[], const float weight[])
{
#if PVID_REFINE_OUTPUT_LINEAR
    float derivatives[PVID_REFINE_OUTPUTS * (PVID_REFINE_STATES + PVID_REFINE_STILL)];
    output_derivatives(self, r, self->state, self->state, derivatives); /* constants */
#else
    const float *derivatives = self->output_column;
    (void)r;
#endif
    if (self->job == (uint8_t)COLUMNS) {
        columns(self, 0, HALF_OF_COLUMNS, derivatives, weight);
        return;
    }
    columns(self, HALF_OF_COLUMNS, PVID_REFINE_COLUMNS, derivatives, weight);
    end_rows(self, derivatives, weight);
    self->at = 0;
    self->step++;
}

/* The rows into rows `first` to `end` - 1 of the sums. */
PVID_ALWAYS_INLINE void add_rows(pvid_refine_pass_f32 *self, float sum[], size_t first, size_t end)
{
    float *next = sum;
    PVID_UNROLL for (size_t i = first; i < end; i++)
    {
        float left[PVID_REFINE_ROWS];
        PVID_UNROLL for (size_t k = 0; k < PVID_REFINE_ROWS; k++)
        {
            left[k] = self->row[k][i];
        }
        PVID_UNROLL for (size_t j = i; j < PVID_REFINE_WIDTH; j++)
        {
            float products = left[0] * self->row[0][j];
            PVID_UNROLL for (size_t k = 1; k < PVID_REFINE_ROWS; k++)
            {
                products += left[k] * self->row[k][j];
            }
            *next += products;
            next++;
        }
    }
}

PVID_SELDOM static void add_first_rows(pvid_refine_pass_f32 *self)
{
    add_rows(self, self->sums.sum, 0, PART_OF_SUMS);
}

PVID_SELDOM static void add_other_rows(pvid_refine_pass_f32 *self)
{
    add_rows(self, &self->sums.sum[SUMS_BEFORE], PART_OF_SUMS, PVID_REFINE_WIDTH);
    self->rows = 0;
}

/* ---- jobs ---- */

/* Whether the next job needs signals. */
static inline bool needs(const pvid_refine_pass_f32 *self)
{
    return (self->job <= (uint8_t)STEP) && (self->job != (uint8_t)CLEAR);
}

/* Of which step. */
static inline uint32_t awaited(const pvid_refine_pass_f32 *self)
{
    static const uint8_t ahead[] = {0, 0, 1, 1, 2, 2, 1}; /* by job */
    return ((uint32_t)self->step * PVID_REFINE_SUB) + self->at + ahead[self->job];
}

static inline bool ends(const pvid_refine_pass_f32 *self, uint32_t length)
{
    return (self->step >= length) && (self->job <= (uint8_t)STEP);
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

/* The jobs of a block's beginning. */
PVID_COLD static void first_jobs(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    switch (self->job) {
    case CLEAR:
        clear(self);
        break;
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
    self->job++;
}

void pvid_refine_pass_job_f32(pvid_refine_pass_f32 *self, const float r[], const float weight[],
                              const pvid_refine_signals_f32 *signals)
{
    switch (self->job) {
    case STEP:
        step(self, r, signals);
        self->job = job_behind_step(self);
        break;
    case KICK:
        make_kick(self);
        self->job = job_of_step(self);
        break;
    case COLUMNS:
        end_big_step(self, r, weight);
        self->job = MORE_COLUMNS;
        break;
    case MORE_COLUMNS:
        end_big_step(self, r, weight);
        self->job = (self->rows == (uint8_t)PVID_REFINE_ROWS) ? (uint8_t)ROWS : job_of_step(self);
        break;
    case ROWS:
        add_first_rows(self);
        self->job = MORE_ROWS;
        break;
    case MORE_ROWS:
        add_other_rows(self);
        self->job = job_of_step(self);
        break;
    default:
        first_jobs(self, r, signals);
        break;
    }
}

pvid_refine_progress pvid_refine_pass_run_f32(pvid_refine_pass_f32 *self, const pvid_refine_front_f32 *front,
                                              const pvid_refine_block_f32 *block, uint32_t jobs)
{
    pvid_refine_signals_f32 signals;
    const int32_t end = (int32_t)(pvid_refine_front_end_f32(front) - block->begin);
    for (uint32_t left = jobs; left > 0u; left--) {
        if (needs(self)) {
            const uint32_t entry = awaited(self);
            if ((int32_t)entry >= end) {
                return PVID_REFINE_PASS_WAITS;
            }
            pvid_refine_front_read_f32(front, block->begin + entry, &signals);
        }
        pvid_refine_pass_job_f32(self, block->r, block->weight, &signals);
        if (ends(self, block->length)) {
            return PVID_REFINE_PASS_DONE;
        }
    }
    return PVID_REFINE_PASS_ON;
}

bool pvid_refine_pass_needs_f32(const pvid_refine_pass_f32 *self, uint32_t *step)
{
    *step = needs(self) ? awaited(self) : 0u;
    return needs(self);
}

bool pvid_refine_pass_ends_f32(const pvid_refine_pass_f32 *self, uint32_t length)
{
    return ends(self, length);
}
