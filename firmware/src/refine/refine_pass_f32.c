#include "number/uncontracted.h"

/* Motion: Adams-Bashforth-Nystroem of order 7 predicts, one evaluation a step; its seventh difference corrects
 * prediction to Adams-Moulton's of order 8. The first six steps of a block are three double
 * steps of Runge-Kutta (order 4), their middles quintic Hermite polynomials.
 * Derivatives of the motion: leapfrog over four steps (drift, kick, drift) with one Jacobian at the middle; K replaced
 * by K + H^2/12 K^2, which gives the modes their frequencies. Their errors cost efficiency, not bias. Rows: the
 * residuals' mean over those steps by trapezoids, the columns at their middle. */
#include "refine/refine_pass_f32.h"

#include <stddef.h>
#include <string.h>

#include "number/unroll.h"
#include "refine_model_f32.h"

#define N_Q PVID_REFINE_COORDINATES
#define V (PVID_REFINE_STATES - N_Q) /* place of the rates in the state; without rates any place */
#define AB PVID_REFINE_AB

/* Jobs of a pass, in their order; the first two of a pair of steps are those of Runge-Kutta alone, then one for each
 * step. */
enum { CLEAR, FIRST_A, FIRST_B, FIRST, MIDDLE, SECOND_A, SECOND_B, SECOND, END, COLUMNS, ROWS };

#define STARTS 3u /* double steps */

/* Weights of the last accelerations, latest first, on the position (h^2) and on the velocity (h); twice, so that a
 * circular buffer is read without wrapping. */
#define POSITION                                                                                                       \
    139849.0f / 120960.0f, -4511.0f / 2240.0f, 123133.0f / 40320.0f, -88547.0f / 30240.0f, 1537.0f / 896.0f,           \
        -11351.0f / 20160.0f, 275.0f / 3456.0f
#define VELOCITY                                                                                                       \
    198721.0f / 60480.0f, -18637.0f / 2520.0f, 235183.0f / 20160.0f, -10754.0f / 945.0f, 135713.0f / 20160.0f,         \
        -5603.0f / 2520.0f, 19087.0f / 60480.0f
#if PVID_REFINE_ORDER == 2
static const float position_weights[2 * AB] = {POSITION, POSITION};
#endif
static const float velocity_weights[2 * AB] = {VELOCITY, VELOCITY};

/* Weights of the last accelerations, latest first, in the seventh difference of the newest one; twice. Its weights in
 * the corrected position (h^2) and velocity (h). */
#define DIFFERENCE -7.0f, 21.0f, -35.0f, 35.0f, -21.0f, 7.0f, -1.0f
static const float difference_weights[2 * AB] = {DIFFERENCE, DIFFERENCE};
#define CORRECTED_POSITION (33953.0f / 453600.0f)
#define CORRECTED_VELOCITY (5257.0f / 17280.0f)

#if PVID_REFINE_SKEW
/* Weights of five steps that give a signal `skew` seconds after the middle one, and its derivative there: the
 * polynomial of degree 4 through them. */
static void delay(pvid_refine_pass_f32 *self, float skew)
{
    const float s = skew / self->h;
    const float z = s * s;
    const float scale = 1.0f / self->h;
    self->late[0] = ((s * (z - 1.0f)) * (s - 2.0f)) / 24.0f;
    self->late[1] = ((s * (s - 1.0f)) * (4.0f - z)) / 6.0f;
    self->late[2] = ((1.0f - z) * (4.0f - z)) * 0.25f;
    self->late[3] = ((s * (s + 1.0f)) * (4.0f - z)) / 6.0f;
    self->late[4] = ((s * (z - 1.0f)) * (s + 2.0f)) / 24.0f;
    self->slope[0] = (scale / 12.0f) * ((s * ((2.0f * z) - (3.0f * s))) - (s - 1.0f));
    self->slope[1] = (scale / 6.0f) * ((s * ((3.0f * s) - (4.0f * z))) + ((8.0f * s) - 4.0f));
    self->slope[2] = (scale * s) * ((2.0f * z) - 5.0f) * 0.5f;
    self->slope[3] = (scale / 6.0f) * ((4.0f + (8.0f * s)) - (s * ((3.0f * s) + (4.0f * z))));
    self->slope[4] = (scale / 12.0f) * ((s * ((2.0f * z) + (3.0f * s))) - (s + 1.0f));
}
#endif

void pvid_refine_pass_begin_f32(pvid_refine_pass_f32 *self, const float r[], const float start[], float h, float gate)
{
    self->h = h;
    self->gate = gate;
#if PVID_REFINE_SKEW
    delay(self, r[PVID_REFINE_MOVING - 1]);
#endif
    pvid_refine_constants(r, self->constants);
    memcpy(self->state, start, sizeof self->state);
    self->job = CLEAR;
    self->head = 0;
    self->rows = 0;
    self->starts = STARTS;
    self->step = 0;
    self->used = 0;
}

static void clear(pvid_refine_pass_f32 *self)
{
    memset(self->column, 0, sizeof self->column);
    memset(self->sum, 0, sizeof self->sum);
    for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
        self->column[i][i] = 1.0f;
    }
    for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++) {
        self->mean[i] = 0.0f;
    }
}

/* ---- the motion ---- */

PVID_SELDOM static void adams_bashforth(pvid_refine_pass_f32 *self)
{
    const float *of_velocity = &velocity_weights[AB - self->head];
    const float h = self->h;
    float velocity[N_Q] = {0.0f};
#if PVID_REFINE_ORDER == 2
    const float *of_position = &position_weights[AB - self->head];
    float position[N_Q] = {0.0f};
#endif
    PVID_UNROLL for (size_t j = 0; j < AB; j++)
    {
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
#if PVID_REFINE_ORDER == 2
            position[i] += of_position[j] * self->rate[i][j];
#endif
            velocity[i] += of_velocity[j] * self->rate[i][j];
        }
    }
    PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
    {
#if PVID_REFINE_ORDER == 2
        self->state[i] += h * (self->state[V + i] + (h * position[i]));
#endif
        self->state[V + i] += h * velocity[i];
    }
}

/* The accelerations `a` at the predicted state correct it. */
PVID_ALWAYS_INLINE void correct(pvid_refine_pass_f32 *self, const float a[])
{
    const float *weights = &difference_weights[AB - self->head];
    const float h = self->h;
    PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
    {
        float difference = a[i];
        PVID_UNROLL for (size_t j = 0; j < AB; j++)
        {
            difference += weights[j] * self->rate[i][j];
        }
        const float kick = h * difference;
#if PVID_REFINE_ORDER == 2
        self->state[i] += (h * CORRECTED_POSITION) * kick;
#endif
        self->state[V + i] += CORRECTED_VELOCITY * kick;
    }
}

PVID_ALWAYS_INLINE void push(pvid_refine_pass_f32 *self, const float a[])
{
    self->head = (uint8_t)((self->head == 0u) ? (AB - 1u) : (self->head - 1u));
    PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
    {
        self->rate[i][self->head] = a[i];
    }
}

/* Accelerations without derivatives, out of line: one copy of the model. */
PVID_SELDOM static void accelerations(const float m[], const float state[], const float u[], float a[])
{
    pvid_refine_motion(m, state, &state[V], u, a);
}

/* u at the time of the outputs; `at`: of the three steps. */
PVID_ALWAYS_INLINE void input(const pvid_refine_pass_f32 *self, const pvid_refine_signals_f32 *signals, size_t at,
                              float u[])
{
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_INPUTS; i++)
    {
#if PVID_REFINE_SKEW
        float sum = self->late[0] * signals->u[at][i];
        PVID_UNROLL for (size_t k = 1; k < PVID_REFINE_POINTS; k++)
        {
            sum += self->late[k] * signals->u[at + k][i];
        }
        u[i] = sum;
#else
        u[i] = signals->u[at][i];
        (void)self;
#endif
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
        out[V + i] = x[V + i] + (h * k[i]);
    }
}

/* Runge-Kutta over 2 h: its first half. scratch: k1, k2. */
static void first_half(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    const float h = self->h; /* half of the double step */
    const float *x = self->state;
    float u[PVID_REFINE_INPUTS];
    float at[PVID_REFINE_STATES];
    float rates[N_Q];
    float k0[N_Q];
    float *k1 = self->scratch[0];
    float *k2 = self->scratch[1];
    input(self, signals, 0, u);
    if (self->starts == STARTS) {
        float z[PVID_REFINE_OUTPUTS];
        accelerations(self->constants, x, u, k0);
        push(self, k0);
        pvid_refine_output(self->constants, r, x, &x[V], u, z);
        for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++) {
            self->last[i] = signals->z[0][i] - z[i];
        }
    }
    input(self, signals, 1, u);
    for (size_t i = 0; i < N_Q; i++) {
        k0[i] = self->rate[i][self->head];
        rates[i] = x[V + i] + (h * k0[i]);
    }
    advanced(x, &x[V], k0, h, at);
    accelerations(self->constants, at, u, k1);
    advanced(x, rates, k1, h, at);
    accelerations(self->constants, at, u, k2);
}

/* Its second half. scratch: the state at the end, the state at the middle. */
static void second_half(pvid_refine_pass_f32 *self, const pvid_refine_signals_f32 *signals)
{
    const float h = self->h;
    const float h2 = 2.0f * h;
    const float *x = self->state;
    float u[PVID_REFINE_INPUTS];
    float at[PVID_REFINE_STATES];
    float end[PVID_REFINE_STATES];
    float middle[PVID_REFINE_STATES];
    float rates[N_Q];
    float mean[N_Q];
    float k3[N_Q];
    float a[N_Q];
    input(self, signals, 2, u);
    for (size_t i = 0; i < N_Q; i++) {
        rates[i] = x[V + i] + (h * self->scratch[0][i]);
        mean[i] = self->scratch[0][i] + self->scratch[1][i];
    }
    advanced(x, rates, self->scratch[1], h2, at);
    accelerations(self->constants, at, u, k3);
    for (size_t i = 0; i < N_Q; i++) {
        const float k0 = self->rate[i][self->head];
#if PVID_REFINE_ORDER == 2
        at[i] = h2 * (x[V + i] + ((h2 / 6.0f) * (k0 + mean[i])));
        end[i] = x[i] + at[i];
#endif
        at[V + i] = (h2 / 6.0f) * ((k0 + (2.0f * mean[i])) + k3[i]);
        end[V + i] = x[V + i] + at[V + i];
    }
    accelerations(self->constants, end, u, a);
    for (size_t i = 0; i < N_Q; i++) {
        const float k0 = self->rate[i][self->head];
#if PVID_REFINE_ORDER == 2
        middle[i] = ((x[i] + (0.5f * at[i])) - ((h2 * 0.15625f) * at[V + i])) + (((h2 * h2) * 0.015625f) * (k0 + a[i]));
        middle[V + i] =
            (((1.875f * at[i]) / h2) - (0.4375f * (x[V + i] + end[V + i]))) + ((h2 * 0.03125f) * (a[i] - k0));
#else
        middle[i] = (x[i] + (0.5f * at[i])) + ((h2 * 0.125f) * (k0 - a[i]));
#endif
    }
    memcpy(self->scratch[0], end, sizeof end);
    memcpy(self->scratch[1], middle, sizeof middle);
}

/* Residuals at a step, into the mean. */
PVID_ALWAYS_INLINE void residuals(pvid_refine_pass_f32 *self, const float r[], const float state[], const float u[],
                                  const float measured[])
{
    float z[PVID_REFINE_OUTPUTS];
    pvid_refine_output(self->constants, r, state, &state[V], u, z);
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++)
    {
        const float e = measured[i] - z[i];
        self->mean[i] += 0.5f * (self->last[i] + e);
        self->last[i] = e;
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
PVID_ALWAYS_INLINE void store_kick(pvid_refine_pass_f32 *self, const float K[], const float D[], const float B[])
{
    const float big = (float)PVID_REFINE_SUB * self->h;
    const float half = 0.5f * big;
    const float g = (big * big) * (1.0f / 12.0f);
    float *kick = self->kick;
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
            of_r[i] = big * B[(j * N_Q) + i];
        }
        PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
        {
            kick[(2 * N_Q * N_Q) + (j * N_Q) + i] = damped(D, half, of_r, i);
        }
    }
}

#else

/* F = H (1 + HK/2 (1 + HK/3 (1 + HK/4))), then F K and F B: the columns' change over a big step with a constant K. */
PVID_ALWAYS_INLINE void store_kick(pvid_refine_pass_f32 *self, const float K[], const float D[], const float B[])
{
    const float big = (float)PVID_REFINE_SUB * self->h;
    float factor[N_Q][N_Q] = {{0.0f}};
    float next[N_Q][N_Q];
    (void)D;
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
        for (size_t j = 0; j < PVID_REFINE_MOVING; j++) {
            float sum = factor[i][0] * B[j * N_Q];
            for (size_t k = 1; k < N_Q; k++) {
                sum += factor[i][k] * B[(j * N_Q) + k];
            }
            self->kick[(N_Q * N_Q) + (j * N_Q) + i] = big * sum;
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
PVID_SELDOM static void differentiate(pvid_refine_pass_f32 *self, const float r[],
                                      const pvid_refine_signals_f32 *signals, const float u[], float a[])
{
    float K[N_Q * N_Q];
    float D[N_Q * N_Q];
    float U[N_Q * PVID_REFINE_INPUTS];
    float B[N_Q * PVID_REFINE_MOVING];
    const float *x = self->state;
    pvid_refine_jacobian(self->constants, x, &x[V], u, a, K, D, U, B);
#if PVID_REFINE_SKEW
    PVID_UNROLL for (size_t i = 0; i < N_Q; i++)
    {
        float sum = 0.0f;
        PVID_UNROLL for (size_t j = 0; j < PVID_REFINE_INPUTS; j++)
        {
            float rate = self->slope[0] * signals->u[0][j];
            PVID_UNROLL for (size_t k = 1; k < PVID_REFINE_POINTS; k++)
            {
                rate += self->slope[k] * signals->u[k][j];
            }
            sum += U[(i * PVID_REFINE_INPUTS) + j] * rate;
        }
        B[((PVID_REFINE_MOVING - 1) * N_Q) + i] = sum;
    }
#else
    (void)U;
    (void)signals;
#endif
    store_kick(self, K, D, B);
#if !PVID_REFINE_OUTPUT_LINEAR
    output_derivatives(self, r, x, u, self->output_column);
#else
    (void)r;
#endif
}

/* A step: of Adams-Bashforth, or the first or second one behind Runge-Kutta; `signals` are those of its end. The first
 * two steps of a big step end at its middle, where the derivatives are needed: there the work is longest, and the state
 * has been moved there by the job before. */
PVID_SELDOM static void step(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    const bool middle = self->job == (uint8_t)MIDDLE;
    const bool started = self->starts == 0u;
    const float *x = self->state;
    float a[N_Q];
    float u[PVID_REFINE_INPUTS];
    input(self, signals, 0, u);
    if (started) {
        if (!middle) {
            adams_bashforth(self);
        }
    } else if (middle || (self->job == (uint8_t)END)) {
        memcpy(self->state, self->scratch[0], sizeof self->state);
        self->starts--;
    } else {
        x = self->scratch[1];
    }
    residuals(self, r, x, u, signals->z[0]);
    if (middle) {
        differentiate(self, r, signals, u, a);
    } else {
        accelerations(self->constants, x, u, a);
    }
    if (started) {
        correct(self, a);
    }
    push(self, a);
    if (started && (self->job == (uint8_t)FIRST)) {
        adams_bashforth(self);
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
PVID_ALWAYS_INLINE void columns(pvid_refine_pass_f32 *self, const float derivatives[], const float weight[])
{
    float (*row)[PVID_REFINE_WIDTH] = &self->row[self->rows];
    const float half = (0.5f * (float)PVID_REFINE_SUB) * self->h;
    float kick[2 * N_Q * N_Q];
    PVID_UNROLL for (size_t i = 0; i < (size_t)(2 * N_Q * N_Q); i++)
    {
        kick[i] = self->kick[i];
    }
    PVID_UNROLL for (size_t j = 0; j < PVID_REFINE_COLUMNS; j++)
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
            x[N_Q + i] = 0.5f * (s[N_Q + i] + next[i]);
            s[i] = x[i] + (half * next[i]);
            s[N_Q + i] = next[i];
        }
        entries(row, j, x, derivatives, weight);
    }
}
#else
PVID_ALWAYS_INLINE void columns(pvid_refine_pass_f32 *self, const float derivatives[], const float weight[])
{
    float (*row)[PVID_REFINE_WIDTH] = &self->row[self->rows];
    for (size_t j = 0; j < PVID_REFINE_COLUMNS; j++) {
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
        for (size_t j = PVID_REFINE_MOVING; j < PVID_REFINE_PARAMETERS; j++) {
            const float entry =
                derivatives[(PVID_REFINE_OUTPUTS * PVID_REFINE_STATES) +
                            (i * (PVID_REFINE_PARAMETERS - PVID_REFINE_MOVING)) + (j - PVID_REFINE_MOVING)];
            row[PVID_REFINE_STATES + j] = (i == 0u) ? entry : (weight[i] * entry);
        }
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

/* The end of a big step: columns and rows. */
PVID_SELDOM static void end_big_step(pvid_refine_pass_f32 *self, const float r[], const float weight[])
{
#if PVID_REFINE_OUTPUT_LINEAR
    float derivatives[PVID_REFINE_OUTPUTS * PVID_REFINE_UNKNOWNS];
    output_derivatives(self, r, self->state, self->state, derivatives); /* constants */
#else
    const float *derivatives = self->output_column;
    (void)r;
#endif
    columns(self, derivatives, weight);
    end_rows(self, derivatives, weight);
    self->step++;
}

/* The rows into the sums. */
static void add_rows(pvid_refine_pass_f32 *self)
{
    float *sum = self->sum;
    PVID_UNROLL for (size_t i = 0; i < PVID_REFINE_WIDTH; i++)
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
            *sum += products;
            sum++;
        }
    }
    self->rows = 0;
}

/* ---- jobs ---- */

uint32_t pvid_refine_pass_needs_f32(const pvid_refine_pass_f32 *self, uint32_t *first)
{
    static const uint8_t steps[] = {0, 3, 3, 1, 1, 3, 3, 1, 1, 0, 0};  /* by job */
    static const uint8_t begins[] = {0, 0, 0, 1, 2, 2, 2, 3, 4, 0, 0}; /* in the big step */
    *first = ((uint32_t)self->step * PVID_REFINE_SUB) + begins[self->job];
    return steps[self->job];
}

bool pvid_refine_pass_ends_f32(const pvid_refine_pass_f32 *self, uint32_t length)
{
    return (self->step >= length) && (self->job != (uint8_t)ROWS);
}

/* First job of a pair. */
static uint8_t job_of_pair(const pvid_refine_pass_f32 *self, uint8_t with_start, uint8_t without)
{
    return (self->starts > 0u) ? with_start : without;
}

void pvid_refine_pass_job_f32(pvid_refine_pass_f32 *self, const float r[], const float weight[],
                              const pvid_refine_signals_f32 *signals)
{
    switch (self->job) {
    case CLEAR:
        clear(self);
        self->job = FIRST_A;
        break;
    case FIRST_A:
    case SECOND_A:
        first_half(self, r, signals);
        self->job++;
        break;
    case FIRST_B:
    case SECOND_B:
        second_half(self, signals);
        self->job++;
        break;
    case FIRST:
    case SECOND:
        step(self, r, signals);
        self->job++;
        break;
    case MIDDLE:
        step(self, r, signals);
        self->job = job_of_pair(self, SECOND_A, SECOND);
        break;
    case END:
        step(self, r, signals);
        self->job = COLUMNS;
        break;
    case COLUMNS:
        end_big_step(self, r, weight);
        self->job = (self->rows == (uint8_t)PVID_REFINE_ROWS) ? (uint8_t)ROWS : job_of_pair(self, FIRST_A, FIRST);
        break;
    default:
        add_rows(self);
        self->job = job_of_pair(self, FIRST_A, FIRST);
        break;
    }
}
