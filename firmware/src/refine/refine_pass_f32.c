#include "number/uncontracted.h"

/* Derivatives of the motion, order 2: leapfrog over four steps (drift, kick, drift) with one Jacobian; K replaced by
 * K + H^2/12 K^2, which gives the modes their frequencies. Their errors cost efficiency, not bias. Rows: the residuals'
 * mean over those steps by trapezoids, the columns at their middle. Outputs are those of the motion `skew` seconds
 * later, by its derivatives. */
#include "refine/refine_pass_f32.h"

#include <stddef.h>
#include <string.h>

#include "number/unroll.h"
#include "refine/refine_adams_f32.h"
#include "refine/refine_front_f32.h"
#include "refine/refine_motion_f32.h"
#include "refine/refine_runge_kutta_f32.h"
#include "refine_model_f32.h"

/* Columns of the first of two jobs, and rows of the sums. */
#define HALF_OF_COLUMNS ((PVID_REFINE_COLUMNS + 1) / 2)
#define PART_OF_SUMS (PVID_REFINE_WIDTH / 3)
#define SUMS_BEFORE ((PART_OF_SUMS * ((2 * PVID_REFINE_WIDTH) + 1 - PART_OF_SUMS)) / 2)

PVID_COLD void pvid_refine_pass_begin_f32(pvid_refine_pass_f32 *self, const float r[], const float start[],
                                          const pvid_refine_steps_f32 *steps, float gate)
{
    self->h = steps->h;
    self->gate = gate;
#if PVID_REFINE_OBSERVER
    memcpy(self->observer, steps->observer, sizeof self->observer);
#endif
#if PVID_REFINE_TURNING
    memcpy(self->turn, steps->turn, sizeof self->turn);
#endif
#if PVID_REFINE_SKEW
    const float skew = r[PVID_REFINE_MOVING];
    self->skew[0] = skew;
    self->skew[1] = (0.5f * skew) * skew;
    self->skew[2] = (self->skew[1] * skew) / (3.0f * steps->h);
#endif
    pvid_refine_constants(r, self->constants);
    memcpy(self->state, start, sizeof self->state);
    begin_steps(self, steps);
    self->job = CLEAR;
    self->at = 0;
    self->rows = 0;
    self->step = 0;
    self->used = 0;
}

static void clear(pvid_refine_pass_f32 *self)
{
    clear_steps(self);
    memset(self->column, 0, sizeof self->column);
    memset(self->sums.sum, 0, sizeof self->sums.sum);
    for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
        self->column[i][i] = 1.0f;
    }
    for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++) {
        self->mean[i] = 0.0f;
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

#if PVID_REFINE_OBSERVER
/* The noise of a measured input moves the model, and its errors grow over a block. An observer follows the outputs: its
 * residuals are nearly white, and its columns are those of the observer. */
static void correct(pvid_refine_pass_f32 *self, const float derivatives[])
{
    const size_t first = (size_t)self->rows - PVID_REFINE_OUTPUTS;
    for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
        float correction = 0.0f;
        for (size_t k = 0; k < PVID_REFINE_OUTPUTS; k++) {
            const float *row = self->row[first + k];
            const float gain = self->observer[(k * PVID_REFINE_STATES) + i];
            correction += gain * row[PVID_REFINE_WIDTH - 1];
            for (size_t j = 0; j < PVID_REFINE_COLUMNS; j++) {
                self->column[j][i] -= gain * row[j];
            }
        }
        self->state[i] += correction;
        for (size_t k = 0; k < PVID_REFINE_OUTPUTS; k++) {
            self->last[k] -= derivatives[(k * N_Q) + i] * correction;
        }
    }
}
#endif

/* The end of a big step: the first columns, or the others and what completes the rows. */
PVID_NOINLINE static void end_big_step(pvid_refine_pass_f32 *self, const float r[], const float weight[])
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
#if PVID_REFINE_OBSERVER
    correct(self, derivatives);
#endif
    end_steps(self);
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

PVID_NOINLINE static void add_first_rows(pvid_refine_pass_f32 *self)
{
    add_rows(self, self->sums.sum, 0, PART_OF_SUMS);
}

PVID_NOINLINE static void add_other_rows(pvid_refine_pass_f32 *self)
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
    return ((uint32_t)self->step * PVID_REFINE_SUB) + self->at + pvid_refine_ahead[self->job];
}

static inline bool ends(const pvid_refine_pass_f32 *self, uint32_t length)
{
    return (self->step >= length) && (self->job <= (uint8_t)STEP);
}

/* CLEAR and the jobs of the start; with Runge-Kutta also SLOPES, before each STEP. */
PVID_COLD static void first_jobs(pvid_refine_pass_f32 *self, const float r[], const pvid_refine_signals_f32 *signals)
{
    if (self->job == (uint8_t)CLEAR) {
        clear(self);
    } else {
        first_steps(self, r, signals);
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
        if (self->job < (uint8_t)STEP) {
            first_jobs(self, r, signals);
        } else {
            kick_job(self);
        }
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
#if PVID_REFINE_RUNGE_KUTTA
            if ((end - (int32_t)entry) > ((int32_t)pvid_refine_front_room_f32(front) - 4)) {
                return PVID_REFINE_PASS_LOST; /* more steps were fine ones than there was time for */
            }
#endif
            read_signals(self, front, block->begin + entry, &signals);
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
