#include "number/uncontracted.h"

#include "pvid/commission.h"

#include <math.h>

#include "number/finite_f32.h"
#include "number/init.h"
#include "number/shared_word.h"
#include "number/unroll.h"

#define MOST_TICKS 16777216u
#define MOST_PASSES 8u

/* ---- init ---- */

PVID_COLD static bool tables_are_given(const pvid_commission_config_f32 *config)
{
    const bool drives =
        (config->drives == 0u) || ((config->excite != NULL) && (config->excitation != NULL) && (config->input != NULL));
    return (config->weak != NULL) && (config->identifier != NULL) && (config->ring != NULL) && drives;
}

PVID_COLD static bool drives_are_valid(const pvid_commission_config_f32 *config, uint8_t samples)
{
    if (config->drives > PVID_COMMISSION_DRIVES) {
        return false;
    }
    for (size_t i = 0; i < config->drives; i++) {
        const pvid_excite_config_f32 *one = &config->excite[i];
        const float burst = one->burst_s * one->sample_rate_hz;
        const bool has_place = (config->input[i] < samples) || (config->input[i] == PVID_COMMISSION_NOWHERE);
        const float rate = config->weak->sample_rate_hz;
        const float ramp = config->excite[0].ramp_s;
        if (!has_place || (one->measured != samples) || !pvid_within_f32(one->sample_rate_hz, rate, rate) ||
            !pvid_within_f32(one->ramp_s, ramp, ramp) || !((burst + 0.5f) >= (float)config->burst_ticks)) {
            return false;
        }
    }
    return true;
}

PVID_COLD static bool ring_is_valid(const pvid_commission_config_f32 *config)
{
    const bool ring = (config->ring_ticks >= 2u) && (config->ring_ticks <= MOST_TICKS);
    const bool burst = (config->burst_ticks >= 2u) && (config->burst_ticks <= MOST_TICKS);
    const bool passes = (config->passes == 1u) || ((config->passes >= 2u) && (config->passes <= MOST_PASSES) &&
                                                   (config->ring_ticks >= config->burst_ticks));
    return ring && burst && passes;
}

PVID_COLD static bool check_is_valid(const pvid_commission_config_f32 *config)
{
    return pvid_within_f32(config->check_scale, 0.2f, 1.0f) && pvid_within_f32(config->agree, 3.0f, 100.0f) &&
           pvid_within_f32(config->misfit_max, 1.0f, 100.0f) && pvid_within_f32(config->restrained_max, 0.0f, 1.0f);
}

PVID_COLD static pvid_status config_status(const pvid_commission_config_f32 *config)
{
    pvid_status status = pvid_weak_init_f32(config->identifier, config->weak); /* checks the samples' number as well */
    if (status != PVID_OK) {
        return status;
    }
    if (!drives_are_valid(config, config->weak->design->model->samples)) {
        return PVID_BAD_COMMISSION_DRIVES;
    }
    for (size_t i = 0; (i < config->drives) && (status == PVID_OK); i++) {
        status = pvid_excite_init_f32(&config->excitation[i], &config->excite[i]);
    }
    if (status != PVID_OK) {
        return status;
    }
    if (!ring_is_valid(config)) {
        return PVID_BAD_COMMISSION_RING;
    }
    return check_is_valid(config) ? PVID_OK : PVID_BAD_COMMISSION_CHECK;
}

PVID_COLD pvid_status pvid_commission_init_layout_f32(pvid_commission_f32 *self,
                                                      const pvid_commission_config_f32 *config, uint32_t layout)
{
    if (layout != PVID_LAYOUT) {
        return PVID_BAD_LAYOUT;
    }
    if (!pvid_init_is_given(self, config) || !tables_are_given(config)) {
        return pvid_init_end(self, sizeof *self, PVID_BAD_POINTER);
    }
    memset(self, 0, sizeof *self);
    const pvid_status status = config_status(config);
    if (status == PVID_OK) {
        self->config = config;
    }
    return pvid_init_end(self, sizeof *self, status);
}

/* ---- between the contexts ---- */

static inline uint32_t phase_of(const pvid_commission_f32 *self)
{
    const uint32_t phase = pvid_shared_load_number(&self->phase);
    pvid_shared_read_so_far();
    return phase;
}

/* What was written before is seen by whoever sees the phase. */
static inline void set_phase(pvid_commission_f32 *self, pvid_commission_state phase)
{
    pvid_shared_written();
    pvid_shared_store_number(&self->phase, (uint32_t)phase);
}

static inline size_t samples_of(const pvid_commission_f32 *self)
{
    return self->config->weak->design->model->samples;
}

static inline float *place_of(const pvid_commission_f32 *self, uint32_t tick)
{
    return &self->config->ring[(size_t)(tick % self->config->ring_ticks) * samples_of(self)];
}

/* ---- the tick ---- */

static void end_with(pvid_commission_f32 *self, pvid_commission_verdict verdict)
{
    for (size_t i = 0; i < self->config->drives; i++) {
        pvid_excite_abort_f32(&self->config->excitation[i]);
    }
    self->result.verdict = verdict;
    self->is_ending = true;
}

static void begin_burst(pvid_commission_f32 *self, float scale, uint32_t run)
{
    for (size_t i = 0; i < self->config->drives; i++) {
        /* a run of its own for each drive, so that two drives of one table differ */
        (void)pvid_excite_start_f32(&self->config->excitation[i], scale, run + (2u * (uint32_t)i));
    }
    self->is_moving = true;
}

/* All of them RUNNING, or there are none. */
static bool all_run(const pvid_commission_f32 *self)
{
    bool run = true;
    for (size_t i = 0; i < self->config->drives; i++) {
        run = run && (pvid_excite_state_of_f32(&self->config->excitation[i]) == PVID_EXCITE_RUNNING);
    }
    return run;
}

static bool all_rest(const pvid_commission_f32 *self)
{
    bool rest = true;
    for (size_t i = 0; i < self->config->drives; i++) {
        const pvid_excite_state state = pvid_excite_state_of_f32(&self->config->excitation[i]);
        rest = rest && ((state == PVID_EXCITE_ENDED) || (state == PVID_EXCITE_IDLE));
    }
    return rest;
}

static void store(pvid_commission_f32 *self, const float sample[], const float drive[])
{
    const uint32_t head = self->head;
    if ((head - pvid_shared_load_number(&self->tail)) >= self->config->ring_ticks) {
        end_with(self, PVID_COMMISSION_TOO_SLOW);
        return;
    }
    pvid_shared_read_so_far();
    float *place = place_of(self, head);
    memcpy(place, sample, samples_of(self) * sizeof *place);
    const size_t drives = (drive != NULL) ? self->config->drives : 0u;
    for (size_t i = 0; i < drives; i++) {
        if (self->config->input[i] != PVID_COMMISSION_NOWHERE) {
            place[self->config->input[i]] = drive[i];
        }
    }
    pvid_shared_written();
    pvid_shared_store_number(&self->head, head + 1u);
}

/* Whether an excitation was cut short, with the reason in the result. */
static bool was_cut(pvid_commission_f32 *self)
{
    for (size_t i = 0; i < self->config->drives; i++) {
        uint8_t guard = 0u;
        const pvid_excite_reason reason = pvid_excite_reason_of_f32(&self->config->excitation[i], &guard);
        if (reason != PVID_EXCITE_FINISHED) {
            self->result.reason = reason;
            self->result.drive = (uint8_t)i;
            self->result.guard = guard;
            return true;
        }
    }
    return false;
}

static float most_restrained(const pvid_commission_f32 *self)
{
    float most = 0.0f;
    for (size_t i = 0; i < self->config->drives; i++) {
        const float share = pvid_excite_restrained_f32(&self->config->excitation[i]);
        most = (share > most) ? share : most;
    }
    return most;
}

static void burst_tick(pvid_commission_f32 *self, pvid_commission_state phase, const float sample[], float drive[])
{
    if (!self->is_moving && !self->is_ending) {
        const bool first = phase == PVID_COMMISSION_BURST;
        begin_burst(self, first ? 1.0f : self->config->check_scale, first ? 0u : 1u);
    }
    const bool records = all_run(self) && (self->head < self->config->burst_ticks) && !self->is_ending;
    const size_t drives = (drive != NULL) ? self->config->drives : 0u;
    for (size_t i = 0; i < drives; i++) {
        drive[i] = pvid_excite_step_f32(&self->config->excitation[i], sample);
    }
    if (!self->is_ending && was_cut(self)) {
        end_with(self, PVID_COMMISSION_ABORTED);
    }
    if (records && (sample != NULL) && !self->is_ending) {
        store(self, sample, drive);
    }
    if (!all_rest(self)) {
        return;
    }
    if (self->is_ending) {
        set_phase(self, PVID_COMMISSION_ENDED);
    } else if (self->head >= self->config->burst_ticks) {
        self->result.restrained = most_restrained(self);
        self->is_moving = false;
        set_phase(self, (phase == PVID_COMMISSION_BURST) ? PVID_COMMISSION_SOLVE : PVID_COMMISSION_COMPARE);
    } else if (self->config->drives > 0u) {
        self->result.reason = PVID_EXCITE_SENSOR; /* samples were missing */
        self->result.verdict = PVID_COMMISSION_ABORTED;
        set_phase(self, PVID_COMMISSION_ENDED);
    } else {
        /* a burst without drives goes on */
    }
}

pvid_commission_state pvid_commission_step_f32(pvid_commission_f32 *self, const float sample[], float drive[])
{
    if ((self == NULL) || (self->config == NULL) || ((drive == NULL) && (self->config->drives > 0u))) {
        return PVID_COMMISSION_IDLE;
    }
    for (size_t i = 0; i < self->config->drives; i++) {
        drive[i] = 0.0f;
    }
    const uint32_t phase = phase_of(self);
    const bool bursts = (phase == (uint32_t)PVID_COMMISSION_BURST) || (phase == (uint32_t)PVID_COMMISSION_CHECK);
    if (bursts && !self->is_ending && (pvid_shared_load_number(&self->asked) != 0u)) {
        self->result.reason = PVID_EXCITE_ASKED;
        end_with(self, PVID_COMMISSION_ABORTED);
    }
    if (bursts) {
        burst_tick(self, (pvid_commission_state)phase, sample, drive);
    }
    return (pvid_commission_state)phase_of(self);
}

/* ---- the background ---- */

static void begin_pass(pvid_commission_f32 *self)
{
    pvid_weak_config_f32 config = *self->config->weak;
    if (phase_of(self) >= (uint32_t)PVID_COMMISSION_CHECK) { /* errors grow as its motion is smaller, or faster */
        config.trust.se_max /= self->config->check_scale * self->config->check_scale;
    }
    if ((self->pass > 0u) || (phase_of(self) >= (uint32_t)PVID_COMMISSION_CHECK)) {
        memcpy(config.estimator.start, self->start, sizeof self->start);
    }
    (void)pvid_weak_init_f32(self->config->identifier, &config);
    self->has_begun = true;
}

/* The estimate of the last window; of a pass that published, the published one. Returns whether one is published. */
static bool found(const pvid_commission_f32 *self, pvid_estimate_f32 *estimate)
{
    uint32_t number = 0u;
    const bool is_read = pvid_weak_read_f32(self->config->identifier, estimate, &number);
    return is_read && (number > 0u);
}

/* The next pass starts there; within the bounds of a start, or where this one started. */
static void keep_start(pvid_commission_f32 *self)
{
    const pvid_estimator_config_f32 *limits = &self->config->weak->estimator;
    const pvid_estimate_f32 *candidate = pvid_weak_candidate_f32(self->config->identifier);
    const bool is_new = candidate->weight > 0.0f;
    for (size_t i = 0; i < self->config->weak->design->model->model->n_p; i++) {
        const bool fits = is_new && pvid_within_f32(candidate->p[i], limits->lower[i], limits->upper[i]);
        self->start[i] = fits ? candidate->p[i] : limits->start[i];
    }
}

static pvid_commission_verdict poor(const pvid_commission_f32 *self, const pvid_estimate_f32 *estimate,
                                    pvid_reason outcome)
{
    const bool has_moved = (outcome != PVID_HELD_NOT_EXCITED) && (outcome != PVID_WARMING_UP); /* p, from its start */
    if (has_moved && (estimate->misfit > self->config->misfit_max)) {
        return PVID_COMMISSION_DOES_NOT_FIT;
    }
    return (self->result.restrained > self->config->restrained_max) ? PVID_COMMISSION_TOO_TIGHT
                                                                    : PVID_COMMISSION_NOT_EXCITED;
}

/* PENDING: the burst's estimate stands; own: its standard errors without those that all windows share. */
static pvid_commission_verdict judged(pvid_commission_f32 *self, size_t burst, float value[], float own[])
{
    pvid_estimate_f32 estimate;
    const pvid_estimate_f32 *candidate = pvid_weak_candidate_f32(self->config->identifier);
    if (!found(self, &estimate)) {
        self->result.misfit[burst] = candidate->misfit;
        return poor(self, candidate, self->result.outcome[burst]);
    }
    self->result.misfit[burst] = estimate.misfit;
    memcpy(value, estimate.p, sizeof estimate.p);
    memcpy(own, self->config->identifier->trust.own, sizeof self->own);
    if (burst == 0u) {
        memcpy(self->result.error, estimate.se, sizeof estimate.se);
    }
    return (estimate.misfit > self->config->misfit_max) ? PVID_COMMISSION_DOES_NOT_FIT : PVID_COMMISSION_PENDING;
}

static pvid_commission_verdict compared(pvid_commission_f32 *self)
{
    float own[PVID_MAX_P];
    memset(own, 0, sizeof own);
    pvid_commission_result_f32 *result = &self->result;
    const pvid_commission_verdict verdict = judged(self, 1u, result->check, own);
    if (verdict != PVID_COMMISSION_PENDING) {
        return verdict;
    }
    for (size_t i = 0; i < self->config->weak->design->model->model->n_p; i++) {
        const float apart = result->check[i] - result->value[i];
        const float joint = sqrtf((own[i] * own[i]) + (self->own[i] * self->own[i]));
        const float size = (joint > 0.0f) ? ((apart < 0.0f) ? -apart : apart) / joint : 0.0f;
        if (size > result->difference) {
            result->difference = size;
            result->parameter = (uint8_t)i;
        }
    }
    return (result->difference <= self->config->agree) ? PVID_COMMISSION_DONE : PVID_COMMISSION_DOES_NOT_FIT;
}

/* At the end of the last pass over a burst. */
static void conclude(pvid_commission_f32 *self, bool is_first)
{
    const pvid_commission_verdict verdict = is_first ? judged(self, 0u, self->result.value, self->own) : compared(self);
    self->pass = 0u;
    if (verdict != PVID_COMMISSION_PENDING) {
        self->result.verdict = verdict;
        set_phase(self, PVID_COMMISSION_ENDED);
        return;
    }
    pvid_shared_store_number(&self->tail, 0u);
    pvid_shared_store_number(&self->head, 0u);
    set_phase(self, PVID_COMMISSION_CHECK);
}

static void end_pass(pvid_commission_f32 *self, uint32_t phase)
{
    keep_start(self);
    self->has_begun = false;
    self->pass += 1u;
    if (self->pass < self->config->passes) {
        pvid_shared_store_number(&self->tail, 0u);
        return;
    }
    conclude(self, phase == (uint32_t)PVID_COMMISSION_SOLVE);
}

bool pvid_commission_work_f32(pvid_commission_f32 *self)
{
    if ((self == NULL) || (self->config == NULL)) {
        return false;
    }
    const uint32_t phase = phase_of(self);
    if ((phase == (uint32_t)PVID_COMMISSION_IDLE) || (phase == (uint32_t)PVID_COMMISSION_ENDED)) {
        return false;
    }
    const bool solves = (phase == (uint32_t)PVID_COMMISSION_SOLVE) || (phase == (uint32_t)PVID_COMMISSION_COMPARE);
    if (solves && (pvid_shared_load_number(&self->asked) != 0u)) {
        self->result.reason = PVID_EXCITE_ASKED;
        self->result.verdict = PVID_COMMISSION_ABORTED;
        set_phase(self, PVID_COMMISSION_ENDED);
        return false;
    }
    if (!self->has_begun) {
        begin_pass(self);
        return true;
    }
    const uint32_t tail = self->tail;
    if (tail < pvid_shared_load_number(&self->head)) {
        pvid_shared_read_so_far();
        const pvid_reason reason = pvid_weak_step_f32(self->config->identifier, place_of(self, tail));
        if (reason != PVID_ACCUMULATED) {
            self->result.outcome[(phase >= (uint32_t)PVID_COMMISSION_CHECK) ? 1u : 0u] = reason;
        }
        pvid_shared_written();
        pvid_shared_store_number(&self->tail, tail + 1u);
        return true;
    }
    if (solves) {
        end_pass(self, phase);
    }
    return solves;
}

/* ---- both ---- */

bool pvid_commission_start_f32(pvid_commission_f32 *self)
{
    const uint32_t phase = (uint32_t)pvid_commission_state_of_f32(self);
    const bool rests = (phase == (uint32_t)PVID_COMMISSION_IDLE) || (phase == (uint32_t)PVID_COMMISSION_ENDED);
    if ((self == NULL) || (self->config == NULL) || !rests) {
        return false;
    }
    const pvid_commission_config_f32 *config = self->config;
    memset(self, 0, sizeof *self);
    self->config = config;
    set_phase(self, PVID_COMMISSION_BURST);
    return true;
}

void pvid_commission_abort_f32(pvid_commission_f32 *self)
{
    if (self != NULL) {
        pvid_shared_store_number(&self->asked, 1u);
    }
}

pvid_commission_state pvid_commission_state_of_f32(const pvid_commission_f32 *self)
{
    return ((self == NULL) || (self->config == NULL)) ? PVID_COMMISSION_IDLE : (pvid_commission_state)phase_of(self);
}

const pvid_commission_result_f32 *pvid_commission_result_of_f32(const pvid_commission_f32 *self)
{
    return (self == NULL) ? NULL : &self->result;
}
