#include "pvid/weak_q31.h"

#include <stddef.h>
#include <string.h>

#include "judge/outcome.h"
#include "judge/publication.h"
#include "judge/standing.h"
#include "number/count.h"
#include "number/init.h"
#include "number/integer_q31.h"
#include "number/unroll.h"
#include "weak/accumulator_q31.h"
#include "weak/steps.h"
#include "weak/valid_q31.h"
#include "weak/weak_finish_q31.h"
#include "weak/weak_front_q31.h"
#include "weak/weak_signals.h"

#define COUNTS_LIMIT INT32_C(0x01000000) /* 2^24 */
#define OFFSET_LIMIT ((int32_t)1 << 30)
#define STAGES_MAX 255u
#define ONE_Q16 65536u

/* No reason of a tick: there is work. */
#define BUSY 255u

static bool is_ready(const pvid_weak_q31 *self)
{
    const bool ready = (self != NULL) && (self->design != NULL);
    PVID_ASSERT(ready);
    return ready;
}

static pvid_reason idle_reason(const pvid_weak_q31 *self)
{
    return self->warm ? PVID_ACCUMULATED : PVID_WARMING_UP;
}

/* What a tick does from now on that ends no step. */
static void choose_task(pvid_weak_q31 *self)
{
    const bool busy = (self->accumulator.sums.left > 0u) || pvid_weak_finish_is_busy_q31(&self->finish);
    self->task = (uint8_t)(busy ? BUSY : (uint32_t)idle_reason(self));
}

static void restart(pvid_weak_q31 *self)
{
    pvid_weak_accumulator_reset_q31(&self->accumulator);
    pvid_weak_finish_skip_q31(&self->finish);
    self->warm = false;
    choose_task(self);
}

/* Ticks in which the estimate becomes older by a window. */
static inline uint32_t ticks_of_window(const pvid_weak_q31 *self)
{
    return (uint32_t)self->design->hop * self->design->decimation;
}

/* Behind a window that is in the age, or was published. */
static void count_window(pvid_weak_q31 *self)
{
    self->ticks = pvid_standing_uncounted(&self->trust.standing, self->ticks, ticks_of_window(self));
}

/* A restart: the ticks that no window has counted make the estimate older, and so does the one that is missing. */
PVID_COLD static void lose(pvid_weak_q31 *self)
{
    const pvid_weak_front_q31 *front = &self->accumulator.front;
    if ((front->needs == PVID_WEAK_NEEDS_NEXT) && front->seen) {
        self->ticks++; /* the first one, which is no block's */
    }
    self->ticks += (front->decimation + 1u) - front->wait;
    restart(self);
    const uint32_t windows = self->ticks / ticks_of_window(self);
    self->ticks -= windows * ticks_of_window(self);
    for (uint32_t left = windows; left > 0u; left--) {
        pvid_trust_skip_q31(&self->trust, false);
    }
}

/* Whether the sums of a window are read before others take their place. */
static bool window_fits(const pvid_weak_q31 *self)
{
    return (PVID_MAX_WINDOWS > 0) || (pvid_weak_finish_columns_q31(self) <=
                                      (self->stages_per_tick * pvid_weak_ticks_behind_join_q31(self->design)));
}

static pvid_status prepare(pvid_weak_q31 *self, const pvid_weak_config_q31 *config)
{
    const pvid_weak_design_q31 *design = config->design;
    pvid_status status = pvid_weak_valid_q31(design);
    if (status != PVID_OK) {
        return status;
    }
    if ((config->offset == NULL) || !pvid_weak_blocks_fit_q31(design)) {
        return PVID_BAD_DESIGN;
    }
    for (size_t i = 0; i < design->model->samples; i++) {
        if ((config->offset[i] < -OFFSET_LIMIT) || (config->offset[i] > OFFSET_LIMIT)) {
            return PVID_BAD_DESIGN;
        }
    }
    for (size_t i = 0; (config->drive_min != NULL) && (i < design->model->samples); i++) {
        if ((config->drive_min[i] < 0) || (config->drive_min[i] > COUNTS_LIMIT)) {
            return PVID_BAD_DRIVE_MIN;
        }
    }
    memset(self, 0, sizeof *self);
    pvid_estimator_config_q31 estimator = config->estimator;
    estimator.model = design->model->model;
    estimator.row_weight = ONE_Q16;
    status = pvid_estimator_init_q31(&self->estimator, &estimator);
    if (status != PVID_OK) {
        return status;
    }
    status = pvid_trust_init_q31(&self->trust, &config->trust, &self->estimator);
    if (status != PVID_OK) {
        return status;
    }
    status = pvid_weak_finish_init_q31(&self->finish, config);
    if (status != PVID_OK) {
        return status;
    }
    if ((config->iterations < 1u) || (config->iterations > PVID_MAX_ITERATIONS)) {
        return PVID_BAD_ITERATIONS;
    }
    self->design = design;
    self->drive_min = config->drive_min;
    self->iterations = (uint8_t)((self->estimator.settings.gain < PVID_ONE_Q30) ? 1u : config->iterations);
    pvid_weak_accumulator_init_q31(&self->accumulator, design, config->offset);
    const uint32_t ticks = pvid_weak_free_ticks_q31(design);
    const uint32_t stages = pvid_weak_finish_stages_q31(self);
    const uint32_t each = (ticks > 0u) ? ((stages + (ticks - 1u)) / ticks) : UINT32_MAX;
    self->stages_per_tick = (uint8_t)((each <= STAGES_MAX) ? each : 0u);
    if ((self->stages_per_tick == 0u) || !window_fits(self)) {
        return PVID_BAD_ITERATIONS;
    }
    self->pace = pvid_weak_pace_q31(design, stages, pvid_weak_finish_columns_q31(self));
    self->plain = self->accumulator.front.plain ? design->model->samples : 0u;
    choose_task(self);
    return PVID_OK;
}

pvid_status pvid_weak_init_layout_q31(pvid_weak_q31 *self, const pvid_weak_config_q31 *config, uint32_t layout)
{
    if (layout != PVID_LAYOUT) {
        return PVID_BAD_LAYOUT;
    }
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

/* The counts of the tick in which the channels of a step were made. */
static void add_drive(pvid_weak_q31 *self, bool begins, const int32_t reading[])
{
    pvid_weak_drive_q31 *drive = &self->drive;
    for (size_t i = 0; i < self->design->model->samples; i++) {
        if (self->drive_min[i] > 0) {
            const int32_t x = pvid_weak_count_q31(reading[i], self->accumulator.front.offset[i]);
            drive->sum[i] = (begins ? 0 : drive->sum[i]) + x;
            drive->square[i] = (begins ? 0 : drive->square[i]) + pvid_short_square_q31(x);
        }
    }
}

/* Whether a sample moved less in a half than it must. |counts| <= 2^24 and hop <= 2^12: nothing overflows. */
static bool is_still(const pvid_weak_q31 *self)
{
    const int64_t n = (int64_t)self->design->hop;
    bool still = false;
    for (size_t i = 0; i < self->design->model->samples; i++) {
        const int64_t least = self->drive_min[i];
        if (least > 0) {
            const int64_t sum = self->drive.sum[i];
            const int64_t mean = sum / n;
            const int64_t spread = self->drive.square[i] - (mean * ((2 * sum) - (n * mean)));
            still = still || (spread < (n * (least * least)));
        }
    }
    return still;
}

/* A whole window that is not used. */
static void drop(pvid_weak_q31 *self)
{
    pvid_weak_finish_skip_q31(&self->finish);
    pvid_trust_skip_q31(&self->trust, false);
    count_window(self);
}

/* A whole window. Returns PVID_ACCUMULATED, or the reason why it is dropped. */
static pvid_reason hand_over(pvid_weak_q31 *self)
{
    self->warm = true;
    if (self->frozen) {
        drop(self);
        return PVID_HELD_FROZEN;
    }
    if (self->drive.still[0] || self->drive.still[1]) {
        drop(self);
        pvid_count_up(&self->estimator.counters.held_not_excited);
        return PVID_HELD_NOT_EXCITED;
    }
    pvid_weak_finish_begin_q31(&self->finish);
    return PVID_ACCUMULATED;
}

PVID_NOINLINE static pvid_reason reject(pvid_weak_q31 *self)
{
    lose(self);
    pvid_count_up(&self->estimator.counters.rejected_saturated);
    return PVID_REJECTED_SATURATED;
}

/* The last tick of a step. */
PVID_NOINLINE static pvid_weak_tick end_step(pvid_weak_q31 *self, const int32_t reading[])
{
    const uint16_t index = self->accumulator.values.index;
    const uint8_t half = self->accumulator.values.half;
    self->ticks += self->accumulator.front.decimation;
    const pvid_weak_tick tick = pvid_weak_accumulator_end_q31(&self->accumulator);
    if ((tick != PVID_WEAK_REJECTED) && (self->drive_min != NULL) && (self->accumulator.values.index != index)) {
        add_drive(self, index == 0u, reading);
        if (self->accumulator.values.index == 0u) { /* the half is complete */
            self->drive.still[half] = is_still(self);
        }
    }
    return tick;
}

/* Stages of a whole window, in a tick that adds no harmonics. */
static inline pvid_reason advance_finish(pvid_weak_q31 *self)
{
    pvid_reason reason = idle_reason(self);
    for (uint32_t left = self->stages_per_tick; left > 0u; left--) {
        pvid_weak_finish_step_q31(self, &reason);
        if (!pvid_weak_finish_is_busy_q31(&self->finish)) {
            count_window(self);
            choose_task(self);
            return reason;
        }
    }
    return reason;
}

/* Behind the last tick of a step or the last harmonics of a window. */
static pvid_reason after(pvid_weak_q31 *self, pvid_weak_tick tick)
{
    pvid_reason reason = idle_reason(self);
    if (tick == PVID_WEAK_REJECTED) {
        reason = reject(self);
    } else if (tick == PVID_WEAK_WINDOW) {
        reason = hand_over(self);
    } else if ((tick == PVID_WEAK_FREE) && pvid_weak_finish_is_busy_q31(&self->finish)) {
        reason = advance_finish(self);
    } else {
        /* the tick is full, or there is nothing to do */
    }
    choose_task(self);
    return reason;
}

/* A tick that ends no step, so many ticks before the end of one, with work. */
PVID_NOINLINE static pvid_reason work(pvid_weak_q31 *self, uint32_t wait)
{
    if (self->accumulator.sums.left == 0u) {
        return pvid_weak_rests(wait, self->pace) ? idle_reason(self) : advance_finish(self);
    }
    const pvid_weak_tick tick = pvid_weak_accumulator_work_q31(&self->accumulator);
    return (self->accumulator.sums.left == 0u) ? after(self, tick) : idle_reason(self);
}

/* Behind the readings of a tick. */
static inline pvid_reason end_tick(pvid_weak_q31 *self, const int32_t reading[])
{
    self->accumulator.front.wait--;
    if (self->accumulator.front.wait == 0u) {
        return after(self, end_step(self, reading));
    }
    const uint8_t task = self->task;
    return (task == BUSY) ? work(self, self->accumulator.front.wait) : (pvid_reason)task;
}

/* A tick whose readings need more than to be added. */
PVID_NOINLINE static pvid_reason other_tick(pvid_weak_q31 *self, const int32_t reading[])
{
    if (!is_ready(self) || (reading == NULL)) {
        return PVID_NOT_READY;
    }
    if (!pvid_weak_front_derive_q31(&self->accumulator.front, self->design, reading)) {
        return reject(self);
    }
    return end_tick(self, reading);
}

pvid_reason pvid_weak_step_q31(pvid_weak_q31 *self, const int32_t reading[])
{
    const uint32_t plain = (self != NULL) ? self->plain : 0u;
    if ((plain == 0u) || (reading == NULL)) {
        return other_tick(self, reading);
    }
    if (!pvid_weak_front_plain_q31(&self->accumulator.front, self->design, plain, reading)) {
        return reject(self);
    }
    return end_tick(self, reading);
}

/* Adds the readings of at most so many ticks of a step, up to the first with one beyond its full scale. Returns of how
 * many. */
static uint32_t add_ticks(pvid_weak_q31 *self, const int32_t readings[], uint32_t most)
{
    pvid_weak_front_q31 *front = &self->accumulator.front;
    uint32_t added = 0;
    if (self->plain > 0u) {
        added = pvid_weak_front_plain_ticks_q31(front, self->design, self->plain, readings, most);
    } else {
        const size_t width = self->design->model->samples;
        while ((added < most) && pvid_weak_front_derive_q31(front, self->design, &readings[added * width])) {
            added++;
        }
    }
    front->wait -= added;
    return added;
}

/* The work of so many ticks that end no step, the last of them so many ticks before the end of one. Returns the reason
 * of them and those before. */
static pvid_reason run_tasks(pvid_weak_q31 *self, uint32_t ticks, uint32_t last, pvid_reason before)
{
    pvid_reason reason = before;
    for (uint32_t left = ticks; (left > 0u) && (self->task == BUSY); left--) {
        reason = pvid_outcome(reason, work(self, (last + left) - 1u));
    }
    return reason;
}

pvid_reason pvid_weak_step_block_q31(pvid_weak_q31 *self, const int32_t readings[], uint32_t count)
{
    if (!is_ready(self) || (readings == NULL)) {
        return PVID_NOT_READY;
    }
    const size_t width = self->design->model->samples;
    const int32_t *reading = readings;
    uint32_t left = count;
    pvid_reason reason = idle_reason(self);
    while (left > 0u) {
        const uint32_t wait = self->accumulator.front.wait;
        const uint32_t most = (left < wait) ? left : wait;
        const uint32_t added = add_ticks(self, reading, most);
        const bool ends = self->accumulator.front.wait == 0u;
        reading = &reading[added * width];
        left -= added;
        reason = run_tasks(self, added - (ends ? 1u : 0u), ends ? 1u : self->accumulator.front.wait, reason);
        if (ends) {
            reason = pvid_outcome(reason, after(self, end_step(self, reading - width)));
        }
        if (added < most) {
            reason = pvid_outcome(reason, reject(self));
            reading = &reading[width];
            left--;
        }
    }
    return reason;
}

const pvid_estimate_q31 *pvid_weak_estimate_q31(const pvid_weak_q31 *self)
{
    return (self != NULL) ? &self->trust.estimate : NULL;
}

bool pvid_weak_read_q31(const pvid_weak_q31 *self, pvid_estimate_q31 *estimate, uint32_t *number)
{
    if (!is_ready(self) || (estimate == NULL)) {
        return false;
    }
    const pvid_trust_q31 *trust = &self->trust;
    return pvid_publication_read(&trust->mark, &trust->estimate, &trust->copy, estimate, sizeof *estimate, number);
}

void pvid_weak_gap_q31(pvid_weak_q31 *self)
{
    if (is_ready(self)) {
        lose(self);
    }
}

void pvid_weak_freeze_q31(pvid_weak_q31 *self, bool frozen)
{
    if (is_ready(self)) {
        self->frozen = frozen;
    }
}
