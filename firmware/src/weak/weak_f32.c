#include "number/uncontracted.h"

#include "pvid/weak.h"

#include <stddef.h>
#include <string.h>

#include "judge/outcome.h"
#include "judge/publication.h"
#include "judge/standing.h"
#include "number/count.h"
#include "number/finite_f32.h"
#include "number/init.h"
#include "number/unroll.h"
#include "weak/steps.h"
#include "weak/sums_f32.h"
#include "weak/ticks_f32.h"
#include "weak/valid_f32.h"
#include "weak/limits_f32.h"
#include "weak/weak_finish_f32.h"
#include "weak/weak_front_f32.h"
#include "weak/weak_signals.h"
#include "weak/weak_step_f32.h"
#include "weak/white_f32.h"

/* The largest finite number. */
#define LARGEST 3.40282347e38f

/* Tasks, beside the reasons of a tick that has none: stages of a window; a block is added, or a window joined; the
 * channels of a step are formed. */
#define TASK_PROCESS 255u
#define TASK_ADD 254u
#define TASK_FORM 253u

static inline bool all_finite(const float values[], size_t n)
{
    bool finite = true;
    for (size_t i = 0; i < n; i++) {
        finite = finite && pvid_finite_f32(values[i]);
    }
    return finite;
}

PVID_COLD static pvid_status limits_are_valid(const pvid_weak_config_f32 *config)
{
    for (size_t i = 0; i < config->design->model->samples; i++) {
        if ((config->range != NULL) && !pvid_within_f32(config->range[i], 1.0e-30f, 3.4e38f)) {
            return PVID_BAD_RANGE;
        }
        if ((config->drive_min != NULL) && !pvid_within_f32(config->drive_min[i], 0.0f, 1.0e9f)) {
            return PVID_BAD_DRIVE_MIN;
        }
    }
    return PVID_OK;
}

PVID_COLD static pvid_status init_estimator(pvid_weak_f32 *self, const pvid_weak_config_f32 *config)
{
    const pvid_weak_design_f32 *design = config->design;
    const pvid_weak_model_f32 *model = design->model;
    float nuisances = 0.0f;
    for (size_t i = 0; i < model->kinds; i++) {
        nuisances += (float)model->kind[i].nuisances;
    }
    const float functions = (float)design->functions * (float)model->kinds;
    pvid_estimator_config_f32 estimator = config->estimator;
    estimator.model = model->model;
    estimator.update_rate_hz = config->sample_rate_hz / ((float)design->decimation * (float)design->hop);
    estimator.row_weight = (functions - nuisances) / functions;
    estimator.correlation = design->overlap;
    return pvid_estimator_init_f32(&self->estimator, &estimator);
}

/* Channels that are summed: up to the last one that is not the constant. */
static uint8_t summed_channels(const pvid_weak_model_f32 *model)
{
    uint8_t channels = 0;
    for (size_t i = 0; i < model->channels; i++) {
        channels = (model->channel[i].gain != PVID_WEAK_NONE) ? (uint8_t)(i + 1u) : channels;
    }
    return channels;
}

/* Steps from a sample to the last step that contains it: its own block and the next, the compensator, two more before
 * the channels; signals of several samples. */
static uint16_t delay_of(const pvid_weak_design_f32 *design)
{
    return (uint16_t)((2u * pvid_weak_front_half_f32(design)) + 8u);
}

/* Returns whether init has accepted a configuration. */
static inline bool is_ready(const pvid_weak_f32 *self)
{
    const bool ready = (self != NULL) && (self->design != NULL);
    PVID_ASSERT(ready);
    return ready;
}

/* This tick has more to do than to take its samples. */
static inline void mark_busy(pvid_weak_f32 *self)
{
    self->busy = (PVID_REFINEMENT != 0) || self->busy;
}

/* Returns whether a tick only adds its samples. */
static inline bool is_plain(const pvid_weak_f32 *self)
{
    return (PVID_EXACT != 0) ? (PVID_EXACT_PLAIN != 0) : self->front.plain;
}

/* Returns whether there is a second stage. */
static inline bool refines(const pvid_weak_f32 *self)
{
    return (PVID_REFINEMENT != 0) && (self->refine != NULL);
}

/* Reason of a tick without anything else to report. */
static inline pvid_reason idle(const pvid_weak_f32 *self)
{
    return self->warm ? PVID_ACCUMULATED : PVID_WARMING_UP;
}

/* H + 1. */
static inline uint8_t harmonics_of(const pvid_weak_f32 *self)
{
    return (PVID_EXACT != 0) ? (uint8_t)PVID_MAX_HARMONICS : self->harmonics;
}

/* Sets what a tick that ends no step has to do. */
PVID_NOINLINE static void choose_task(pvid_weak_f32 *self)
{
    if (pvid_weak_sums_is_busy_f32(&self->sums, harmonics_of(self))) {
        self->task = TASK_ADD;
    } else {
        self->task = pvid_weak_finish_is_busy_f32(&self->finish) ? TASK_PROCESS : (uint8_t)idle(self);
    }
}

PVID_COLD static void restart(pvid_weak_f32 *self)
{
    pvid_weak_front_reset_f32(&self->front);
    pvid_weak_step_reset_f32(&self->history);
    pvid_weak_sums_reset_f32(&self->sums, self->harmonics);
    pvid_weak_limits_reset_f32(&self->limits);
    pvid_weak_finish_skip_f32(&self->finish);
    self->warm = false;
    choose_task(self);
}

/* Ticks in which the estimate becomes older by a window. */
static inline uint32_t ticks_of_window(const pvid_weak_f32 *self)
{
    return (uint32_t)self->design->hop * self->design->decimation;
}

/* Behind a window that is in the age, or was published. */
static void count_window(pvid_weak_f32 *self)
{
    self->ticks = pvid_standing_uncounted(&self->trust.standing, self->ticks, ticks_of_window(self));
}

/* A restart: the ticks that no window has counted make the estimate older, and so does the one that is missing. */
PVID_COLD static void lose(pvid_weak_f32 *self)
{
    const pvid_weak_front_f32 *front = &self->front;
    if ((front->needs == PVID_WEAK_NEEDS_NEXT) && front->seen) {
        self->ticks++; /* the first one, which is no block's */
    }
    self->ticks += (front->decimation + 1u) - front->wait;
    restart(self);
    const uint32_t windows = self->ticks / ticks_of_window(self);
    self->ticks -= windows * ticks_of_window(self);
    for (uint32_t left = windows; left > 0u; left--) {
        pvid_trust_skip_f32(&self->trust, false);
    }
}

static pvid_status init_refinement(pvid_weak_f32 *self, const pvid_weak_refine_f32 *refine)
{
    if (refine == NULL) {
        return PVID_OK;
    }
    if ((PVID_REFINEMENT == 0) || (refine->refiner == NULL)) {
        return PVID_BAD_POINTER;
    }
    self->refine = refine;
    return refine->refiner->init(refine->storage, refine->config, self->design->model->samples,
                                 self->trust.config.shared);
}

/* That add a block and join a window. */
static uint32_t joining_ticks(const pvid_weak_f32 *self)
{
    return ((2u * (uint32_t)self->harmonics) + (self->items_per_tick - 1u)) / self->items_per_tick;
}

/* Returns whether the sums of a window have a place of their own, or are used before the next half's first block. */
static bool window_has_place(const pvid_weak_f32 *self, uint32_t free_ticks)
{
#if PVID_MAX_WINDOWS > 0
    (void)self;
    (void)free_ticks;
    return true;
#else
    return pvid_weak_finish_columns_f32(self) <= (self->stages_per_tick * (free_ticks - joining_ticks(self)));
#endif
}

PVID_COLD static pvid_status prepare(pvid_weak_f32 *self, const pvid_weak_config_f32 *config)
{
    const pvid_weak_design_f32 *design = config->design;
    if (!pvid_within_f32(config->sample_rate_hz, 1.0e-3f, 1.0e6f)) {
        return PVID_BAD_SAMPLE_RATE;
    }
    pvid_status status = pvid_weak_valid_f32(design);
    if (status != PVID_OK) {
        return status;
    }
    status = limits_are_valid(config);
    if (status != PVID_OK) {
        return status;
    }
    memset(self, 0, sizeof *self);
    status = init_estimator(self, config);
    if (status != PVID_OK) {
        return status;
    }
    status = pvid_trust_init_f32(&self->trust, &config->trust, &self->estimator);
    if (status != PVID_OK) {
        return status;
    }
    if ((config->iterations < 1u) || (config->iterations > PVID_MAX_ITERATIONS)) {
        return PVID_BAD_ITERATIONS;
    }
    self->dt = (float)design->decimation / config->sample_rate_hz;
    status = pvid_weak_finish_init_f32(&self->finish, config, self->dt);
    if (status != PVID_OK) {
        return status;
    }
    self->design = design;
    self->harmonics = (uint8_t)((design->functions / 2u) + (design->power / 2u) + 1u);
    self->channels = summed_channels(design->model);
    self->iterations = (uint8_t)((self->estimator.settings.gain < 1.0f) ? 1u : config->iterations);
    pvid_weak_front_init_f32(&self->front, design, config->sample_rate_hz);
    pvid_weak_step_init_f32(&self->history, (float)pvid_weak_front_lead_f32(&self->front) / config->sample_rate_hz);
    pvid_weak_limits_init_f32(&self->limits, config, delay_of(design));
    self->has_limits = (config->range != NULL) || (self->limits.moves != 0u);
    self->samples = design->model->samples;
    if ((PVID_EXACT != 0) &&
        ((self->channels != PVID_EXACT_CHANNELS) || (self->front.plain != (PVID_EXACT_PLAIN != 0)))) {
        return PVID_BAD_DESIGN;
    }
    for (size_t i = 0; i < design->model->samples; i++) {
        self->front.limit[i] = pvid_weak_front_limit_f32((config->range != NULL) ? config->range[i] : LARGEST);
    }
    const uint32_t free_ticks = pvid_weak_free_ticks_f32(pvid_weak_decimation(design->decimation));
    if (pvid_weak_blocks_f32(free_ticks, self->harmonics) > (uint32_t)PVID_MAX_BLOCKS) {
        return PVID_BAD_DESIGN;
    }
    self->items_per_tick = pvid_weak_items_f32(free_ticks, self->harmonics);
    const uint32_t stages = pvid_weak_finish_stages_f32(self);
    self->stages_per_tick = pvid_weak_stages_f32(stages, design->hop, free_ticks, self->harmonics);
    if (self->stages_per_tick == 0u) {
        return PVID_BAD_ITERATIONS;
    }
    self->pace = pvid_weak_pace(stages, pvid_weak_finish_columns_f32(self), design->hop / PVID_WEAK_BLOCK,
                                PVID_WEAK_BLOCK, free_ticks / PVID_WEAK_BLOCK, joining_ticks(self));
    if (!window_has_place(self, free_ticks)) {
        return PVID_BAD_DESIGN;
    }
    restart(self);
    return init_refinement(self, config->refine);
}

pvid_status pvid_weak_init_layout_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config, uint32_t layout)
{
    if (layout != PVID_LAYOUT) {
        return PVID_BAD_LAYOUT;
    }
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

void pvid_weak_gap_f32(pvid_weak_f32 *self)
{
    if (is_ready(self)) {
        lose(self);
        if (refines(self)) {
            self->refine->refiner->gap(self->refine->storage);
        }
    }
}

void pvid_weak_freeze_f32(pvid_weak_f32 *self, bool frozen)
{
    if (is_ready(self)) {
        self->frozen = frozen;
        if (refines(self)) {
            self->refine->refiner->freeze(self->refine->storage, frozen);
        }
    }
}

/* The reason why a complete window is dropped; PVID_ACCUMULATED if it is used. */
PVID_COLD static pvid_reason drop_reason(pvid_weak_f32 *self)
{
    if (self->frozen) {
        return PVID_HELD_FROZEN;
    }
    if (pvid_weak_limits_beyond_f32(&self->limits)) {
        pvid_count_up(&self->estimator.counters.held_out_of_range);
        return PVID_HELD_OUT_OF_RANGE;
    }
    if (pvid_weak_limits_still_f32(&self->limits)) {
        pvid_count_up(&self->estimator.counters.held_not_excited);
        return PVID_HELD_NOT_EXCITED;
    }
    return PVID_ACCUMULATED;
}

/* Behind the channels of a step, the block's end; if they complete a window that is dropped, returns the reason; else
 * PVID_ACCUMULATED. */
PVID_NOINLINE static pvid_reason end_half(pvid_weak_f32 *self)
{
    if (self->sums.halves < 2u) {
        return PVID_ACCUMULATED;
    }
    self->warm = true;
    const pvid_reason reason = drop_reason(self);
    if (reason == PVID_ACCUMULATED) {
        pvid_weak_sums_join_f32(&self->sums, self->history.edge);
    } else {
        pvid_weak_finish_skip_f32(&self->finish);
        pvid_trust_skip_f32(&self->trust, false);
        count_window(self);
    }
    return reason;
}

/* The channels of a step to the present block. */
PVID_NOINLINE static pvid_reason form_channels(pvid_weak_f32 *self)
{
    mark_busy(self);
    const pvid_weak_design_f32 *design = self->design;
    const uint16_t index = self->sums.index;
    pvid_reason dropped = PVID_ACCUMULATED;
    if (pvid_weak_step_take_f32(&self->history, design, self->dt, index, pvid_weak_sums_place_f32(&self->sums))) {
        if ((index + 1u) == design->hop) {
            self->limits.doubt[self->sums.half] = (PVID_WEAK_DOUBT * (uint32_t)self->history.doubts) > design->hop;
        }
        if (pvid_weak_sums_count_f32(&self->sums, design->hop, self->channels)) {
            dropped = end_half(self);
        }
    }
    self->task =
        pvid_weak_sums_is_busy_f32(&self->sums, harmonics_of(self)) ? (uint8_t)TASK_ADD : self->task_after_step;
    return (dropped != PVID_ACCUMULATED) ? dropped : idle(self);
}

/* A sample that is not finite. */
PVID_COLD static pvid_reason reject(pvid_weak_f32 *self)
{
    lose(self);
    pvid_count_up(&self->estimator.counters.rejected_not_finite);
    return PVID_REJECTED_NOT_FINITE;
}

/* Harmonics that a tick adds or joins. */
static inline uint32_t items_of(const pvid_weak_f32 *self)
{
    return (PVID_EXACT != 0)
               ? pvid_weak_items_f32(pvid_weak_free_ticks_f32(PVID_MAX_DECIMATION), (uint32_t)PVID_MAX_HARMONICS)
               : self->items_per_tick;
}

/* In each of these ticks some harmonics of the last block are added, or of the last window joined. Returns the ticks
 * that are left behind the last one. */
PVID_NOINLINE static uint32_t add_harmonics(pvid_weak_f32 *self, uint32_t ticks)
{
    mark_busy(self);
    pvid_weak_sums_f32 *sums = &self->sums;
    const uint8_t harmonics = harmonics_of(self);
    uint32_t left = ticks;
    while ((left > 0u) && pvid_weak_sums_is_busy_f32(sums, harmonics)) {
        for (uint32_t more = items_of(self); (more > 0u) && pvid_weak_sums_is_busy_f32(sums, harmonics); more--) {
            if (!pvid_weak_sums_joins_f32(sums)) {
                pvid_weak_sums_add_f32(sums, self->design, self->channels);
                continue;
            }
            pvid_weak_sums_join_one_f32(sums, self->design, self->channels, self->dt, pvid_weak_window_f32(self));
            if (sums->joined == harmonics) {
                pvid_weak_finish_begin_f32(&self->finish);
            }
        }
        left--;
    }
    if (!pvid_weak_sums_is_busy_f32(sums, harmonics)) {
        choose_task(self);
    }
    return left;
}

/* So many stages of the last whole window; nothing is left to do behind its last one. Returns the
 * reason of them and those before. */
PVID_NOINLINE static pvid_reason process_window(pvid_weak_f32 *self, uint32_t stages, pvid_reason before)
{
    mark_busy(self);
    pvid_weak_finish_run_f32(self, stages);
    if (!pvid_weak_finish_is_busy_f32(&self->finish)) {
        count_window(self);
        choose_task(self);
    }
    const pvid_reason report = (pvid_reason)self->finish.report;
    if (report == PVID_ACCUMULATED) {
        return before;
    }
    self->finish.report = (uint8_t)PVID_ACCUMULATED;
    return pvid_outcome(before, report);
}

/* The tasks of so many ticks, at least one, which end no block. Returns the reason of them and those before. */
PVID_ALWAYS_INLINE pvid_reason run_tasks(pvid_weak_f32 *self, uint32_t ticks, pvid_reason before)
{
    pvid_reason reason = before;
    uint32_t left = ticks;
    if (self->task == TASK_FORM) {
        reason = pvid_outcome(reason, form_channels(self));
        left--;
    }
    if ((left > 0u) && (self->task == TASK_ADD)) {
        left = add_harmonics(self, left);
    }
    if ((left == 0u) || (self->task != TASK_PROCESS)) {
        return reason;
    }
    const uint32_t last = (self->front.wait > 0u) ? (self->front.wait - 1u) : 0u; /* 0: the step's last tick follows */
    const uint32_t stages = (((last + left) >> self->pace) - (last >> self->pace)) * self->stages_per_tick;
    return (stages > 0u) ? process_window(self, stages, reason) : reason;
}

/* That of a tick. */
PVID_NOINLINE static pvid_reason run_task(pvid_weak_f32 *self)
{
    return run_tasks(self, 1, idle(self));
}

/* The samples of the tick of a step, whose channels follow. */
static void check_limits(pvid_weak_f32 *self, const float sample[])
{
    const pvid_weak_design_f32 *design = self->design;
    const uint16_t index = self->sums.index;
    const size_t half = self->sums.half;
    pvid_weak_limits_step_f32(&self->limits, design->model->samples, sample, half, index == 0u);
    if (index + 1u == design->hop) {
        pvid_weak_limits_half_f32(&self->limits, design->model->samples, half, design->hop);
    }
}

/* A block before the first step of a run. */
PVID_COLD static void begin_run(pvid_weak_f32 *self)
{
    float *jet = self->history.inputs[self->history.newest];
    bool first = false;
    if (pvid_weak_front_early_f32(&self->front, self->design, jet, &first)) {
        pvid_weak_step_begin_f32(&self->history, self->design, self->dt, jet, first);
    }
}

/* The last tick of a block. */
PVID_NOINLINE static pvid_reason end_block(pvid_weak_f32 *self, const float sample[])
{
    const uint8_t decimation = pvid_weak_decimation(self->front.decimation);
    self->ticks += decimation;
    const bool steps = pvid_weak_front_step_f32(&self->front, self->design, self->history.inputs[self->history.newest]);
    self->task_after_step = self->task;
    if (!steps && !self->history.ran && (PVID_COUNT(PVID_EXACT_RUNS, self->design->model->runs) > 0u)) {
        begin_run(self);
    }
    if (steps && self->has_limits && (self->history.known > 1u)) {
        check_limits(self, sample);
    }
    if (steps && (decimation >= PVID_WEAK_TWO_TICKS)) {
        self->task = TASK_FORM;
        return idle(self);
    }
    const pvid_reason reason = steps ? form_channels(self) : idle(self);
    return (decimation == 1u) ? run_tasks(self, 1, reason) : reason;
}

/* What a tick does after its samples. */
static inline pvid_reason end_tick(pvid_weak_f32 *self, const float sample[])
{
    self->front.wait--;
    if (self->front.wait == 0u) {
        return end_block(self, sample);
    }
    const uint32_t task = self->task;
    if (PVID_LIKELY(task < TASK_FORM)) {
        return (pvid_reason)task;
    }
    if (task != TASK_PROCESS) {
        return run_task(self);
    }
    return pvid_weak_rests(self->front.wait, self->pace) ? idle(self)
                                                         : process_window(self, self->stages_per_tick, idle(self));
}

/* Of samples with one that is not finite or beyond its range: returns whether all are finite. */
static bool are_finite(pvid_weak_f32 *self, const float sample[])
{
    const bool finite = all_finite(sample, self->design->model->samples);
    if (finite) {
        self->limits.beyond = self->limits.delay;
    }
    return finite;
}

/* Adds finite samples to the block. */
static inline void add_samples(pvid_weak_f32 *self, const float sample[])
{
#if !PVID_EXACT_PLAIN
    if (!is_plain(self)) {
        pvid_weak_front_derive_f32(&self->front, self->design->model, sample);
        return;
    }
#endif
    pvid_weak_front_add_f32(self->front.line, self->samples, sample);
}

/* A tick with a sample that is not finite or beyond its range. */
PVID_COLD static pvid_reason odd_tick(pvid_weak_f32 *self, const float sample[])
{
    if (!is_ready(self)) {
        return PVID_NOT_READY;
    }
    if (!are_finite(self, sample)) {
        return reject(self);
    }
    add_samples(self, sample);
    return end_tick(self, sample);
}

/* A tick of the weak form. */
PVID_ALWAYS_INLINE pvid_reason weak_tick(pvid_weak_f32 *self, const float sample[])
{
    if (!pvid_weak_front_fits_f32(self->front.limit, self->samples, sample)) {
        return odd_tick(self, sample);
    }
    add_samples(self, sample);
    return end_tick(self, sample);
}

/* Reasons of a tick with a new estimate for the second stage. */
#define RENEWING ((1uL << PVID_UPDATED) | (1uL << PVID_MISFIT) | (1uL << PVID_HELD_UNCERTAIN))

/* A tick of both stages: the second one knows at which the first one has more to do than to take a sample. */
PVID_NOINLINE static pvid_reason both_ticks(pvid_weak_f32 *self, const float sample[])
{
    self->busy = false;
    const pvid_reason reason = weak_tick(self, sample);
    const bool renewed = ((RENEWING >> (uint32_t)reason) & 1u) != 0u;
    (void)self->refine->refiner->step(self->refine->storage, sample, renewed ? &self->finish.candidate : NULL,
                                      self->busy);
    return reason;
}

pvid_reason pvid_weak_step_f32(pvid_weak_f32 *self, const float sample[])
{
    if ((self == NULL) || (sample == NULL)) {
        PVID_ASSERT(false);
        return PVID_NOT_READY;
    }
    return refines(self) ? both_ticks(self, sample) : weak_tick(self, sample);
}

/* Adds the samples of at most so many ticks of a block of steps, up to the first with one that is not finite or beyond
 * its range. Returns of how many. */
static inline uint32_t add_ticks(pvid_weak_f32 *self, const float samples[], uint32_t most)
{
    uint32_t added = 0;
#if !PVID_EXACT_PLAIN
    while (!is_plain(self) && (added < most) &&
           pvid_weak_front_fits_f32(self->front.limit, self->samples, &samples[added * self->samples])) {
        pvid_weak_front_derive_f32(&self->front, self->design->model, &samples[added * self->samples]);
        added++;
    }
#endif
    if (is_plain(self)) {
        added = pvid_weak_front_add_ticks_f32(&self->front, self->samples, samples, most);
    }
    self->front.wait -= added;
    return added;
}

/* Ticks of the weak form. */
static pvid_reason weak_ticks(pvid_weak_f32 *self, const float samples[], uint32_t count)
{
    const size_t width = self->samples;
    const float *sample = samples;
    uint32_t left = count;
    pvid_reason reason = idle(self);
    while (left > 0u) {
        const uint32_t most = (left < self->front.wait) ? left : self->front.wait;
        const uint32_t added = add_ticks(self, sample, most);
        const bool ends = self->front.wait == 0u;
        sample = &sample[added * width];
        left -= added;
        const uint32_t between = added - (ends ? 1u : 0u);
        if (between > 0u) {
            reason = run_tasks(self, between, reason);
        }
        if (ends) {
            reason = pvid_outcome(reason, end_block(self, sample - width));
        }
        if (added < most) {
            reason = pvid_outcome(reason, odd_tick(self, sample));
            sample = &sample[width];
            left--;
        }
    }
    return reason;
}

pvid_reason pvid_weak_step_block_f32(pvid_weak_f32 *self, const float samples[], uint32_t count)
{
    if (!is_ready(self) || (samples == NULL)) {
        return PVID_NOT_READY;
    }
    if (!refines(self)) {
        return weak_ticks(self, samples, count);
    }
    pvid_reason reason = idle(self);
    for (uint32_t k = 0; k < count; k++) {
        reason = pvid_outcome(reason, both_ticks(self, &samples[(size_t)k * self->samples]));
    }
    return reason;
}

const pvid_estimate_f32 *pvid_weak_candidate_f32(const pvid_weak_f32 *self)
{
    return (self != NULL) ? &self->finish.candidate : NULL;
}

const pvid_estimate_f32 *pvid_weak_estimate_f32(const pvid_weak_f32 *self)
{
    return (self != NULL) ? &self->trust.estimate : NULL;
}

bool pvid_weak_read_f32(const pvid_weak_f32 *self, pvid_estimate_f32 *estimate, uint32_t *number)
{
    if (!is_ready(self) || (estimate == NULL)) {
        return false;
    }
    const pvid_trust_f32 *trust = &self->trust;
    return pvid_publication_read(&trust->mark, &trust->estimate, &trust->copy, estimate, sizeof *estimate, number);
}
