#include "pvid/weak_q31.h"

#include <stddef.h>
#include <string.h>

#include "number/init.h"
#include "number/count.h"
#include "number/integer_q31.h"
#include "number/scaled_q31.h"
#include "judge/publication.h"
#include "weak/finish_q31.h"
#include "weak/front_q31.h"
#include "weak/schedule.h"
#include "weak/window_q31.h"

#define U_LIMIT ((int32_t)1 << 18)
#define COUNTS_LIMIT ((int32_t)1 << 24)
#define EXPONENT_LIMIT 200
#define TERM_LIMIT ((int64_t)1 << 20)                                        /* of the factors of a test function */
#define MOST_FUNCTIONS ((PVID_MAX_FUNCTIONS < 32) ? PVID_MAX_FUNCTIONS : 32) /* form_of in weak/finish_q31.c */

/* Windows in the average of the gate's scale. The scale is relative to the sensors' noise and at least 1. */
#define GATE_MEMORY 4u

static bool is_count(int32_t x, int32_t limit)
{
    return (x > 0) && (x <= limit);
}

static bool shifts_are_valid(const uint8_t shift[], size_t n, uint8_t low, uint8_t high)
{
    bool valid = true;
    for (size_t i = 0; i < n; i++) {
        valid = valid && (shift[i] >= low) && (shift[i] <= high);
    }
    return valid;
}

/* Whether a weight times the sum of two differences fits 32 bits for every one; *total: sum of their magnitudes. */
static bool taps_fit(const PVID_TABLE int32_t *weights, size_t half, int32_t full_scale, int64_t *total)
{
    bool fit = true;
    *total = 0;
    for (size_t i = 0; i < half; i++) {
        const int64_t magnitude = (int64_t)pvid_magnitude_q31(weights[i]);
        fit = fit && ((4 * magnitude * full_scale) <= INT32_MAX);
        *total += magnitude;
    }
    return fit;
}

/* The part of the design tool's proof that costs one walk through the tables. */
static pvid_status tables_fit(const pvid_weak_design_q31 *design)
{
    const size_t functions = design->functions;
    const size_t half = (design->taps - 1u) / 2u;
    int64_t smooth;
    int64_t second;
    if (!taps_fit(design->smooth, half, design->phi_max, &smooth) ||
        !taps_fit(design->second, half, design->y_max, &second)) {
        return PVID_BAD_DESIGN;
    }
    const int64_t sum = design->phi_max * (((int64_t)1 << design->smooth_bits) + (4 * smooth));
    const int64_t f = pvid_floor_shift_q31(sum, design->phi_shift) + 1;
    if ((f > TERM_LIMIT) || ((pvid_floor_shift_q31(design->u_max * f, design->uf_shift) + 1) > TERM_LIMIT)) {
        return PVID_BAD_SHIFT;
    }
    bool fit = true;
    const int64_t rounding = (int64_t)1 << (design->sum_shift - 1u);
    for (size_t i = 0; i < (3u * functions * design->window); i++) {
        const int64_t magnitude = (int64_t)pvid_magnitude_q31(design->chi[i]);
        fit = fit && (((magnitude * TERM_LIMIT) + rounding) <= INT32_MAX);
    }
    for (size_t i = 0; i < ((PVID_WEAK_GRAMS / 2u) * functions * (functions + 1u)); i++) {
        fit = fit && (pvid_magnitude_q31(design->gram[i]) <= (uint64_t)PVID_ONE_Q30);
    }
    return fit ? PVID_OK : PVID_BAD_DESIGN;
}

static bool every_shift_is_valid(const pvid_weak_design_q31 *design)
{
    const bool single = (design->smooth_bits <= 31u) && (design->phi_shift <= 62u) && (design->u_shift <= 62u) &&
                        (design->uf_shift <= 62u) && (design->sum_shift >= 1u) && (design->sum_shift <= 30u);
    return single && shifts_are_valid(design->integral_shift, PVID_WEAK_INTEGRALS_Q31, 0, 62) &&
           shifts_are_valid(design->high_shift, 2, 0, 61) && shifts_are_valid(design->product_shift, 5, 0, 62) &&
           shifts_are_valid(design->shift, PVID_WEAK_TERMS_Q31, 0, 62);
}

static pvid_status design_is_valid(const pvid_weak_design_q31 *design)
{
    if (design == NULL) {
        return PVID_BAD_DESIGN;
    }
    const pvid_status sizes = pvid_weak_sizes(design->taps, design->decimation, design->window, design->functions,
                                              MOST_FUNCTIONS, design->lag);
    if (sizes != PVID_OK) {
        return sizes;
    }
    if ((design->smooth == NULL) || (design->second == NULL) || (design->chi == NULL) || (design->gram == NULL) ||
        (design->multiplier == NULL)) {
        return PVID_BAD_DESIGN;
    }
    if (!is_count(design->phi_max, COUNTS_LIMIT) || !is_count(design->y_max, COUNTS_LIMIT) ||
        !is_count(design->u_max, U_LIMIT)) {
        return PVID_BAD_FULL_SCALE;
    }
    return every_shift_is_valid(design) ? tables_fit(design) : PVID_BAD_SHIFT;
}

static bool pivot_noise_is_valid(pvid_scaled_q31 noise)
{
    return (noise.m >= 0) && (noise.m <= PVID_ONE_Q30) && (noise.e >= -EXPONENT_LIMIT) && (noise.e <= EXPONENT_LIMIT);
}

/* Returns whether init has accepted a configuration. */
static inline bool is_ready(const pvid_weak_q31 *self)
{
    const bool ready = (self != NULL) && (self->design != NULL);
    PVID_ASSERT(ready);
    return ready;
}

static void restart_curvature(pvid_weak_curvature_q31 *self)
{
    self->wait = 1;
    self->known = 0;
    self->due = false;
}

static void restart_window(pvid_weak_window_q31 *window, uint16_t index)
{
    window->index = index;
    window->whole = false;
    for (size_t i = 0; i < PVID_WEAK_INTEGRALS_Q31; i++) {
        window->before[i] = 0;
        window->once[i] = 0;
        window->twice[i] = 0;
    }
    window->f_sum = 0;
    window->u_sum = 0;
    window->u_square_sum = 0;
    window->curvature_square_sum = 0;
    window->curvatures = 0;
}

/* Window 0 begins with the next decimated sample. Window 1 begins half a window later; until then it discards its sums
 * (`whole` is false), which must not be added to its earlier sums. */
static void restart(pvid_weak_q31 *self)
{
    const uint16_t hop = pvid_weak_hop(self->design->window);
    pvid_weak_front_reset_q31(&self->front);
    restart_curvature(&self->curvature);
    restart_window(&self->window[0], (uint16_t)((2u * hop) - 1u));
    restart_window(&self->window[1], (uint16_t)(hop - 1u));
    memset(self->sums[self->window[1].buffer], 0, sizeof self->sums[0]);
    self->active = 2;
    self->warm = false;
}

static pvid_status prepare(pvid_weak_q31 *self, const pvid_weak_config_q31 *config)
{
    const pvid_weak_design_q31 *design = config->design;
    if ((config->drive_min < 0) || (config->drive_min > U_LIMIT)) {
        return PVID_BAD_DRIVE_MIN;
    }
    if (!pivot_noise_is_valid(config->pivot_noise)) {
        return PVID_BAD_PIVOT_NOISE;
    }
    pvid_status status = design_is_valid(design);
    if (status != PVID_OK) {
        return status;
    }
    memset(self, 0, sizeof *self);
    pvid_estimator_config_q31 estimator = config->estimator;
    estimator.model = config->zero_unknown ? &pvid_kapitza_weak_q31 : &pvid_kapitza_weak_zeroed_q31;
    status = pvid_estimator_init_q31(&self->estimator, &estimator);
    if (status != PVID_OK) {
        return status;
    }
    status = pvid_trust_init_q31(&self->trust, &config->trust, &self->estimator);
    if (status != PVID_OK) {
        return status;
    }
    status = pvid_gate_init_q31(&self->finish.gate, &config->gate, GATE_MEMORY, pvid_scaled_of_q31(1, 0));
    if (status != PVID_OK) {
        return status;
    }
    if ((config->iterations < 1u) || (config->iterations > PVID_MAX_ITERATIONS)) {
        return PVID_BAD_ITERATIONS;
    }
    self->design = design;
    self->phi_offset = config->phi_offset;
    self->y_offset = config->y_offset;
    self->zero_unknown = config->zero_unknown;
    self->pivot_noise = config->pivot_noise;
    self->zero_bits = (int8_t)(config->zero_unknown ? config->estimator.p_bits[PVID_KAPITZA_C] : 0);
    pvid_weak_front_init_q31(&self->front, design);
    const int64_t drive_min = (int64_t)config->drive_min * (design->window - 1);
    self->drive_min = drive_min * drive_min;
    self->functions_per_tick = pvid_weak_functions_per_tick(design->decimation, design->functions);
    self->iterations = (uint8_t)((self->estimator.settings.gain < PVID_ONE_Q30) ? 1u : config->iterations);
    const uint32_t stages = pvid_weak_finish_stages_q31(design->functions, self->iterations, &self->estimator);
    self->stages_per_tick = pvid_weak_stages_per_tick(stages, design->window, design->decimation, design->functions);
    if (self->stages_per_tick == 0u) {
        return PVID_BAD_ITERATIONS;
    }
    pvid_weak_finish_init_q31(&self->finish);
    self->window[0].buffer = 0;
    self->window[1].buffer = 1;
    self->finish.buffer = 2;
    restart(self);
    return PVID_OK;
}

pvid_status pvid_weak_init_q31(pvid_weak_q31 *self, const pvid_weak_config_q31 *config)
{
    const pvid_status status = pvid_init_is_given(self, config) ? prepare(self, config) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

static void next_curvature(pvid_weak_curvature_q31 *self, uint8_t lag, int32_t f)
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
        const int32_t curvature = (f - self->before[0]) - (self->before[0] - self->before[1]);
        self->square = (int64_t)curvature * curvature;
        self->due = true;
    }
    self->before[1] = self->before[0];
    self->before[0] = f;
}

void pvid_weak_gap_q31(pvid_weak_q31 *self)
{
    if (is_ready(self)) {
        restart(self);
    }
}

/* The encoder's offset may be large: before the first row c is set to the mean angle of the window. */
static void place_offset(pvid_weak_q31 *self, const pvid_weak_window_q31 *window)
{
    if (!self->zero_unknown || (self->estimator.counters.rows > 0u)) {
        return;
    }
    const uint64_t sum = pvid_magnitude_q31(pvid_scale_q31(window->f_sum, -self->zero_bits));
    const int64_t mean = (int64_t)(sum / (self->design->window - 1u));
    pvid_estimator_place_q31(&self->estimator, PVID_KAPITZA_C, (window->f_sum < 0) ? -mean : mean);
    pvid_trust_place_q31(&self->trust, &self->estimator);
}

void pvid_weak_freeze_q31(pvid_weak_q31 *self, bool frozen)
{
    if (is_ready(self)) {
        self->frozen = frozen;
    }
}

/* Exchanges the buffers of a complete window and of `finish`, which then processes the window's sums. The window's last
 * sample, where chi is 0, is the first sample of the next one, which clears the sums. Returns PVID_ACCUMULATED, or the
 * reason why the window is dropped; it then keeps its buffer. */
static pvid_reason hand_over(pvid_weak_q31 *self, pvid_weak_window_q31 *window)
{
    self->warm = true;
    if (self->frozen) {
        return PVID_HELD_FROZEN;
    }
    if (pvid_weak_window_drive_q31(window, self->design->window) < self->drive_min) {
        pvid_count_up(&self->estimator.counters.held_not_excited);
        return PVID_HELD_NOT_EXCITED;
    }
    const uint8_t full = window->buffer;
    window->buffer = self->finish.buffer;
    self->finish.buffer = full;
    place_offset(self, window);
    const pvid_scaled_q31 pivot = pvid_scaled_times_q31(self->pivot_noise, pvid_weak_window_curvature_q31(window));
    pvid_weak_finish_begin_q31(&self->finish, self->design, &self->estimator, pivot);
    return PVID_ACCUMULATED;
}

/* Begins a decimated sample in both windows. If it completes a window that is dropped, returns the reason; else
 * PVID_ACCUMULATED. */
static pvid_reason next_sample(pvid_weak_q31 *self)
{
    pvid_reason reason = PVID_ACCUMULATED;
    next_curvature(&self->curvature, self->design->lag, self->f);
    for (size_t i = 0; i < 2u; i++) {
        pvid_weak_window_q31 *window = &self->window[i];
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
static inline void add_slice(pvid_weak_q31 *self)
{
    const pvid_weak_design_q31 *design = self->design;
    pvid_weak_window_q31 *window = &self->window[self->active];
    const size_t first = self->function;
    const size_t end = first + self->functions_per_tick;
    const size_t last = (end < design->functions) ? end : design->functions;
    if (first == 0u) {
        pvid_weak_window_terms_q31(window, design, self->f, self->u, &self->curvature, self->term);
    }
    pvid_weak_window_add_q31(window, design, self->term, first, last, self->sums[window->buffer]);
    self->function = (uint8_t)last;
    if (last == design->functions) {
        self->function = 0;
        self->active++;
    }
}

static pvid_reason reject(pvid_weak_q31 *self)
{
    restart(self);
    pvid_count_up(&self->estimator.counters.rejected_saturated);
    return PVID_REJECTED_SATURATED;
}

static void advance_finish(pvid_weak_q31 *self, pvid_reason *reason)
{
    for (uint8_t i = 0; (i < self->stages_per_tick) && pvid_weak_finish_is_busy_q31(&self->finish); i++) {
        pvid_weak_finish_step_q31(&self->finish, self->design, self->iterations, self->sums[self->finish.buffer],
                                  &self->estimator, &self->trust, reason);
    }
}

static bool is_within(int64_t x, int32_t limit)
{
    return (x >= -(int64_t)limit) && (x <= limit);
}

pvid_reason pvid_weak_step_q31(pvid_weak_q31 *self, int32_t phi, int32_t y)
{
    if (!is_ready(self)) {
        return PVID_NOT_READY;
    }
    const pvid_weak_design_q31 *design = self->design;
    const int64_t angle = (int64_t)phi - self->phi_offset;
    const int64_t height = (int64_t)y - self->y_offset;
    if (!is_within(angle, design->phi_max) || !is_within(height, design->y_max)) {
        return reject(self);
    }
    pvid_reason dropped = PVID_ACCUMULATED;
    bool adding = false;
    int64_t u = 0;
    if (pvid_weak_front_step_q31(&self->front, design, (int32_t)angle, (int32_t)height, &self->f, &u)) {
        if (!is_within(u, design->u_max)) {
            return reject(self);
        }
        self->u = (int32_t)u;
        dropped = next_sample(self);
        if (design->decimation == 1u) {
            add_slice(self);
            add_slice(self);
        }
    } else if (self->active < 2u) {
        adding = true;
        add_slice(self);
        if (design->decimation == 2u) {
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
