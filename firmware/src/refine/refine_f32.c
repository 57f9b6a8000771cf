#include "number/uncontracted.h"

#include "pvid/refine.h"

#include <stddef.h>
#include <string.h>

#include "judge/publication.h"
#include "judge/trust_f32.h"
#include "number/count.h"
#include "number/finite_f32.h"
#include "number/init.h"
#include "number/unroll.h"
#include "refine/refine_front_f32.h"
#include "refine/refine_judge_f32.h"
#include "refine/refine_pass_f32.h"
#include "refine/refine_solve_f32.h"
#include "refine/refine_valid_f32.h"
#include "refine_model_f32.h"

#define N PVID_REFINE_PARAMETERS

/* What the next tick does. */
enum { WAIT, PASS, SOLVE, MOVE, END, FOLLOW, ASSESS, JUDGE, PUBLISH, NEXT, START };

/* Mean square of the rows' noise over its density at low frequencies: the trapezoids of neighbouring rows share a
 * sample. */
#define WHITENESS 0.89f

/* Residuals beyond this are never used [units of the first output]. */
#define RESIDUAL_MAX 1.0e3f

/* In the search: a converged block with less than this many times the limit may grow; one with more than that many
 * begins anew with the first length. */
#define GROWTH_LIMIT 3.0f
#define RESTART_LIMIT 30.0f

/* A search whose last step was longer than this [prior_sd] begins anew when there is a new estimate of the weak form; a
 * block with a shorter one and small residuals need not converge: it goes on twice as long. */
#define RESTART_STEP 3.0f
#define UNCONVERGED_STEP 2.0f

/* Lost blocks until the search begins again from the weak form's estimate; a block that is not sane counts twice. */
#define LOST_MOST 6u

/* Entries of the ring before an estimate of the weak form that the search may use. */
#define WEAK_AGE_MAX 200u

/* Part of the difference by which level and clash follow a block's. */
#define LEVEL_GAIN 0.2f
#define CLASH_GAIN 0.3f

/* Factor on the clash of the first two blocks: they are short, and neighbours err alike. */
#define FIRST_CLASH 2.0f

/* Factor on the triangle if the next block contains samples that the triangle already has, or if the past is given up:
 * it has next to no weight then, but the clash with it can still be computed. */
#define PAST_WEIGHT (1.0f / 16.0f)

/* Largest change of the information of past and block (square root of its determinant) from the block's first pass,
 * which is linearised where the past was, to its last one. Beyond it the past is given up. */
#define CONSISTENT 2.0f

/* Steps between the three readings that a block's start is measured by. */
#define START_SPACING 4u

/* In the track a first pass whose step of the logarithms is this much below the limit is the block's last. */
#define SINGLE_PASS_STEP 0.25f

/* Standard errors that an estimate of the weak form may be off. */
#define PRIOR_ERRORS 10.0f
#define LEAST_PRIOR 1.0e-6f

/* A step that lessens the sum of squares by less than this many variances changes no parameter by more than half of the
 * standard error that the sensors' noise gives it. */
#define SETTLED 0.25f

/* With signs a block whose last step is above step_fine is taken only up to the second, and this part of its triangle
 * remains: the others are to outweigh the error of its linearization. */
#define PARTIAL_WEIGHT 0.25f

/* Least variance of a row over that of the sensors: the errors of reversals in the finest steps are alike from block to
 * block. */
#define REVERSAL_VARIANCE 4.0f

/* Part of a width's start below which it does not fall: the steps are too long for a sharper reversal. */
#define LEAST_WIDTH 0.25f

/* Jobs of a pass for each of its big steps, at most, and for its beginning; ticks of a solution; entries that such a
 * block keeps free. */
#if PVID_REFINE_RUNGE_KUTTA
#define JOBS(self) (15u + (10u * (self)->config.parts)) /* with few fine steps; with more the block may be lost */
#define SOLVE_JOBS(self) (1u + ((self)->config.jobs / 8u))
#define SOLVE_TICKS(self) (5u + (45u / SOLVE_JOBS(self)))
#else
#define JOBS(self) 9u
#define SOLVE_JOBS(self) 1u
#define SOLVE_TICKS(self) 45u
#endif
#define FIRST_JOBS 16u
#define FREE_ENTRIES 16u

static inline bool is_ready(const pvid_refine_f32 *self)
{
    const bool ready = (self != NULL) && (self->config.signal != NULL);
    PVID_ASSERT(ready);
    return ready;
}

static void forget_state(pvid_refine_f32 *self)
{
    memset(self->expected, 0, sizeof self->expected);
    self->restarted = true;
}

static float at_least_one(float level)
{
    return (level > 1.0f) ? level : 1.0f;
}

/* ---- blocks ---- */

/* Whether the ring still has the beginning of the block, or will. */
static bool is_there(const pvid_refine_f32 *self)
{
    const int32_t back = (int32_t)(pvid_refine_front_end_f32(&self->front) - self->begin);
    return back <= ((int32_t)pvid_refine_front_room_f32(&self->front) - 8);
}

/* Whether rows with large residuals are left out: not in the first two passes after a single block, from which the
 * motion may be predicted badly. (Where the start is measured, such a block begins again there, as is_off has it; with
 * signs the prior is at most ten standard errors of the weak form wide.) */
static bool is_gated(const pvid_refine_f32 *self)
{
    const bool late = (PVID_REFINE_HAS_MEASURED != 0) || (PVID_REFINE_SIGNS > 0) || (self->pass >= 2u);
    const bool predicted = (self->taken > 1u) || ((self->taken == 1u) && late);
    return predicted && (self->config.gate > 0.0f) && !self->restarted;
}

static void begin_pass(pvid_refine_f32 *self)
{
    const float gate =
        is_gated(self) ? (self->config.gate * self->config.sd[0] * pvid_refine_root_f32(self->level)) : RESIDUAL_MAX;
    const pvid_refine_steps_f32 steps = {
        .h = self->h,
#if PVID_REFINE_RUNGE_KUTTA
        .parts = self->config.parts,
        .fine_parts = self->config.fine_parts,
#endif
#if PVID_REFINE_OBSERVER
        .observer = self->config.observer,
#endif
#if PVID_REFINE_TURNING
        .turn = self->front.turn,
#endif
    };
    if (self->pass < 2u) {
        self->solve.dropped = 0; /* the first pass may be linearised about a wrong motion */
    }
    pvid_refine_pass_begin_f32(&self->work, self->linear, self->start, &steps, gate);
    self->phase = PASS;
    self->waiting = false;
}

PVID_COLD static void begin_block(pvid_refine_f32 *self)
{
    if (!is_there(self)) {
        self->begin = pvid_refine_front_end_f32(&self->front); /* overwritten, or will be */
        forget_state(self);
    }
    memcpy(self->linear, self->next, sizeof self->linear);
    memcpy(self->start, self->expected, sizeof self->start);
    self->pass = 0;
    begin_pass(self);
#if PVID_REFINE_HAS_MEASURED
    self->phase = self->restarted ? (uint8_t)START : (uint8_t)PASS;
#endif
}

#if PVID_REFINE_HAS_MEASURED
/* The start of a block that follows no other: what the sensors read, rates by a parabola through three readings. From 0
 * a large motion is too far away. */
static void start_job(pvid_refine_f32 *self)
{
    const uint32_t behind = self->begin + ((2u * START_SPACING) + 1u);
    if ((int32_t)(pvid_refine_front_end_f32(&self->front) - behind) < 0) {
        self->waiting = true;
        self->due = behind;
        return;
    }
    pvid_refine_signals_f32 at[3];
    for (uint32_t k = 0; k < 3u; k++) {
        pvid_refine_front_read_f32(&self->front, self->begin + (k * START_SPACING), &at[k]);
    }
    const float scale = 1.0f / ((2.0f * (float)START_SPACING) * self->h);
    for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
        const size_t code = pvid_refine_measured[i];
        if (code > 0u) {
            const size_t output = (code - 1u) / 2u;
            const float z = at[0].z[output];
#if PVID_REFINE_TURNING
            const float turn = self->front.turn[output];
            const float next = pvid_refine_turned(at[1].z[output] - z, turn);
            const float last = pvid_refine_turned(at[2].z[output] - z, turn);
            const float rate = ((4.0f * next) - last) * scale;
#else
            const float rate = (((4.0f * at[1].z[output]) - at[2].z[output]) - (3.0f * z)) * scale;
#endif
            const float x = ((code & 1u) != 0u) ? z : rate;
            self->start[i] = pvid_refine_within_f32(x, self->config.state_limit[i]) ? x : 0.0f;
        }
    }
    begin_pass(self);
}

/* Whether the first pass of a block of the track left out too much: its start, which follows from the block before, is
 * too far away. */
static bool is_off(const pvid_refine_f32 *self)
{
    return !self->restarted && (self->taken > 0u) && (self->pass == 0u) &&
           ((uint32_t)self->work.used * 10u < (uint32_t)self->length * 6u * PVID_REFINE_OUTPUTS);
}
#endif

/* The triangle is that of the weak form's estimate. Where friction makes the residuals jump with each step of r, its
 * standard errors limit the prior. */
static void begin_from_prior(pvid_refine_f32 *self)
{
#if PVID_REFINE_SIGNS > 0
    float sd[N];
    memcpy(sd, self->config.prior_sd, sizeof sd);
    for (size_t i = 0; i < PVID_REFINE_P; i++) {
        const size_t place = pvid_refine_place_of_p[i];
        const float size = pvid_refine_is_logarithmic_f32(place) ? self->weak[place] : 1.0f;
        const float scaled = (PRIOR_ERRORS * self->weak_se[i]) / size;
        const float prior = (scaled > LEAST_PRIOR) ? scaled : LEAST_PRIOR;
        sd[place] = (prior < sd[place]) ? prior : sd[place];
    }
    pvid_refine_prior_f32(sd, self->config.sd[0], self->triangle);
#else
    pvid_refine_prior_f32(self->config.prior_sd, self->config.sd[0], self->triangle);
#endif
}

/* A search begins with the prior of the weak form; with signs, whose prior is narrow, about its present estimate. */
static void begin_search(pvid_refine_f32 *self)
{
#if PVID_REFINE_SIGNS > 0
    memcpy(self->r, self->weak, sizeof self->r);
#endif
    begin_from_prior(self);
    self->taken = 0;
    self->refused = 0;
    self->level = 0.0f;
    self->kept = 1.0f;
}

/* Takes a new estimate of the weak form if it is in the region; until a block has been taken it is the prior's mean. */
PVID_COLD static void take_weak(pvid_refine_f32 *self, const pvid_estimate_f32 *weak)
{
    float r[N];
    pvid_refine_from_p(weak->p, r);
#if PVID_REFINE_WIDTHS > 0
    memcpy(r, self->config.width, sizeof self->config.width);
#endif
    if (pvid_refine_region(r)) {
        memcpy(self->weak, r, sizeof self->weak);
        memcpy(self->weak_se, weak->se, sizeof self->weak_se);
        self->renewed = true;
    }
}

static void begin_anew(pvid_refine_f32 *self)
{
#if PVID_REFINE_SIGNS > 0
    begin_from_prior(self);
#endif
    memcpy(self->r, self->weak, sizeof self->r);
    memcpy(self->next, self->weak, sizeof self->next);
    forget_state(self);
    self->renewed = false;
    self->lost = 0;
    self->length = self->config.first_block;
}

/* Ticks of a pass of this length with its solution. */
static uint32_t ticks_of_pass(const pvid_refine_f32 *self, uint32_t length)
{
    return (((JOBS(self) * length) + FIRST_JOBS) / self->config.jobs) + SOLVE_TICKS(self);
}

/* How far back a block may begin: the ring must have it for so many passes of a length, the origin is the limit. */
static uint32_t oldest(const pvid_refine_f32 *self, uint32_t passes, uint32_t length)
{
    const pvid_refine_config_f32 *config = &self->config;
    const uint32_t ticks = passes * ticks_of_pass(self, length);
    const uint32_t taken =
        (ticks / ((config->ratio > 1u) ? (config->ratio - 1u) : 1u)) + FREE_ENTRIES; /* in the meantime */
    const uint32_t room = pvid_refine_front_room_f32(&self->front);
    const uint32_t end = pvid_refine_front_end_f32(&self->front);
    const uint32_t back = (room > taken) ? (room - taken) : 0u;
    return ((end - self->origin) > back) ? (end - back) : self->origin;
}

/* Whether the ring still has the beginning of the block for another pass of this length. With Runge-Kutta a pass may
 * take as long as the block: then at the end of that pass. */
static bool lasts(const pvid_refine_f32 *self, uint32_t length)
{
#if PVID_REFINE_RUNGE_KUTTA
    const pvid_refine_config_f32 *config = &self->config;
    const uint32_t taken = ticks_of_pass(self, length) / ((config->ratio > 1u) ? (config->ratio - 1u) : 1u);
    const int32_t back = (int32_t)((pvid_refine_front_end_f32(&self->front) + taken) - self->begin);
    return back <= ((int32_t)pvid_refine_front_room_f32(&self->front) - 8);
#else
    (void)length;
    return is_there(self);
#endif
}

/* From an estimate of the weak form that the samples of the past have not been tried with. */
static void begin_anew_in_the_past(pvid_refine_f32 *self)
{
    begin_anew(self);
#if PVID_REFINE_RUNGE_KUTTA
    self->begin = oldest(self, self->config.most_passes, self->config.block / 2u); /* the search doubles its length */
#else
    self->begin = oldest(self, self->config.passes, self->length);
#endif
}

/* ---- the end of a block ---- */

static bool is_sane(const pvid_refine_f32 *self)
{
    bool sane = self->solved && ((uint32_t)self->work.used * 10u >= (uint32_t)self->length * 6u * PVID_REFINE_OUTPUTS);
    for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
        sane = sane && pvid_refine_within_f32(self->start[i], self->config.state_limit[i]);
    }
    return sane;
}

#if PVID_REFINE_SIGNS > 0
/* Whether the last step is small beside the errors of the blocks so far, or so short that the motion is linear in it:
 * reversals make the motion jump with each step. */
static bool is_fine(const pvid_refine_f32 *self)
{
    return (self->solve.size < self->config.step_fine) ||
           (self->solve.reduction < (SETTLED * (self->config.sd[0] * self->config.sd[0])));
}
#endif

/* Whether the last step is small beside the weak form's errors; with signs behind the second block a fine one. */
static bool is_settled(const pvid_refine_f32 *self)
{
    const bool small = self->solve.size < self->config.step_max;
#if PVID_REFINE_SIGNS > 0
    return (small && (self->taken < 2u)) || is_fine(self);
#else
    return small;
#endif
}

/* Behind a block that was taken and began at `began`: twice as long, and from as far back as possible, but where a
 * coordinate is hidden: its value there is not known. */
static void lengthen(pvid_refine_f32 *self, uint32_t began)
{
    const uint32_t twice = 2u * (uint32_t)self->length;
    self->length = (uint16_t)((twice < self->config.block) ? twice : self->config.block);
#if PVID_REFINE_HIDDEN > 0
    (void)began;
#else
    const uint32_t first = oldest(self, self->config.passes, self->length);
    if ((int32_t)(self->begin - first) > 0) {
        self->begin = first;
        self->again = true;
        self->same_start = first == began;
    }
#endif
}

/* Part of the information that the block adds to that of the past: mean of the parameters, 0 to 1. */
static float share_of_block(const pvid_refine_f32 *self)
{
    float past = 0.0f;
    size_t place = 0;
    for (size_t i = 0; i < N; i++) {
        const float part = self->triangle[place] / self->solve.triangle[place];
        past += part * part;
        place += N - i;
    }
    return 1.0f - (past / (float)N);
}

#if PVID_REFINE_SIGNS == 0
/* Whether the information of past and block may be added, which are linearised at different points. Which combination
 * of parameters a block hardly determines depends on the point; the sum may then appear to determine all of them. */
static bool is_consistent(const pvid_refine_f32 *self)
{
    float ratio = 1.0f;
    size_t place = 0;
    for (size_t i = 0; i < N; i++) {
        ratio *= self->solve.triangle[place] / self->diagonal[i];
        place += N - i;
    }
    return (ratio < CONSISTENT) && (ratio > (1.0f / CONSISTENT));
}
#endif

static void accept_block(pvid_refine_f32 *self, float square, float clash, bool again, uint32_t began)
{
    const pvid_refine_config_f32 *config = &self->config;
    self->refused = 0;
    self->lost = 0;
    if (self->taken > 0u) {
        const float mean = self->clash + (CLASH_GAIN * (clash - self->clash));
        const float first = (self->taken == 1u) ? (FIRST_CLASH * clash) : 0.0f;
        self->clash = (first > mean) ? first : mean;
        const float larger = (clash > first) ? clash : first;
        self->scatter += share_of_block(self) * (larger - self->scatter);
    }
#if PVID_REFINE_SIGNS > 0
    const bool consistent = true; /* the prior is at most ten standard errors of the weak form wide */
#else
    const bool consistent = (self->taken == 0u) || again || is_consistent(self);
#endif
    self->taken = ((self->taken == 0u) || !consistent) ? 1u : 2u;
    self->level = ((self->taken == 1u) || again) ? square : (self->level + (LEVEL_GAIN * (square - self->level)));
    memcpy(self->r, self->linear, sizeof self->r);
    memcpy(self->next, self->linear, sizeof self->next);
    float fade = 1.0f - ((1.0f - self->fade) * ((float)self->length / (float)config->block));
    if (self->length < config->block) {
        lengthen(self, began);
    }
    const bool anew = self->again || !consistent;
    fade = anew ? PAST_WEIGHT : fade;
    float counts = 1.0f;
#if PVID_REFINE_SIGNS > 0
    counts = is_fine(self) ? 1.0f : PARTIAL_WEIGHT;
#endif
    self->kept = anew ? (PAST_WEIGHT * counts) : counts;
    fade *= counts;
    for (size_t i = 0; i < PVID_REFINE_TRIANGLE; i++) {
        self->triangle[i] = self->solve.triangle[i] * fade;
    }
#if PVID_REFINE_WIDTHS > 0
    pvid_refine_forget_widths_f32(config->prior_sd, config->sd[0] * fade, self->triangle);
#endif
}

/* A block that is not taken. In the track it counts with the largest clash of a block that is: what the next search
 * finds has the standard errors of equations that did not always fit. */
static void refuse(pvid_refine_f32 *self, bool sane)
{
    if (self->taken > 0u) {
        const float limit = self->config.clash_max * at_least_one(self->level);
        self->clash += CLASH_GAIN * (limit - self->clash);
        self->refused++;
        self->origin = self->begin;
        if (self->refused >= 2u) {
            begin_search(self);
            if (sane) {
                memcpy(self->next, self->linear, sizeof self->next);
            }
        }
    } else {
        self->lost = (uint8_t)(self->lost + (sane ? 1u : 2u));
        if (sane) {
            memcpy(self->next, self->linear, sizeof self->next);
        }
    }
}

/* Length of the next block of a search. */
static void resize(pvid_refine_f32 *self, bool sane, float square)
{
    const pvid_refine_config_f32 *config = &self->config;
    if (sane && (square < (GROWTH_LIMIT * config->chi_max))) {
        const uint32_t twice = 2u * (uint32_t)self->length;
        self->length = (uint16_t)((twice < config->block) ? twice : self->length);
    } else if (!sane || !(square <= (RESTART_LIMIT * config->chi_max))) {
        self->length = config->first_block;
    } else {
        /* as long again */
    }
}

#if PVID_REFINE_TURNING
/* Takes whole turns off the start of the next block, so that float32 keeps its resolution: the motion is the same. */
static void turn_back(pvid_refine_f32 *self)
{
    for (size_t output = 0; output < PVID_REFINE_OUTPUTS; output++) {
        const uint8_t angle = (uint8_t)(1u + (2u * output));
        float whole = 0.0f;
        for (size_t i = PVID_REFINE_STATES; (i > 0u) && (pvid_refine_turning[output] != 0u); i--) {
            if (pvid_refine_measured[i - 1u] == angle) {
                const float x = self->expected[i - 1u];
                whole = x - pvid_refine_turned(x, self->front.turn[output]);
            }
        }
        for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
            if (pvid_refine_measured[i] == angle) {
                self->expected[i] -= whole;
            }
        }
    }
}
#endif

/* The start of the next block. */
static void follow(pvid_refine_f32 *self)
{
    bool within = self->sane;
    if (self->again) {
        within = within && self->same_start;
        memcpy(self->expected, self->start, sizeof self->expected);
    } else if (within) {
        pvid_refine_end_state_f32(&self->solve, &self->work, self->linear, self->expected);
#if PVID_REFINE_TURNING
        turn_back(self);
#endif
        for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
            within = within && pvid_refine_within_f32(self->expected[i], self->config.state_limit[i]);
        }
    } else {
        /* as it is */
    }
    self->restarted = false;
    if (!within) {
        forget_state(self);
    }
}

/* Of the block's residuals behind its own fit, over what the noise makes of it. */
static float mean_square(const pvid_refine_f32 *self)
{
    const float variance = self->config.sd[0] * self->config.sd[0];
    const uint32_t used = self->work.used;
    const float freedom = (used > (PVID_REFINE_UNKNOWNS + 1u)) ? (float)(used - PVID_REFINE_UNKNOWNS) : 1.0f;
    return self->solve.residual / (freedom * (WHITENESS * variance));
}

/* Takes the block or not. */
static void end_block(pvid_refine_f32 *self)
{
    const pvid_refine_config_f32 *config = &self->config;
    const float square = mean_square(self);
    const float past = self->kept * self->kept; /* the clash is to be that with all of it */
    const float clash = self->solve.clash / (((float)N * (config->sd[0] * config->sd[0])) * past);
    self->sane = is_sane(self);
    const float room = at_least_one(self->level);
    const bool again = self->again;
    const float limit = again ? (GROWTH_LIMIT * config->chi_max) : config->chi_max;
    const bool taken = self->sane && (square < (limit * room)) &&
                       ((self->taken == 0u) || again || (clash < (config->clash_max * room))) && is_settled(self);
    const uint32_t began = self->begin;
    self->begin += (uint32_t)self->work.step * PVID_REFINE_SUB;
    self->again = false;
    if (taken) {
        accept_block(self, square, clash, again, began);
        self->verdict = (self->taken > 1u) ? PVID_UPDATED : PVID_HELD_UNCERTAIN; /* one block proves little */
    } else {
        self->verdict = (self->taken > 0u) ? PVID_HELD_BLOCK : PVID_HELD_SEARCHING;
        refuse(self, self->sane);
        if (self->taken == 0u) {
            resize(self, self->sane, square);
        }
    }
}

/* ---- jobs ---- */

/* Some jobs of a pass, as far as their signals are there. */
static inline void pass_jobs(pvid_refine_f32 *self)
{
    const pvid_refine_block_f32 block = {self->linear, self->weight, self->begin, self->length};
    const pvid_refine_progress progress =
        pvid_refine_pass_run_f32(&self->work, &self->front, &block, self->config.jobs);
    if (progress == PVID_REFINE_PASS_WAITS) {
        uint32_t step = 0;
        self->waiting = pvid_refine_pass_needs_f32(&self->work, &step);
        self->due = self->begin + step + 1u;
    } else if (progress == PVID_REFINE_PASS_DONE) {
        pvid_refine_solve_begin_f32(&self->solve);
        self->phase = SOLVE;
#if PVID_REFINE_RUNGE_KUTTA
    } else if (progress == PVID_REFINE_PASS_LOST) {
        self->solved = false;
        self->phase = END;
#endif
    } else {
        /* at the next tick */
    }
}

static void solve_job(pvid_refine_f32 *self)
{
    const pvid_refine_solution solution =
        pvid_refine_solve_job_f32(&self->solve, &self->work, self->triangle, self->r, self->linear,
                                  self->config.prior_sd, self->config.step_limit);
    if (solution != PVID_REFINE_SOLVING) {
        self->solved = solution == PVID_REFINE_SOLVED;
        self->phase = self->solved ? MOVE : END;
    }
}

/* Whether the block has had enough passes: until the steps are small, in the track mostly one pass; or the ring would
 * lose it. */
static bool is_enough(const pvid_refine_f32 *self)
{
    const pvid_refine_config_f32 *config = &self->config;
    const bool tracks = (self->taken > 0u) && (self->solve.bend < (SINGLE_PASS_STEP * config->step_max));
    const bool small = (tracks || (self->pass >= config->passes)) && is_settled(self);
    return small || (self->pass >= config->most_passes) || !lasts(self, self->length);
}

/* Whether there is time for a block twice as long. */
static bool may_grow(const pvid_refine_f32 *self, uint32_t twice)
{
    return (PVID_REFINE_RUNGE_KUTTA == 0) || lasts(self, twice);
}

/* Whether a block of a search goes on twice as long. */
static bool grows(const pvid_refine_f32 *self)
{
    const pvid_refine_config_f32 *config = &self->config;
    const uint32_t twice = 2u * (uint32_t)self->length;
    return (self->taken == 0u) && (self->pass >= 2u) && (twice < config->block) && may_grow(self, twice) &&
           (self->solve.size < UNCONVERGED_STEP) && (mean_square(self) < (GROWTH_LIMIT * config->chi_max));
}

/* The point of linearisation and the start move by the steps. */
static void move(pvid_refine_f32 *self)
{
#if PVID_REFINE_HAS_MEASURED
    if (is_off(self)) {
        forget_state(self);
        begin_block(self);
        return;
    }
#endif
    float moved[N];
    pvid_refine_move_f32(self->linear, self->solve.step, moved);
#if PVID_REFINE_WIDTHS > 0
    for (size_t i = 0; i < PVID_REFINE_WIDTHS; i++) {
        const float least = LEAST_WIDTH * self->config.width[i];
        moved[i] = (moved[i] > least) ? moved[i] : least;
    }
#endif
    memcpy(self->linear, moved, sizeof self->linear);
    for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
        self->start[i] += self->solve.shift[i];
    }
#if PVID_REFINE_SIGNS == 0
    if (self->pass == 0u) {
        size_t place = 0;
        for (size_t i = 0; i < N; i++) {
            self->diagonal[i] = self->solve.triangle[place];
            place += N - i;
        }
    }
#endif
    self->pass++;
    if (grows(self)) {
        self->length = (uint16_t)(2u * self->length);
        self->pass = 0;
        begin_pass(self);
    } else if (is_enough(self)) {
        self->phase = END;
    } else if ((self->taken == 0u) && self->renewed && !(self->solve.size < RESTART_STEP)) {
        self->lost = 1;
        self->length = self->config.first_block;
        self->verdict = PVID_HELD_SEARCHING;
        self->phase = NEXT;
    } else {
        begin_pass(self);
    }
}

/* When the motion has decayed, the last blocks add little to the estimate: the scatter of all blocks counts too. */
static float clash_of(const pvid_refine_f32 *self)
{
    return (self->clash > self->scatter) ? self->clash : self->scatter;
}

/* Variance of a row for the standard errors. A block fits with errors of its equations as well, which then differ from
 * block to block: the scatter of the blocks about their past counts where it is larger than that of the residuals. */
static float variance_of_row(const pvid_refine_f32 *self)
{
    const float level = at_least_one(self->level);
    const float clash = clash_of(self);
    float larger = (clash > level) ? clash : level;
#if PVID_REFINE_SIGNS > 0
    larger = (larger > REVERSAL_VARIANCE) ? larger : REVERSAL_VARIANCE;
#endif
    return (self->config.sd[0] * self->config.sd[0]) * larger;
}

/* A column of the covariance. */
static void assess(pvid_refine_f32 *self)
{
    if (self->pass == 0u) {
        pvid_refine_assess_begin_f32(&self->work.sums.candidate);
    }
    pvid_refine_assess_column_f32(&self->work.sums.candidate, self->solve.triangle, self->pass, variance_of_row(self));
    self->pass++;
    self->phase = (self->pass < N) ? ASSESS : JUDGE;
}

static void publish(pvid_refine_f32 *self)
{
    if (self->verdict == PVID_UPDATED) {
        pvid_count_up(&self->published);
        if ((PVID_SHARED != 0) && (self->shared != NULL)) {
            pvid_refine_add_shared_f32(&self->work.sums.candidate, self->shared);
        }
        pvid_publication_write(&self->mark, &self->estimate, &self->copy, &self->work.sums.candidate,
                               sizeof self->work.sums.candidate, self->published);
    }
}

/* Withdraws the published estimate if the last block refutes it: one that was not taken in the track does not yet. */
static void withdraw(pvid_refine_f32 *self)
{
    const bool stands = (self->verdict == PVID_UPDATED) || ((self->verdict == PVID_HELD_BLOCK) && (self->taken > 0u));
    if (!stands && (self->mark.number[0] > 0u)) {
        pvid_publication_write(&self->mark, &self->estimate, &self->copy, &self->estimate, 0, 0);
    }
}

/* Where the first block begins: it need not wait for new samples. */
static uint32_t recent(const pvid_refine_front_f32 *front)
{
    const uint32_t first = pvid_refine_front_first_f32(front);
    const uint32_t end = pvid_refine_front_end_f32(front);
    return (end > (first + WEAK_AGE_MAX)) ? (end - WEAK_AGE_MAX) : first;
}

/* The next block. A search that is lost begins anew from the weak form's newest estimate. */
static void next_block(pvid_refine_f32 *self)
{
    if ((self->taken == 0u) && (self->lost > 0u)) {
        if (self->renewed && (self->length == self->config.first_block)) {
            begin_anew_in_the_past(self);
        } else if (self->lost >= LOST_MOST) {
            begin_anew(self);
        } else {
            /* it goes on */
        }
    }
    begin_block(self);
}

/* The jobs that are not a pass's. */
PVID_COLD static pvid_reason seldom(pvid_refine_f32 *self)
{
    pvid_reason reason = PVID_ACCUMULATED;
    switch (self->phase) {
#if PVID_REFINE_HAS_MEASURED
    case START:
        start_job(self);
        break;
#endif
    case SOLVE:
        for (uint32_t left = SOLVE_JOBS(self); (left > 0u) && (self->phase == (uint8_t)SOLVE); left--) {
            solve_job(self);
        }
        break;
    case MOVE:
        move(self);
        break;
    case END:
        end_block(self);
        self->phase = FOLLOW;
        break;
    case FOLLOW:
        follow(self);
        self->pass = 0;
        self->phase = (self->verdict == PVID_UPDATED) ? ASSESS : NEXT;
        break;
    case ASSESS:
        assess(self);
        break;
    case JUDGE:
        pvid_refine_assess_end_f32(&self->work.sums.candidate, self->r, self->level, clash_of(self));
        self->verdict = pvid_refine_verdict_f32(&self->work.sums.candidate, &self->config, self->weak, self->weak_se);
        self->phase = PUBLISH;
        break;
    case PUBLISH:
        publish(self);
        self->phase = NEXT;
        break;
    case NEXT:
        reason = self->verdict;
        self->told = reason;
        withdraw(self);
        next_block(self);
        break;
    default:
        reason = PVID_WARMING_UP;
        if (self->renewed) {
            self->begin = recent(&self->front);
            self->origin = pvid_refine_front_first_f32(&self->front);
            begin_search(self);
            begin_anew(self);
            begin_block(self);
        }
        break;
    }
    return reason;
}

PVID_NOINLINE static pvid_reason work(pvid_refine_f32 *self)
{
    if (self->phase != (uint8_t)PASS) {
        return seldom(self);
    }
    pass_jobs(self);
    return PVID_ACCUMULATED;
}

/* ---- API ---- */

PVID_COLD pvid_status pvid_refine_init_f32(pvid_refine_f32 *self, const pvid_refine_config_f32 *config, size_t samples,
                                           const float shared[])
{
    pvid_status status = pvid_init_is_given(self, config) ? pvid_refine_valid_f32(config, samples) : PVID_BAD_POINTER;
    if ((status == PVID_OK) && !pvid_trust_shared_are_valid_f32(shared, PVID_REFINE_P)) {
        status = PVID_BAD_SHARED;
    }
    if (status == PVID_OK) {
        memset(self, 0, sizeof *self);
        self->config = *config;
        self->shared = shared;
        self->h = (float)config->ratio / config->sample_rate_hz;
        const float seconds = (float)config->block * ((float)PVID_REFINE_SUB * self->h);
        self->fade = 1.0f;
        if (config->forgetting_s > 0.0f) {
            const float share = seconds / (2.0f * config->forgetting_s);
            self->fade = (share < 0.9f) ? (1.0f - share) : 0.1f;
        }
        for (size_t i = 0; i < PVID_REFINE_OUTPUTS; i++) {
            self->weight[i] = config->sd[0] / config->sd[i];
        }
        pvid_refine_front_init_f32(&self->front, config);
        self->phase = WAIT;
        self->told = PVID_WARMING_UP;
    }
    return pvid_init_end(self, sizeof *self, status);
}

/* Restarts the block with what the ring will contain. */
PVID_COLD static void restart(pvid_refine_f32 *self)
{
    pvid_refine_front_reset_f32(&self->front, &self->config);
    self->plain = false;
    self->begin = pvid_refine_front_first_f32(&self->front);
    self->origin = self->begin;
    self->again = false;
    forget_state(self);
    if (self->phase != (uint8_t)WAIT) {
        begin_block(self);
    }
}

void pvid_refine_gap_f32(pvid_refine_f32 *self)
{
    if (is_ready(self)) {
        restart(self);
    }
}

void pvid_refine_freeze_f32(pvid_refine_f32 *self, bool frozen)
{
    if (is_ready(self)) {
        self->frozen = frozen;
        self->plain = false;
    }
}

static pvid_reason idle(const pvid_refine_f32 *self)
{
    return (self->phase == (uint8_t)WAIT) ? PVID_WARMING_UP : PVID_ACCUMULATED;
}

/* The jobs of a tick: not while the weak form is busy, but not too often. */
static inline pvid_reason work_unless(pvid_refine_f32 *self, bool busy)
{
    if (self->waiting) {
        return PVID_ACCUMULATED;
    }
    self->busy = busy;
    if (busy && (self->rested < self->config.rests)) {
        self->rested++;
        return idle(self);
    }
    self->rested = 0;
    return work(self);
}

/* The last tick of a step: of its own it has no jobs. */
PVID_NOINLINE static pvid_reason end_step(pvid_refine_f32 *self, const float sample[], bool busy)
{
    const pvid_refine_entry entry = pvid_refine_front_end_block_f32(&self->front, &self->config, sample);
    if (entry == PVID_REFINE_BROKEN) {
        restart(self);
        return PVID_REJECTED_NOT_FINITE;
    }
    if (self->frozen) {
        return PVID_HELD_FROZEN;
    }
    self->waiting = self->waiting && (pvid_refine_front_end_f32(&self->front) < self->due);
    return (self->config.ratio == 1u) ? work_unless(self, busy) : idle(self);
}

/* A tick with a new estimate of the weak form, the first one, one while it is frozen. */
PVID_COLD static pvid_reason odd_step(pvid_refine_f32 *self, const float sample[], const pvid_estimate_f32 *weak,
                                      bool busy)
{
    if (weak != NULL) {
        take_weak(self, weak);
    }
    if (!self->front.referred) {
        pvid_refine_front_refer_f32(&self->front, &self->config, sample);
    }
    self->plain = !self->frozen;
    if (pvid_refine_front_add_f32(&self->front, sample)) {
        return end_step(self, sample, busy);
    }
    return self->frozen ? PVID_HELD_FROZEN : work_unless(self, busy);
}

/* A tick of the weak form's second stage, whose pointers are given. */
static pvid_reason step_of_stage(pvid_refine_f32 *self, const float sample[], const pvid_estimate_f32 *weak, bool busy)
{
    if ((weak != NULL) || !self->plain) {
        return odd_step(self, sample, weak, busy);
    }
    if (pvid_refine_front_add_f32(&self->front, sample)) {
        return end_step(self, sample, busy);
    }
    return work_unless(self, busy);
}

pvid_reason pvid_refine_step_f32(pvid_refine_f32 *self, const float sample[], const pvid_estimate_f32 *weak, bool busy)
{
    return (is_ready(self) && (sample != NULL)) ? step_of_stage(self, sample, weak, busy) : PVID_NOT_READY;
}

const pvid_weak_refiner_f32 pvid_refiner_f32 = {
    .init = pvid_refine_init_f32,
    .step = step_of_stage,
    .gap = pvid_refine_gap_f32,
    .freeze = pvid_refine_freeze_f32,
};

const pvid_refine_estimate_f32 *pvid_refine_latest_f32(const pvid_refine_f32 *self)
{
    return (is_ready(self) && (self->mark.number[0] > 0u)) ? &self->estimate : NULL;
}

pvid_reason pvid_refine_reason_f32(const pvid_refine_f32 *self)
{
    return is_ready(self) ? self->told : PVID_NOT_READY;
}

bool pvid_refine_read_f32(const pvid_refine_f32 *self, pvid_refine_estimate_f32 *estimate, uint32_t *number)
{
    if (!is_ready(self) || (estimate == NULL)) {
        return false;
    }
    return pvid_publication_read(&self->mark, &self->estimate, &self->copy, estimate, sizeof *estimate, number);
}
