#include "number/uncontracted.h"

#include "pvid/excite.h"

#include "number/count.h"
#include "number/finite_f32.h"
#include "number/init.h"
#include "number/unroll.h"
#include "pvid/elementary.h"

#define TURN 4294967296.0f  /* phase of a turn */
#define MOST_TICKS 2.1e9f   /* of a ramp or a burst */
#define MOST_S 1.0e6f       /* [s] */
#define GOLDEN 2654435769u  /* of a turn, by which the phases of one run differ from those of the one before */
#define FEEDBACK 0xB400u    /* of the register: x^16 + x^14 + x^13 + x^11 + 1, 65535 long */
#define LAST_PLACE 65534.0f /* of its values, which are 1..65535 */
#define TONES 8u

/* ---- init ---- */

PVID_COLD static pvid_status part_status(const pvid_excite_part_f32 *part, float rate)
{
    const bool is_chirp = part->kind == PVID_EXCITE_CHIRP;
    const bool is_steps = part->kind == PVID_EXCITE_STEPS;
    const bool is_known = (part->kind == PVID_EXCITE_TONE) || is_chirp || (part->kind == PVID_EXCITE_PRBS) || is_steps;
    if (!is_known || (is_steps && ((part->level == NULL) || (part->levels == 0u)))) {
        return PVID_BAD_EXCITE_PARTS;
    }
    if (!pvid_within_f32(part->amplitude, 0.0f, PVID_EXCITE_MOST)) {
        return PVID_BAD_EXCITE_AMPLITUDE;
    }
    for (size_t i = 0; is_steps && (i < part->levels); i++) {
        if (!pvid_within_f32(part->level[i], -1.0f, 1.0f)) {
            return PVID_BAD_EXCITE_AMPLITUDE;
        }
    }
    const float top = 0.5f * rate;
    const bool sweeps = !is_chirp || (pvid_within_f32(part->to_hz, part->hz, top) &&
                                      pvid_within_f32(part->sweep_s, 1.0f / rate, MOST_S));
    const bool begins = pvid_within_f32(part->turns, 0.0f, 1.0f);
    if (!(part->hz > 0.0f) || !pvid_within_f32(part->hz, 0.0f, top) || !begins || !sweeps) {
        return PVID_BAD_EXCITE_FREQUENCY;
    }
    return PVID_OK;
}

PVID_COLD static bool guard_is_valid(const pvid_excite_guard_f32 *guard, uint8_t measured)
{
    const float most = PVID_EXCITE_MOST_MEASURED;
    const bool ordered = pvid_within_f32(guard->low, -most, most) && pvid_within_f32(guard->high, -most, most) &&
                         (guard->low < guard->soft_low) && (guard->soft_low < guard->soft_high) &&
                         (guard->soft_high < guard->high);
    const bool is_sign = pvid_within_f32(guard->response, -1.0f, -1.0f) || pvid_within_f32(guard->response, 1.0f, 1.0f);
    const bool pushes =
        is_sign ? pvid_within_f32(guard->push, 0.0f, 1.0f)
                : (pvid_within_f32(guard->response, 0.0f, 0.0f) && pvid_within_f32(guard->push, 0.0f, 0.0f));
    const bool brakes = pvid_within_f32(guard->brake, 0.0f, 0.0f) || pvid_within_f32(guard->brake, 1.0e-6f, 1.0e12f);
    const bool looks = pvid_within_f32(guard->ahead_s, 0.0f, 1.0e3f) && brakes;
    const bool plain = pvid_within_f32(guard->ahead_s, 0.0f, 0.0f) && pvid_within_f32(guard->brake, 0.0f, 0.0f);
    return ordered && pushes && (guard->of_rate ? plain : looks) && (guard->signal < measured) &&
           pvid_within_f32(guard->smoothing_s, 0.0f, 1.0e3f);
}

PVID_COLD static bool time_is_valid(float time_s, float rate)
{
    return pvid_within_f32(time_s, 1.0f / rate, MOST_S) && ((time_s * rate) <= MOST_TICKS);
}

PVID_COLD static pvid_status tables_status(const pvid_excite_config_f32 *config)
{
    if ((config->part == NULL) || (config->parts == 0u) || (config->parts > PVID_EXCITE_PARTS)) {
        return PVID_BAD_EXCITE_PARTS;
    }
    for (size_t i = 0; i < config->parts; i++) {
        const pvid_status status = part_status(&config->part[i], config->sample_rate_hz);
        if (status != PVID_OK) {
            return status;
        }
    }
    if ((config->guards > PVID_EXCITE_GUARDS) || ((config->guards > 0u) && (config->guard == NULL))) {
        return PVID_BAD_EXCITE_GUARD;
    }
    for (size_t i = 0; i < config->guards; i++) {
        if (!guard_is_valid(&config->guard[i], config->measured)) {
            return PVID_BAD_EXCITE_GUARD;
        }
    }
    return PVID_OK;
}

PVID_COLD static pvid_status config_status(const pvid_excite_config_f32 *config)
{
    const float rate = config->sample_rate_hz;
    if (!pvid_within_f32(rate, 1.0e-3f, 1.0e6f)) {
        return PVID_BAD_SAMPLE_RATE;
    }
    if (!pvid_within_f32(config->low, -PVID_EXCITE_MOST, 0.0f) ||
        !pvid_within_f32(config->high, 0.0f, PVID_EXCITE_MOST) || !(config->low < config->high)) {
        return PVID_BAD_EXCITE_LIMIT;
    }
    const float widest = (config->high > -config->low) ? config->high : -config->low;
    if (!pvid_within_f32(config->slew, 0.0f, 1.0e12f) || !((config->slew / rate) >= (1.0e-6f * widest))) {
        return PVID_BAD_EXCITE_SLEW;
    }
    if (!time_is_valid(config->ramp_s, rate) || !time_is_valid(config->burst_s, rate)) {
        return PVID_BAD_EXCITE_TIME;
    }
    return tables_status(config);
}

PVID_COLD static uint32_t ticks_of(float time_s, float rate)
{
    const float ticks = (time_s * rate) + 0.5f;
    return (ticks < 1.0f) ? 1u : (uint32_t)ticks;
}

PVID_COLD pvid_status pvid_excite_init_f32(pvid_excite_f32 *self, const pvid_excite_config_f32 *config)
{
    if (!pvid_init_is_given(self, config)) {
        return pvid_init_end(self, sizeof *self, PVID_BAD_POINTER);
    }
    memset(self, 0, sizeof *self);
    const pvid_status status = config_status(config);
    if (status == PVID_OK) {
        const float rate = config->sample_rate_hz;
        self->config = config;
        self->ramp_ticks = ticks_of(config->ramp_s, rate);
        self->burst_ticks = ticks_of(config->burst_s, rate);
        self->per_ramp = 1.0f / (float)self->ramp_ticks;
        self->slew = config->slew / rate;
        self->turn = TURN / rate;
    }
    return pvid_init_end(self, sizeof *self, status);
}

/* ---- parts ---- */

/* Of a frequency up to half the sample rate: at most 2^31. */
static inline uint32_t advance_of(float hz, float turn)
{
    const float advance = hz * turn;
    return (advance < 2147483648.0f) ? (uint32_t)advance : 2147483648u;
}

static void begin_wave(pvid_excite_wave_f32 *wave, const pvid_excite_part_f32 *part, const pvid_excite_f32 *self,
                       uint32_t shift)
{
    const float turns = (part->turns < 1.0f) ? part->turns : 0.0f;
    const uint32_t begin = (uint32_t)(turns * TURN) + shift;
    wave->phase = begin;
    wave->advance = advance_of(part->hz, self->turn);
    wave->hz = part->hz;
    wave->slope = 0.0f;
    wave->place = 0u;
    if (part->kind == PVID_EXCITE_CHIRP) {
        wave->slope = (part->to_hz - part->hz) / (part->sweep_s * self->config->sample_rate_hz);
    }
    if (part->kind == PVID_EXCITE_PRBS) {
        wave->phase = 0u;
        const float place = 1.0f + ((float)(begin >> 8) * (LAST_PLACE / 16777216.0f));
        wave->place = (uint16_t)place;
    }
    if (part->kind == PVID_EXCITE_STEPS) {
        wave->phase = 0u;
        wave->place = (uint16_t)(((begin >> 16) * (uint32_t)part->levels) >> 16);
    }
}

/* sin of the phase, of which 24 bits fit a float. */
static inline float sine_of(uint32_t phase)
{
    return pvid_sin_f32((float)(phase >> 8) * 3.74507039e-07f); /* 2 pi / 2^24 */
}

static void sweep(pvid_excite_wave_f32 *wave, const pvid_excite_part_f32 *part, float turn)
{
    float hz = wave->hz + wave->slope;
    if (hz > part->to_hz) {
        hz = part->to_hz;
        wave->slope = -wave->slope;
    } else if (hz < part->hz) {
        hz = part->hz;
        wave->slope = -wave->slope;
    } else {
        /* on its way */
    }
    wave->hz = hz;
    wave->advance = advance_of(hz, turn);
}

static void next_place(pvid_excite_wave_f32 *wave, const pvid_excite_part_f32 *part)
{
    const uint32_t place = wave->place;
    if (part->kind == PVID_EXCITE_STEPS) {
        wave->place = ((place + 1u) < (uint32_t)part->levels) ? (uint16_t)(place + 1u) : 0u;
    } else {
        wave->place = (uint16_t)((place >> 1) ^ (((place & 1u) != 0u) ? FEEDBACK : 0u));
    }
}

/* Its value at this tick [-1..1]; then the next tick. */
static float wave_value(pvid_excite_wave_f32 *wave, const pvid_excite_part_f32 *part, float turn)
{
    const uint32_t phase = wave->phase;
    wave->phase = phase + wave->advance;
    if ((part->kind == PVID_EXCITE_TONE) || (part->kind == PVID_EXCITE_CHIRP)) {
        if (part->kind == PVID_EXCITE_CHIRP) {
            sweep(wave, part, turn);
        }
        return sine_of(phase);
    }
    float value = ((wave->place & 1u) != 0u) ? 1.0f : -1.0f;
    if (part->kind == PVID_EXCITE_STEPS) {
        value = part->level[(wave->place < part->levels) ? wave->place : 0u];
    }
    if (wave->phase < phase) {
        next_place(wave, part);
    }
    return value;
}

static float sum_of_parts(pvid_excite_f32 *self)
{
    const pvid_excite_config_f32 *config = self->config;
    float sum = 0.0f;
    for (size_t i = 0; i < config->parts; i++) {
        sum += config->part[i].amplitude * wave_value(&self->wave[i], &config->part[i], self->turn);
    }
    return sum;
}

/* ---- guards ---- */

static inline bool is_beyond(float x, float low, float high)
{
    return !((x >= low) && (x <= high));
}

/* Takes a sample. Returns whether it is finite. */
static bool follow(pvid_excite_track_f32 *track, const pvid_excite_guard_f32 *guard, float x, float rate_hz)
{
    if (!pvid_finite_f32(x)) {
        return false;
    }
    if (track->seen) {
        const float rate = (x - track->last) * rate_hz;
        track->rate += (rate - track->rate) / (1.0f + (guard->smoothing_s * rate_hz));
    }
    track->last = x;
    track->seen = true;
    return true;
}

/* How far `where` is on its way from soft to hard, 0..1. */
static inline float depth(float where, float soft, float hard)
{
    if (where <= soft) {
        return 0.0f;
    }
    return (where < hard) ? ((where - soft) / (hard - soft)) : 1.0f;
}

/* Where the signal is about to go; x is within the hard limits. */
static float about_to_be(const pvid_excite_track_f32 *track, const pvid_excite_guard_f32 *guard)
{
    const float rate = track->rate;
    float where = track->last + (rate * guard->ahead_s);
    if (guard->brake > 0.0f) {
        where += (rate * pvid_magnitude_f32(rate)) / (2.0f * guard->brake);
    }
    return where;
}

/* The drive that a limit leaves: the outward part fades, and the inward `push` is added. outward: sign of a drive that
 * pushes towards it, 0: any. */
static float held_back(float drive, float outward, float push, float share)
{
    const float along = drive * outward;
    if (!((along < 0.0f) && (share > 0.0f))) {
        return (drive * (1.0f - share)) - (outward * (push * share));
    }
    const float least = push * share;
    return (along < -least) ? drive : -(outward * least);
}

static float guarded(const pvid_excite_f32 *self, size_t i, float drive)
{
    const pvid_excite_guard_f32 *guard = &self->config->guard[i];
    const pvid_excite_track_f32 *track = &self->track[i];
    const float where = guard->of_rate ? track->rate : about_to_be(track, guard);
    const float above = depth(where, guard->soft_high, guard->high);
    const float below = depth(-where, -guard->soft_low, -guard->low);
    const float up = guard->push * self->config->high;
    const float down = -(guard->push * self->config->low);
    const bool follows = guard->response >= 0.0f;
    float left = held_back(drive, guard->response, follows ? down : up, above);
    left = held_back(left, -guard->response, follows ? up : down, below);
    return left;
}

static void end_for(pvid_excite_f32 *self, pvid_excite_reason reason, size_t guard)
{
    if (self->reason == PVID_EXCITE_FINISHED) {
        self->reason = reason;
        self->at = (uint8_t)guard;
    }
    self->state = PVID_EXCITE_FALLING;
    self->level = 0u;
    self->left = 0u;
}

static void look(pvid_excite_f32 *self, const float measured[])
{
    const pvid_excite_config_f32 *config = self->config;
    for (size_t i = 0; i < config->guards; i++) {
        const pvid_excite_guard_f32 *guard = &config->guard[i];
        pvid_excite_track_f32 *track = &self->track[i];
        if ((measured == NULL) || !follow(track, guard, measured[guard->signal], config->sample_rate_hz)) {
            end_for(self, PVID_EXCITE_SENSOR, i);
        } else if (is_beyond(guard->of_rate ? track->rate : track->last, guard->low, guard->high)) {
            end_for(self, PVID_EXCITE_HARD_LIMIT, i);
        } else {
            /* within its limits */
        }
    }
}

/* ---- the burst ---- */

/* 0..1 without a corner at either end. */
static inline float envelope(const pvid_excite_f32 *self)
{
    const float x = (float)self->level * self->per_ramp;
    return (x * x) * (3.0f - (2.0f * x));
}

static void next_tick(pvid_excite_f32 *self)
{
    if (self->state == PVID_EXCITE_RISING) {
        self->level += 1u;
        if (self->level >= self->ramp_ticks) {
            self->state = PVID_EXCITE_RUNNING;
            self->left = self->burst_ticks;
        }
    } else if (self->state == PVID_EXCITE_RUNNING) {
        self->left -= 1u;
        if (self->left == 0u) {
            self->state = PVID_EXCITE_FALLING;
            self->left = self->ramp_ticks;
        }
    } else if (self->level > 0u) {
        self->level -= 1u;
    } else if (self->left > 0u) {
        self->left -= 1u;
    } else {
        /* the drive falls to 0 */
    }
}

static float limited(float x, float low, float high)
{
    const float least = (x > low) ? x : low;
    return (least < high) ? least : high;
}

/* The drive that is wanted: of the parts while the envelope is open, then of the guards alone, then 0. */
static float wanted(pvid_excite_f32 *self)
{
    if ((self->level == 0u) && (self->left == 0u) && (self->state == PVID_EXCITE_FALLING)) {
        return 0.0f;
    }
    const float free_drive = (self->scale * envelope(self)) * sum_of_parts(self);
    float drive = limited(free_drive, self->config->low, self->config->high); /* first: a guard takes a share of it */
    for (size_t i = 0; i < self->config->guards; i++) {
        drive = guarded(self, i, drive);
    }
    const float change = drive - self->drive;
    if ((drive < free_drive) || (drive > free_drive) || (change > self->slew) || (change < -self->slew)) {
        pvid_count_up(&self->touched);
    }
    return drive;
}

float pvid_excite_step_f32(pvid_excite_f32 *self, const float measured[])
{
    if ((self == NULL) || (self->config == NULL) || (self->state == PVID_EXCITE_IDLE) ||
        (self->state == PVID_EXCITE_ENDED)) {
        return 0.0f;
    }
    look(self, measured);
    const float drive = limited(wanted(self), self->drive - self->slew, self->drive + self->slew);
    self->drive = drive;
    pvid_count_up(&self->ticks);
    next_tick(self);
    const bool is_zero = (drive <= 0.0f) && (drive >= 0.0f);
    if ((self->state == PVID_EXCITE_FALLING) && (self->level == 0u) && (self->left == 0u) && is_zero) {
        self->state = PVID_EXCITE_ENDED;
    }
    return drive;
}

bool pvid_excite_start_f32(pvid_excite_f32 *self, float scale, uint32_t run)
{
    if ((self == NULL) || (self->config == NULL) ||
        ((self->state != PVID_EXCITE_IDLE) && (self->state != PVID_EXCITE_ENDED))) {
        return false;
    }
    uint32_t shift = 0u;
    for (size_t i = 0; i < self->config->parts; i++) {
        shift += GOLDEN * run;
        begin_wave(&self->wave[i], &self->config->part[i], self, shift);
    }
    memset(self->track, 0, sizeof self->track);
    self->scale = pvid_within_f32(scale, 0.0f, 1.0f) ? scale : 0.0f;
    self->drive = 0.0f;
    self->level = 0u;
    self->left = 0u;
    self->ticks = 0u;
    self->touched = 0u;
    self->reason = PVID_EXCITE_FINISHED;
    self->at = 0u;
    self->state = PVID_EXCITE_RISING;
    return true;
}

void pvid_excite_stop_f32(pvid_excite_f32 *self)
{
    if ((self != NULL) && ((self->state == PVID_EXCITE_RISING) || (self->state == PVID_EXCITE_RUNNING))) {
        self->state = PVID_EXCITE_FALLING;
        self->left = self->ramp_ticks;
    }
}

void pvid_excite_abort_f32(pvid_excite_f32 *self)
{
    if ((self != NULL) && (self->state != PVID_EXCITE_IDLE) && (self->state != PVID_EXCITE_ENDED)) {
        end_for(self, PVID_EXCITE_ASKED, 0u);
    }
}

pvid_excite_state pvid_excite_state_of_f32(const pvid_excite_f32 *self)
{
    return (self == NULL) ? PVID_EXCITE_IDLE : self->state;
}

pvid_excite_reason pvid_excite_reason_of_f32(const pvid_excite_f32 *self, uint8_t *guard)
{
    if (guard != NULL) {
        *guard = (self == NULL) ? 0u : self->at;
    }
    return (self == NULL) ? PVID_EXCITE_FINISHED : self->reason;
}

float pvid_excite_restrained_f32(const pvid_excite_f32 *self)
{
    return ((self == NULL) || (self->ticks == 0u)) ? 0.0f : ((float)self->touched / (float)self->ticks);
}

PVID_COLD uint8_t pvid_excite_rule_f32(pvid_excite_part_f32 part[8], float amplitude, float low_hz, float top_hz)
{
    static const uint8_t multiple[TONES] = {1u, 2u, 3u, 5u, 8u, 13u, 21u, 34u};
    static const uint8_t sixteenth[TONES] = {13u, 2u, 15u, 11u, 14u, 0u, 7u, 3u}; /* of a turn, by search */
    if ((part == NULL) || !(amplitude > 0.0f) || !pvid_within_f32(amplitude, 0.0f, PVID_EXCITE_MOST) ||
        !(low_hz > 0.0f) || !pvid_within_f32(top_hz, low_hz, 5.0e5f)) {
        return 0u;
    }
    uint8_t parts = 0u;
    for (size_t i = 0; i < TONES; i++) {
        const float hz = low_hz * (float)multiple[i];
        if (hz < top_hz) {
            const pvid_excite_part_f32 tone = {
                PVID_EXCITE_TONE, 0.0f, hz, (float)sixteenth[i] * 0.0625f, 0.0f, 0.0f, NULL, 0u};
            part[parts] = tone;
            parts++;
        }
    }
    for (size_t i = 0; i < parts; i++) {
        part[i].amplitude = amplitude / (0.45f + (0.55f * (float)parts));
    }
    return parts;
}
