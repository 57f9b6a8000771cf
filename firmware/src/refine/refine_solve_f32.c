#include "number/uncontracted.h"

/* The sums are those of [J e]^T [J e], J by the start, then by r. Cholesky eliminates the start: the lower right corner
 * is the block's own information on r, its last diagonal element the block's residual sum. Givens rotations join it
 * with the triangle of the past. */
#include "refine/refine_solve_f32.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "number/unroll.h"
#include "refine_model_f32.h"

#define N PVID_REFINE_PARAMETERS
#define STATES PVID_REFINE_STATES
#define WIDTH PVID_REFINE_WIDTH
#define LAST (PVID_REFINE_WIDTH - 1)

/* A column keeps this part of its square, or it has no information of its own. */
#define LEAST_PART 2.0e-6f
#if PVID_REFINE_UNKNOWNS > 32
#error "dropped has 32 bits"
#endif

/* Halvings of a step that leaves the physical region. */
#define MOST_HALVINGS 12u

/* Longest step of the logarithm of a width: the motion is less linear in it than in the others, whose steps a longer
 * one would shorten. */
#define WIDTH_STEP 0.7f

/* Rotations of a job. */
#define ROTATIONS 4u

/* Jobs in their order; a row joins in one or two. */
#define COPY 0u
#define SIDES 1u
#define CORNER 2u
#define ELIMINATE 3u
#define JOIN (ELIMINATE + WIDTH)
#define SOLVE (JOIN + 1u)
#define LIMIT (SOLVE + 1u)
#define SHIFT (LIMIT + 1u)

/* Place of (i, j), i <= j, in a packed upper triangle of n columns. */
static inline size_t at(size_t n, size_t i, size_t j)
{
    return ((i * ((2u * n) + 1u - i)) / 2u) + (j - i);
}

bool pvid_refine_is_logarithmic_f32(size_t parameter)
{
    return pvid_refine_logarithmic[parameter] != 0u;
}

float pvid_refine_difference_f32(size_t parameter, float to, float from)
{
    const float difference = to - from;
    return pvid_refine_is_logarithmic_f32(parameter) ? ((2.0f * difference) / (to + from)) : difference;
}

PVID_COLD void pvid_refine_move_f32(const float r[], const float step[], float moved[])
{
    for (size_t i = 0; i < N; i++) {
        const float half = 0.5f * step[i];
        moved[i] = pvid_refine_is_logarithmic_f32(i) ? (r[i] * ((1.0f + half) / (1.0f - half))) : (r[i] + step[i]);
    }
}

PVID_COLD void pvid_refine_prior_f32(const float prior_sd[], float sd, float triangle[])
{
    memset(triangle, 0, PVID_REFINE_TRIANGLE * sizeof triangle[0]);
    for (size_t i = 0; i < N; i++) {
        triangle[at(N, i, i)] = sd / prior_sd[i];
    }
}

#if PVID_REFINE_WIDTHS > 0
PVID_COLD void pvid_refine_forget_widths_f32(const float prior_sd[], float sd, float triangle[])
{
    for (size_t i = 0; i < PVID_REFINE_WIDTHS; i++) {
        float *row = &triangle[at(N, i, i)];
        memset(row, 0, (N - i) * sizeof row[0]);
        row[0] = sd / prior_sd[i];
    }
}
#endif

void pvid_refine_solve_begin_f32(pvid_refine_solve_f32 *self)
{
    self->job = 0;
    self->row = 0;
    self->rotation = 0;
    self->halvings = 0;
}

/* Right side of the past, as seen from the point of linearisation: triangle (past - linear). */
static void copy(pvid_refine_solve_f32 *self, const float triangle[], const float past[], const float linear[])
{
    memcpy(self->triangle, triangle, sizeof self->triangle);
    self->clash = 0.0f;
    float from[N];
    for (size_t i = 0; i < N; i++) {
        from[i] = pvid_refine_difference_f32(i, past[i], linear[i]);
    }
    const float *entry = triangle;
    for (size_t i = 0; i < N; i++) {
        float sum = 0.0f;
        for (size_t j = i; j < N; j++) {
            sum += *entry * from[j];
            entry++;
        }
        self->right[i] = sum;
    }
}

/* The sums by the motion's columns to those by the steps of r, T^T S T: those with the start and with what does not
 * move, then those of the moving parameters. */
static void chart_sides(float sum[], const float linear[])
{
#if PVID_REFINE_HAS_CHART
    for (size_t i = 0; i < STATES; i++) {
        pvid_refine_chart(linear, &sum[at(WIDTH, i, STATES)]);
    }
    for (size_t j = STATES + PVID_REFINE_MOVING; j < WIDTH; j++) {
        float row[PVID_REFINE_MOVING];
        for (size_t i = 0; i < PVID_REFINE_MOVING; i++) {
            row[i] = sum[at(WIDTH, STATES + i, j)];
        }
        pvid_refine_chart(linear, row);
        for (size_t i = 0; i < PVID_REFINE_MOVING; i++) {
            sum[at(WIDTH, STATES + i, j)] = row[i];
        }
    }
#else
    (void)sum;
    (void)linear;
#endif
}

static void chart_corner(float sum[], const float linear[])
{
#if PVID_REFINE_HAS_CHART
    float corner[PVID_REFINE_MOVING][PVID_REFINE_MOVING];
    for (size_t i = 0; i < PVID_REFINE_MOVING; i++) {
        const float *row = &sum[at(WIDTH, STATES + i, STATES + i)];
        for (size_t j = i; j < PVID_REFINE_MOVING; j++) {
            corner[i][j] = row[j - i];
            corner[j][i] = row[j - i];
        }
    }
    for (size_t i = 0; i < PVID_REFINE_MOVING; i++) {
        pvid_refine_chart(linear, corner[i]);
    }
    for (size_t j = 0; j < PVID_REFINE_MOVING; j++) {
        float row[PVID_REFINE_MOVING];
        for (size_t i = 0; i < PVID_REFINE_MOVING; i++) {
            row[i] = corner[i][j];
        }
        pvid_refine_chart(linear, row);
        for (size_t i = 0; i <= j; i++) {
            sum[at(WIDTH, STATES + i, STATES + j)] = row[i];
        }
    }
#else
    (void)sum;
    (void)linear;
#endif
}

static void to_steps(pvid_refine_pass_f32 *pass, const float linear[])
{
    float *sum = pass->sums.sum;
    chart_corner(sum, linear);
    for (size_t i = 0; i < PVID_REFINE_UNKNOWNS; i++) {
        pass->row[0][i] = sum[at(WIDTH, i, i)];
    }
}

/* One column of Cholesky's: its row is complete and is taken off the rest. A column without information of its own is
 * skipped; from the second pass on it stays skipped for the rest of the block: if it came and went, the passes would
 * not converge. */
static void eliminate(pvid_refine_solve_f32 *self, pvid_refine_pass_f32 *pass, size_t column)
{
    float *sum = pass->sums.sum;
    const size_t length = WIDTH - column;
    float *row = &sum[at(WIDTH, column, column)];
    const float square = row[0];
    if (column == LAST) {
        self->residual = (square > 0.0f) ? square : 0.0f;
        return;
    }
    const bool skipped = ((self->dropped >> column) & 1u) != 0u;
    if (skipped || !(square > (LEAST_PART * pass->row[0][column]))) {
        self->dropped |= ((uint32_t)1u << column);
        memset(row, 0, length * sizeof row[0]);
        return;
    }
    const float scale = 1.0f / sqrtf(square);
    for (size_t j = 0; j < length; j++) {
        row[j] *= scale;
    }
    float *below = &row[length];
    for (size_t k = 1; k < length; k++) {
        const float factor = row[k];
        for (size_t j = k; j < length; j++) {
            *below -= factor * row[j];
            below++;
        }
    }
}

/* A row of the block's information joins the triangle, by some rotations. Returns whether all have. */
static bool join(pvid_refine_solve_f32 *self, float sum[])
{
    const size_t row = self->row;
    float *left = &sum[at(WIDTH, STATES + row, STATES + row)];
    float *rest = &left[N - row];
    for (uint32_t count = 0; (count < ROTATIONS) && (self->rotation < N); count++) {
        const size_t i = self->rotation;
        float *entry = &self->triangle[at(N, i, i)];
        const float a = entry[0];
        const float b = left[i - row];
        const float square = (a * a) + (b * b);
        self->rotation++;
        if (!(square > 0.0f)) {
            continue;
        }
        const float scale = 1.0f / sqrtf(square);
        const float cosine = a * scale;
        const float sine = b * scale;
        for (size_t j = i; j < N; j++) {
            const float x = entry[j - i];
            const float y = left[j - row];
            entry[j - i] = (cosine * x) + (sine * y);
            left[j - row] = (cosine * y) - (sine * x);
        }
        const float x = self->right[i];
        self->right[i] = (cosine * x) + (sine * *rest);
        *rest = (cosine * *rest) - (sine * x);
    }
    if (self->rotation == N) {
        self->clash += *rest * *rest;
        self->row++;
        self->rotation = self->row;
    }
    return self->row == N;
}

/* The step of r, shortened to the limit. Returns whether there is one. */
static bool solve(pvid_refine_solve_f32 *self, const float prior_sd[], float step_limit)
{
    float *step = self->step;
    float longest = 0.0f; /* widths of signs included */
    float largest = 0.0f;
    float bend = 0.0f;
#if PVID_REFINE_SIGNS > 0
    self->reduction = 0.0f;
#endif
    for (size_t i = N; i > 0u; i--) {
        const size_t k = i - 1u;
        const float *entry = &self->triangle[at(N, k, k)];
        float sum = self->right[k];
        for (size_t j = i; j < N; j++) {
            sum -= entry[j - k] * step[j];
        }
        if (!(entry[0] > 0.0f)) {
            return false;
        }
        step[k] = sum / entry[0];
#if PVID_REFINE_SIGNS > 0
        self->reduction += self->right[k] * self->right[k];
#endif
#if PVID_REFINE_WIDTHS > 0
        if (pvid_refine_is_width(k)) {
            step[k] = (step[k] > WIDTH_STEP) ? WIDTH_STEP : step[k];
            step[k] = (step[k] < -WIDTH_STEP) ? -WIDTH_STEP : step[k];
        }
#endif
        const float size = ((step[k] < 0.0f) ? -step[k] : step[k]) / prior_sd[k];
        longest = (size <= longest) ? longest : size;
        if (!pvid_refine_is_width(k)) {
            largest = (size <= largest) ? largest : size;
            bend = ((size <= bend) || !pvid_refine_is_logarithmic_f32(k)) ? bend : size;
        }
    }
    self->size = largest;
    self->bend = bend;
    if (!(longest < 1.0e6f)) {
        return false;
    }
    if (longest > step_limit) {
        const float scale = step_limit / longest;
        for (size_t i = 0; i < N; i++) {
            step[i] *= scale;
        }
    }
    return true;
}

/* Halves a step that leaves the region. Returns whether it is within, or has been halved often enough. */
static bool limit(pvid_refine_solve_f32 *self, const float linear[])
{
    float moved[N];
    pvid_refine_move_f32(linear, self->step, moved);
    if (pvid_refine_region(moved) || (self->halvings == MOST_HALVINGS)) {
        return true;
    }
    for (size_t i = 0; i < N; i++) {
        self->step[i] *= 0.5f;
    }
    self->halvings++;
    return false;
}

/* The step of the block's start. */
static void shift(pvid_refine_solve_f32 *self, const float sums[])
{
    for (size_t i = STATES; i > 0u; i--) {
        const size_t k = i - 1u;
        const float *entry = &sums[at(WIDTH, k, k)];
        float sum = entry[LAST - k];
        for (size_t j = 0; j < N; j++) {
            sum -= entry[(STATES - k) + j] * self->step[j];
        }
        for (size_t j = i; j < STATES; j++) {
            sum -= entry[j - k] * self->shift[j];
        }
        self->shift[k] = (entry[0] > 0.0f) ? (sum / entry[0]) : 0.0f;
    }
}

PVID_COLD pvid_refine_solution pvid_refine_solve_job_f32(pvid_refine_solve_f32 *self, pvid_refine_pass_f32 *pass,
                                                         const float triangle[], const float past[],
                                                         const float linear[], const float prior_sd[], float step_limit)
{
    float *sum = pass->sums.sum;
    const uint8_t job = self->job;
    self->job++;
    if (job == COPY) {
        copy(self, triangle, past, linear);
    } else if (job == SIDES) {
        chart_sides(sum, linear);
    } else if (job == CORNER) {
        to_steps(pass, linear);
    } else if (job < JOIN) {
        eliminate(self, pass, (size_t)job - ELIMINATE);
    } else if (job == JOIN) {
        self->job = join(self, sum) ? SOLVE : JOIN;
    } else if (job == SOLVE) {
        return solve(self, prior_sd, step_limit) ? PVID_REFINE_SOLVING : PVID_REFINE_UNSOLVED;
    } else if (job == LIMIT) {
        self->job = limit(self, linear) ? SHIFT : LIMIT;
    } else {
        shift(self, sum);
        return PVID_REFINE_SOLVED;
    }
    return PVID_REFINE_SOLVING;
}

PVID_COLD void pvid_refine_end_state_f32(const pvid_refine_solve_f32 *self, const pvid_refine_pass_f32 *pass,
                                         const float linear[], float state[])
{
    for (size_t i = 0; i < STATES; i++) {
        float by_r[PVID_REFINE_MOVING];
        float x = pass->state[i];
        for (size_t j = 0; j < STATES; j++) {
            x += pass->column[j][i] * self->shift[j];
        }
        for (size_t j = 0; j < PVID_REFINE_MOVING; j++) {
            by_r[j] = pass->column[STATES + j][i];
        }
#if PVID_REFINE_HAS_CHART
        pvid_refine_chart(linear, by_r);
#endif
        for (size_t j = 0; j < PVID_REFINE_MOVING; j++) {
            x += by_r[j] * self->step[j];
        }
        state[i] = x;
    }
#if !PVID_REFINE_HAS_CHART
    (void)linear;
#endif
}

PVID_COLD void pvid_refine_inverse_column_f32(const float triangle[], size_t column, float out[])
{
    for (size_t i = 0; i < N; i++) {
        out[i] = 0.0f;
    }
    const size_t end = column + 1u;
    out[column] = 1.0f / triangle[at(N, column, column)];
    for (size_t i = column; i > 0u; i--) {
        const size_t k = i - 1u;
        const float *entry = &triangle[at(N, k, k)];
        float sum = 0.0f;
        for (size_t j = i; j < end; j++) {
            sum -= entry[j - k] * out[j];
        }
        out[k] = sum / entry[0];
    }
}
