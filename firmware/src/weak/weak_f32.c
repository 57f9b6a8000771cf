#include "number/uncontracted.h"

#include "pvid/weak.h"

#include <stddef.h>
#include <string.h>

#include "number/init.h"
#include "number/count.h"
#include "number/finite_f32.h"
#include "judge/publication.h"
#include "full_angle_f32.h"
#include "weak/finish_f32.h"
#include "weak/front_f32.h"
#include "weak/schedule.h"
#include "weak/window_f32.h"

static bool all_finite(const float values[], size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (!pvid_finite_f32(values[i])) {
            return false;
        }
    }
    return true;
}

static bool tables_are_valid(const pvid_weak_design_f32 *design)
{
    const size_t half = (design->taps - 1u) / 2u;
    const size_t functions = design->functions;
    return (design->smooth != NULL) && (design->second != NULL) && (design->chi != NULL) && (design->gram != NULL) &&
           all_finite(design->smooth, half) && all_finite(design->second, half) &&
           all_finite(design->chi, 3u * functions * design->window) &&
           all_finite(design->gram, 3u * functions * (functions + 1u));
}

static pvid_status design_is_valid(const pvid_weak_design_f32 *design)
{
    if (design == NULL) {
        return PVID_BAD_DESIGN;
    }
    const pvid_status sizes = pvid_weak_sizes(design->taps, design->decimation, design->window, design->functions,
                                              PVID_MAX_FUNCTIONS, design->lag);
    if (sizes != PVID_OK) {
        return sizes;
    }
    if (!pvid_within_f32(design->overlap, 1.0f, 1.0e6f)) {
        return PVID_BAD_OVERLAP;
    }
    return tables_are_valid(design) ? PVID_OK : PVID_BAD_DESIGN;
}

static bool angle_is_valid(const pvid_weak_config_f32 *config)
{
    if (!config->full_angle && !config->friction) {
        return true;
    }
    const bool room = !config->friction || (config->zero_unknown && PVID_KAPITZA_HAS_FRICTION);
    return room && pvid_angle_correction_enabled_f32(config->angle) && (config->passes >= 1u) &&
           (config->passes <= PVID_MAX_PASSES);
}

static pvid_status init_estimator(pvid_weak_f32 *self, const pvid_weak_config_f32 *config)
{
    const pvid_weak_design_f32 *design = config->design;
    const float functions = (float)design->functions;
    pvid_estimator_config_f32 estimator = config->estimator;
    estimator.model = config->zero_unknown ? &pvid_kapitza_weak_f32 : &pvid_kapitza_weak_zeroed_f32;
#if PVID_KAPITZA_HAS_FRICTION
    estimator.model = config->friction ? &pvid_kapitza_friction_f32 : estimator.model;
#endif
    estimator.update_rate_hz =
        config->sample_rate_hz / ((float)design->decimation * (float)pvid_weak_hop(design->window));
    estimator.row_weight = (functions - 2.0f) / functions;
    estimator.correlation = design->overlap;
    return pvid_estimator_init_f32(&self->estimator, &estimator);
}

/* Windows in the average of the gate's scale. The scale is relative to the sensors' noise and at least 1. */
#define GATE_MEMORY 4.0f

/* Returns whether init has accepted a configuration. */
static inline bool is_ready(const pvid_weak_f32 *self)
{
    const bool ready = (self != NULL) && (self->design != NULL);
    PVID_ASSERT(ready);
    return ready;
}

static void restart_window(pvid_weak_window_f32 *window, uint16_t index)
{
    window->index = index;
    window->whole = false;
    for (size_t i = 0; i < PVID_WEAK_INTEGRALS; i++) {
        window->before[i] = 0.0f;
        window->once[i] = 0.0f;
        window->twice[i] = 0.0f;
    }
}

/* Window 0 begins with the next decimated sample. Window 1 begins half a window later; until then it discards its
 * sums (`whole` is false). */
static void restart(pvid_weak_f32 *self)
{
    const uint16_t hop = pvid_weak_hop(self->design->window);
    pvid_weak_front_reset_f32(&self->front);
    restart_window(&self->window[0], (uint16_t)((2u * hop) - 1u));
    restart_window(&self->window[1], (uint16_t)(hop - 1u));
    self->active = 2;
    self->warm = false;
    self->curvature.wait = 1;
    self->curvature.known = 0;
    self->curvature.due = false;
}

static pvid_status prepare(pvid_weak_f32 *self, const pvid_weak_config_f32 *config)
{
    const pvid_weak_design_f32 *design = config->design;
    if (!pvid_within_f32(config->sample_rate_hz, 1.0e-3f, 1.0e6f)) {
        return PVID_BAD_SAMPLE_RATE;
    }
    if (!pvid_within_f32(config->l1, 1.0e-6f, 1.0e6f)) {
        return PVID_BAD_LENGTH;
    }
    if (!pvid_within_f32(config->drive_min, 0.0f, 1.0e9f)) {
        return PVID_BAD_DRIVE_MIN;
    }
    if (!pvid_within_f32(config->pivot_noise, 0.0f, 1.0e9f)) {
        return PVID_BAD_PIVOT_NOISE;
    }
    if (!pvid_within_f32(config->angle_limit, 0.0f, 1.0e9f)) {
        return PVID_BAD_ANGLE_LIMIT;
    }
    if (!angle_is_valid(config)) {
        return PVID_BAD_ANGLE;
    }
    pvid_status status = design_is_valid(design);
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
    const float windows_hz =
        config->sample_rate_hz / ((float)design->decimation * (float)pvid_weak_hop(design->window));
    status = pvid_gate_init_f32(&self->finish.gate, &config->gate, windows_hz, GATE_MEMORY, 1.0f);
    if (status != PVID_OK) {
        return status;
    }
    if ((config->iterations < 1u) || (config->iterations > PVID_MAX_ITERATIONS)) {
        return PVID_BAD_ITERATIONS;
    }
    self->design = design;
    self->dt = (float)design->decimation / config->sample_rate_hz;
    pvid_weak_front_init_f32(&self->front, design, config->sample_rate_hz, config->l1);
    self->drive_min = config->drive_min * config->drive_min;
    const float lag = self->dt * (float)design->lag;
    self->row_variance = config->estimator.row_sd * config->estimator.row_sd;
    self->pivot_noise = config->pivot_noise / ((lag * lag) * (lag * lag));
    self->angle_limit = config->angle_limit;
    self->functions_per_tick = pvid_weak_functions_per_tick(design->decimation, design->functions);
    self->iterations = (uint8_t)((self->estimator.settings.gain < 1.0f) ? 1u : config->iterations);
    self->angle = (config->full_angle || config->friction) ? config->angle : NULL;
    if (pvid_angle_correction_enabled_f32(self->angle)) {
        pvid_weak_angle_init_f32(self->angle, config);
    }
    const uint32_t stages = pvid_weak_finish_stages_f32(design, self->iterations, &self->estimator, self->angle);
    self->stages_per_tick = pvid_weak_stages_per_tick(stages, design->window, design->decimation, design->functions);
    if (self->stages_per_tick == 0u) {
        return PVID_BAD_ITERATIONS;
    }
    pvid_weak_finish_init_f32(&self->finish);
    self->window[0].buffer = 0;
    self->window[1].buffer = 1;
    self->finish.buffer = 2;
    restart(self);
    return PVID_OK;
}

pvid_status pvid_weak_init_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config)
{
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

void pvid_weak_gap_f32(pvid_weak_f32 *self)
{
    if (is_ready(self)) {
        restart(self);
    }
}

void pvid_weak_freeze_f32(pvid_weak_f32 *self, bool frozen)
{
    if (is_ready(self)) {
        self->frozen = frozen;
    }
}

static void next_curvature(pvid_weak_curvature_f32 *self, uint8_t lag, float phi)
{
    self->due = false;
    self->wait--;
    if (self->wait > 0u) {
        return;
    }
    self->wait = lag;
    if (self->known < 2u) {
        self->known++;
    } else {
        const float curvature = (phi - self->before[0]) - (self->before[0] - self->before[1]);
        self->square = curvature * curvature;
        self->due = true;
    }
    self->before[1] = self->before[0];
    self->before[0] = phi;
}

/* The encoder's offset may be large: before the first row c is set to the mean of phi. */
static void place_offset(pvid_weak_f32 *self, const pvid_weak_window_f32 *window)
{
    float p[PVID_MAX_P];
    memcpy(p, self->estimator.p, sizeof p);
    p[PVID_KAPITZA_C] = pvid_weak_window_mean_f32(window, self->design->window);
    pvid_estimator_place_f32(&self->estimator, p);
    pvid_trust_place_f32(&self->trust, &self->estimator);
}

/* The reason why a complete window is dropped; PVID_ACCUMULATED if it is used. */
static pvid_reason drop_reason(pvid_weak_f32 *self, const pvid_weak_window_f32 *window)
{
    if (self->frozen) {
        return PVID_HELD_FROZEN;
    }
    if ((self->drive_min > 0.0f) && (pvid_weak_window_drive_f32(window, self->design->window) < self->drive_min)) {
        pvid_count_up(&self->estimator.counters.held_not_excited);
        return PVID_HELD_NOT_EXCITED;
    }
    const bool offset_known = self->estimator.model->n_p <= (uint8_t)PVID_KAPITZA_C;
    if (!offset_known && (self->estimator.counters.rows == 0u)) {
        place_offset(self, window);
    }
    const float offset = offset_known ? 0.0f : self->estimator.p[PVID_KAPITZA_C];
    if ((self->angle_limit > 0.0f) && (pvid_weak_window_max_deviation_f32(window, offset) > self->angle_limit)) {
        pvid_count_up(&self->estimator.counters.held_out_of_range);
        return PVID_HELD_OUT_OF_RANGE;
    }
    return PVID_ACCUMULATED;
}

/* Exchanges the buffers of a complete window and of `finish`, which then processes the window's sums. A dropped window
 * keeps its buffer. The window's last sample, where chi is 0, is the first sample of the next one, which clears the
 * sums. */
static pvid_reason hand_over(pvid_weak_f32 *self, pvid_weak_window_f32 *window)
{
    const pvid_reason reason = drop_reason(self, window);
    self->warm = true;
    if (reason != PVID_ACCUMULATED) {
        return reason;
    }
    const uint8_t full = window->buffer;
    window->buffer = self->finish.buffer;
    self->finish.buffer = full;
    const float expected = self->row_variance + (self->pivot_noise * pvid_weak_window_curvature_f32(window));
    pvid_weak_finish_begin_f32(&self->finish, &self->estimator, self->angle, expected);
    return PVID_ACCUMULATED;
}

/* Begins a decimated sample in both windows. If it completes a window that is dropped, returns the reason; else
 * PVID_ACCUMULATED. */
static pvid_reason next_sample(pvid_weak_f32 *self)
{
    pvid_reason reason = PVID_ACCUMULATED;
    next_curvature(&self->curvature, self->design->lag, self->phi);
    if (pvid_angle_correction_enabled_f32(self->angle)) {
        pvid_weak_angle_add_sample_f32(self->angle, self->phi, self->u);
    }
    for (size_t i = 0; i < 2u; i++) {
        pvid_weak_window_f32 *window = &self->window[i];
        window->index++;
        if (window->index == self->design->window - 1u) {
            window->index = 0;
            if (window->whole) {
                reason = hand_over(self, window);
            }
            window->whole = true;
        }
    }
    self->active = 0;
    self->function = 0;
    return reason;
}

/* Adds the present sample to the next few functions: first all of one window, then all of the other. */
static inline void add_slice(pvid_weak_f32 *self)
{
    const pvid_weak_design_f32 *design = self->design;
    pvid_weak_window_f32 *window = &self->window[self->active];
    const size_t first = self->function;
    const size_t end = first + self->functions_per_tick;
    const size_t last = (end < design->functions) ? end : design->functions;
    if (first == 0u) {
        pvid_weak_window_terms_f32(window, design->window, self->dt, self->phi, self->u, &self->curvature,
                                   self->term[self->active][window->index % 2u]);
    }
    pvid_weak_window_add_f32(window, design, (const float (*)[PVID_WEAK_SAMPLE_TERMS])self->term[self->active], first,
                             last, self->sums[window->buffer]);
    self->function = (uint8_t)last;
    if (last == design->functions) {
        self->function = 0;
        self->active++;
    }
}

static void advance_finish(pvid_weak_f32 *self, pvid_reason *reason)
{
    for (uint8_t i = 0; (i < self->stages_per_tick) && pvid_weak_finish_is_busy_f32(&self->finish); i++) {
        pvid_weak_finish_step_f32(&self->finish, self->design, self->iterations, self->sums[self->finish.buffer],
                                  &self->estimator, &self->trust, reason);
    }
}

/* Every tick runs the front end. If this completes a decimated sample, the sample begins in both windows and may
 * complete one of them. In the second half of a block the tick adds the decimated sample to some functions of a window.
 * All other ticks run stages of a complete window (schedule.h). */
pvid_reason pvid_weak_step_f32(pvid_weak_f32 *self, float phi, float y)
{
    if (!is_ready(self)) {
        return PVID_NOT_READY;
    }
    if (!pvid_finite_f32(phi) || !pvid_finite_f32(y)) {
        restart(self);
        pvid_count_up(&self->estimator.counters.rejected_not_finite);
        return PVID_REJECTED_NOT_FINITE;
    }
    const uint16_t decimation = self->design->decimation;
    pvid_reason dropped = PVID_ACCUMULATED;
    bool adding = false;
    if (pvid_weak_front_step_f32(&self->front, phi, y, &self->phi, &self->u)) {
        dropped = next_sample(self);
        if (decimation == 1u) {
            add_slice(self);
            add_slice(self);
        }
    } else if (self->active < 2u) {
        adding = true;
        add_slice(self);
        if (decimation == 2u) {
            add_slice(self);
        }
    }
    pvid_reason reason = self->warm ? PVID_ACCUMULATED : PVID_WARMING_UP;
    if (dropped != PVID_ACCUMULATED) {
        reason = dropped;
    } else if (!adding) {
        advance_finish(self, &reason);
    }
    return reason;
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
