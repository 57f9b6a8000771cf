#include "number/uncontracted.h"

#include "pvid/robot.h"

#include <math.h>

#include "judge/publication.h"
#include "number/count.h"
#include "number/finite_f32.h"
#include "number/init.h"
#include "number/unroll.h"
#include "pvid/elementary.h"
#include "pvid/fnv_word.h"

#define SPLINES PVID_ROBOT_SPLINES
#define PAST 3u               /* white rows that the next one needs */
#define ROW_LIMIT 1.0e9f      /* of an entry of a row, a torque, a parameter, a table */
#define PIVOT 1.0e-6f         /* of the diagonal */
#define LARGEST 3.4028235e38f /* of float32 */
#define LEAST_Q 1.0e-30f      /* of Q_i */
#define GATE 256.0f           /* e^2 of an outlier, times s_i^2 */
#define DOUBT 16u             /* accepted rows that outweigh an outlier */
#define OPEN 64u              /* doubt from which the gate lets all pass */
#define FALL 9.765625e-4f     /* of Q_i, beyond which it is rounding */
#define QUADRATIC 4.0f        /* of D, where all of s_i^2 is noise of the encoders */
#define KNOWN 0.5f            /* standard error of a known parameter, of that of the start */
#define STILL 6.0f            /* times the noise of a position: a joint that has not moved */
#define RESTED (SPLINES + 1u) /* rows that contain a rest, and one that begins while a row is added */
#define MOST_TAPS 1024u
#define MOST_ROWS 1048576u
#define MOST_TICKS 65535u /* of an interval */

enum { IDLE, ASSEMBLE, NOISE, FORCES, FACTOR, BACKWARD, CORRECT, PART, ERRORS, PUBLISH };

/* Entries of a packed triangle of n rows: row i begins at triangle(i). */
static inline uint32_t triangle(uint32_t n)
{
    return (n * (n + 1u)) / 2u;
}

static inline uint16_t first_of(const pvid_robot_model_f32 *model, uint8_t joint)
{
    return (joint == 0u) ? 0u : model->end[joint - 1u];
}

/* Floats of a white row of all joints: columns, torques, changes of the columns by the added noise. */
static inline uint32_t width_of(const pvid_robot_f32 *self)
{
    return (2u * (uint32_t)self->slots) + self->config.model->joints;
}

/* Entries of S of the joints before this one. */
static uint32_t before(const pvid_robot_model_f32 *model, uint8_t joint)
{
    uint32_t sum = 0;
    for (uint8_t j = 0; j < joint; j++) {
        sum += triangle((uint32_t)model->end[j] - first_of(model, j));
    }
    return sum;
}

static uint32_t places(const pvid_robot_model_f32 *model, const pvid_robot_design_f32 *design, pvid_robot_f32 *self)
{
    const uint32_t n = model->joints;
    const uint32_t p = model->p;
    const uint32_t slots = model->end[n - 1u];
    self->slots = (uint16_t)slots;
    self->at.ring = 0;
    self->at.values = 4u * n * design->taps;
    self->at.inputs = self->at.values + (2u * (uint32_t)model->entries);
    self->at.sums = self->at.inputs + (6u * n);
    self->at.white = self->at.sums + (SPLINES * ((2u * slots) + n));
    self->at.s = self->at.white + (PAST * ((2u * slots) + n));
    self->at.d = self->at.s + before(model, model->joints);
    self->at.f = self->at.d + before(model, model->joints);
    self->at.m = self->at.f + slots;
    self->at.noise = self->at.m + triangle(p);
    self->at.z = self->at.noise + triangle(p);
    self->at.delta = self->at.z + p;
    self->at.p = self->at.delta + p;
    self->at.next = self->at.p + p;
    self->at.fresh = self->at.next + p;
    self->at.shared = self->at.fresh + (2u * p);
    self->at.copy = self->at.shared + (2u * p);
    self->at.end = self->at.copy + (2u * p);
    return self->at.end;
}

static bool are_within(const float x[], uint32_t n, float limit)
{
    bool within = x != NULL;
    for (uint32_t i = 0; within && (i < n); i++) {
        within = pvid_magnitude_f32(x[i]) <= limit; /* NaN fails the comparison */
    }
    return within;
}

static bool model_is_valid(const pvid_robot_model_f32 *model)
{
    if ((model->joints < 1u) || (model->joints > PVID_ROBOT_JOINTS) || (model->p < 1u) || (model->p > PVID_ROBOT_P) ||
        (model->entries < 1u) || (model->forces > model->entries) || (model->end == NULL) || (model->column == NULL) ||
        (model->slot == NULL) || (model->held == NULL) || (model->values == NULL) || (model->gain == NULL)) {
        return false;
    }
    bool valid = are_within(model->share, model->p, 1.0f);
    for (uint8_t j = 0; j < model->joints; j++) {
        valid = valid && pvid_within_f32(pvid_magnitude_f32(model->gain[j]), 1.0e-9f, ROW_LIMIT);
        const uint16_t first = first_of(model, j);
        valid = valid && (model->end[j] >= first) && ((uint32_t)model->end[j] <= ((uint32_t)first + model->p));
        for (uint16_t i = first; valid && (i < model->end[j]); i++) {
            valid = (model->column[i] < model->p) && ((i == first) || (model->column[i] > model->column[i - 1u]));
        }
    }
    for (uint16_t i = 0; valid && (i < model->entries); i++) {
        valid = model->slot[i] < model->end[model->joints - 1u];
    }
    return valid;
}

/* w_0 > 0, and the recursion forgets: all zeros of z^3 - w_1 z^2 - w_2 z - w_3 are within the unit circle (Jury). */
static bool white_is_stable(const float w[])
{
    const float a = w[1];
    const float b = w[2];
    const float c = w[3];
    return pvid_within_f32(w[0], 1.0e-9f, ROW_LIMIT) && (pvid_magnitude_f32(c) < 1.0f) && (((1.0f - a) - b) > c) &&
           (((1.0f + a) - b) > -c) && (pvid_magnitude_f32(b + (a * c)) < (1.0f - (c * c)));
}

static bool design_is_valid(const pvid_robot_design_f32 *design, uint32_t joints)
{
    const uint32_t ticks = (uint32_t)design->interval * design->decimation;
    return (design->taps >= 3u) && ((design->taps % 2u) == 1u) && (design->taps <= MOST_TAPS) &&
           (design->interval >= 3u) && (ticks >= 3u) && (ticks <= MOST_TICKS) &&
           are_within(design->position, design->taps / 2u, ROW_LIMIT) &&
           are_within(design->rate, design->taps / 2u, ROW_LIMIT) &&
           are_within(design->spline, SPLINES * design->interval, ROW_LIMIT) &&
           are_within(design->slope, SPLINES * design->interval, ROW_LIMIT) &&
           are_within(design->torque, 2u * SPLINES * ticks, ROW_LIMIT) &&
           are_within(design->noise, 2u * PVID_ROBOT_NOISE, ROW_LIMIT) &&
           are_within(design->noise_sd, joints, ROW_LIMIT) && white_is_stable(design->white);
}

PVID_COLD uint32_t pvid_robot_memory_f32(const pvid_robot_model_f32 *model, const pvid_robot_design_f32 *design)
{
    pvid_robot_f32 none;
    const bool valid =
        (model != NULL) && (design != NULL) && model_is_valid(model) && design_is_valid(design, model->joints);
    return valid ? places(model, design, &none) : 0u;
}

/* Ticks of an interval that add the row of a joint or do a stage of an estimate: none of those that compute values or
 * add them, where a step has others, and not the last one, which makes rows white. */
static uint32_t free_ticks(const pvid_robot_design_f32 *design)
{
    return ((uint32_t)design->interval * ((design->decimation > 2u) ? (design->decimation - 2u) : 1u)) - 1u;
}

/* Those of them that the rows of all joints take. */
static uint32_t ticks_of_rows(const pvid_robot_design_f32 *design, uint32_t joints)
{
    return (free_ticks(design) > (2u * joints)) ? (2u * joints) : joints;
}

/* Ticks that the standard error of a parameter takes: none of them more than the row of a joint. */
static uint32_t ticks_of_error(uint32_t p)
{
    const uint32_t ticks = 1u + (p / 10u);
    return (ticks < 3u) ? ticks : 3u;
}

static pvid_status prepare(pvid_robot_f32 *self, const pvid_robot_config_f32 *config, float memory[], uint32_t room)
{
    const pvid_robot_model_f32 *model = config->model;
    const pvid_robot_design_f32 *design = config->design;
    if ((model == NULL) || (design == NULL) || (memory == NULL)) {
        return PVID_BAD_POINTER;
    }
    if (!model_is_valid(model)) {
        return PVID_BAD_MODEL;
    }
    if (!design_is_valid(design, model->joints)) {
        return PVID_BAD_DESIGN;
    }
    const uint32_t rows = ticks_of_rows(design, model->joints);
    const uint32_t left = free_ticks(design);
    const uint32_t stages =
        (5u * (uint32_t)model->joints) + ((1u + ticks_of_error(model->p)) * (uint32_t)model->p) + 3u;
    if ((left <= rows) || ((config->group * (left - rows)) <= stages)) { /* and one to begin with */
        return PVID_BAD_WINDOW;
    }
    if (!are_within(config->start, model->p, ROW_LIMIT)) {
        return PVID_BAD_START;
    }
    bool positive = config->start_sd != NULL;
    for (uint8_t k = 0; positive && (k < model->p); k++) {
        positive = pvid_within_f32(config->start_sd[k], 1.0e-9f, 1.0e9f);
    }
    if (!positive) {
        return PVID_BAD_START_SD;
    }
    if ((config->memory < (8u * (uint32_t)model->p)) || (config->memory > MOST_ROWS)) {
        return PVID_BAD_FORGETTING;
    }
    memset(self, 0, sizeof *self);
    if (places(model, design, self) > room) {
        return PVID_BAD_LAYOUT;
    }
    self->config = *config;
    self->memory = memory;
    float square = 0.0f;
    for (uint32_t i = 0; i < PVID_ROBOT_NOISE; i++) {
        square += design->noise[i] * design->noise[i];
    }
    self->spread = STILL * sqrtf(square / (float)PVID_ROBOT_NOISE);
    memset(memory, 0, self->at.end * sizeof memory[0]);
    for (uint32_t k = 0; k < model->p; k++) {
        memory[self->at.p + k] = config->start[k];
        memory[self->at.fresh + k] = config->start[k];
        memory[self->at.fresh + model->p + k] = config->start_sd[k];
    }
    memcpy(&memory[self->at.shared], &memory[self->at.fresh], 2u * (size_t)model->p * sizeof memory[0]);
    memcpy(&memory[self->at.copy], &memory[self->at.fresh], 2u * (size_t)model->p * sizeof memory[0]);
    pvid_robot_gap_f32(self);
    return PVID_OK;
}

PVID_COLD pvid_status pvid_robot_init_f32(pvid_robot_f32 *self, const pvid_robot_config_f32 *config, float memory[],
                                          uint32_t room)
{
    const pvid_status status =
        pvid_init_is_given(self, config) ? prepare(self, config, memory, room) : PVID_BAD_POINTER;
    return pvid_init_end(self, sizeof *self, status);
}

PVID_COLD void pvid_robot_gap_f32(pvid_robot_f32 *self)
{
    if ((self == NULL) || (self->memory == NULL)) {
        return;
    }
    memset(&self->memory[self->at.sums], 0, (SPLINES + PAST) * (size_t)width_of(self) * sizeof self->memory[0]);
    self->filled = 0;
    self->place = 0;
    self->tick = 0;
    self->young = PAST;
    self->row = (uint8_t)(2u * self->config.model->joints);
    self->begun = false;
}

/* ---- samples and steps ---- */

/* The weight of each of the four splines, the youngest of which is `youngest`, from a table[4][length] by age. */
static void weights_of(uint32_t youngest, const float table[], uint32_t length, float weight[])
{
    PVID_UNROLL
    for (uint32_t age = 0; age < SPLINES; age++) {
        weight[((youngest + SPLINES) - age) % SPLINES] = table[age * length];
    }
}

/* The last samples of a signal, oldest first: the ring contains each of them twice. */
static inline const float *window_of(const pvid_robot_f32 *self, uint32_t signal)
{
    return &self->memory[self->at.ring + (2u * signal * self->config.design->taps) + self->place];
}

/* Adds the torques at the centre of the window to the four splines. */
static void add_torques(pvid_robot_f32 *self)
{
    const pvid_robot_model_f32 *model = self->config.model;
    const pvid_robot_design_f32 *design = self->config.design;
    const uint32_t ticks = (uint32_t)design->interval * design->decimation;
    float of_sample[SPLINES] = {0.0f, 0.0f, 0.0f, 0.0f};
    float of_hold[SPLINES] = {0.0f, 0.0f, 0.0f, 0.0f};
    weights_of(self->spline, &design->torque[self->tick], ticks, of_sample);
    weights_of(self->spline, &design->torque[(SPLINES * ticks) + self->tick], ticks, of_hold);
    float *sums = &self->memory[self->at.sums + (SPLINES * (uint32_t)self->slots)];
    for (uint32_t j = 0; j < model->joints; j++) {
        const float torque = model->gain[j] * window_of(self, model->joints + j)[design->taps / 2u];
        const float *own = model->held[j] ? of_hold : of_sample;
        PVID_UNROLL
        for (uint32_t k = 0; k < SPLINES; k++) {
            sums[(SPLINES * j) + k] += own[k] * torque;
        }
    }
}

/* q, v and the mean of sgn(v) over a step, of a joint, into in[3][n], which still has those of the step before. */
static void set_input(const pvid_robot_f32 *self, float in[], uint32_t joint, float q, float v)
{
    const uint32_t n = self->config.model->joints;
    const float jump = self->begun ? (0.5f * pvid_magnitude_f32(v - in[n + joint])) : 0.0f;
    in[joint] = q;
    in[n + joint] = v;
    in[(2u * n) + joint] = (pvid_magnitude_f32(v) >= jump) ? pvid_sign_f32(v) : (v / jump);
}

/* Rows that contain a rest of an interval are not to be used: at rest, friction is any torque up to the dry one. */
static void watch(pvid_robot_f32 *self, uint32_t joint, float q)
{
    const pvid_robot_design_f32 *design = self->config.design;
    if (pvid_magnitude_f32(q - self->from[joint]) > (self->spread * design->noise_sd[joint])) {
        self->from[joint] = q;
        self->still[joint] = 0;
    } else if (self->still[joint] < design->interval) {
        self->still[joint]++;
    } else {
        self->rest[joint] = (uint8_t)RESTED;
    }
}

/* The inputs of a step, without and with added noise, and from the first ones the values. */
static void take_step(pvid_robot_f32 *self)
{
    const pvid_robot_design_f32 *design = self->config.design;
    const uint32_t n = self->config.model->joints;
    const uint32_t half = design->taps / 2u;
    float *in = &self->memory[self->at.inputs];
    for (uint32_t j = 0; j < n; j++) {
        const uint32_t place = (self->noise + (j * (PVID_ROBOT_NOISE / n))) % PVID_ROBOT_NOISE;
        const float *x = window_of(self, j);
        const float centre = x[half];
        float q = 0.0f; /* relative to it: float32 keeps its resolution */
        float v = 0.0f;
        PVID_UNROLL_BY_FOUR
        for (uint32_t i = 1; i <= half; i++) {
            const float later = x[half + i] - centre;
            const float earlier = x[half - i] - centre;
            q += design->position[i - 1u] * (later + earlier);
            v += design->rate[i - 1u] * (later - earlier);
        }
        q += centre;
        watch(self, j, q);
        set_input(self, in, j, q, v);
        q += design->noise_sd[j] * design->noise[place];
        v += design->noise_sd[j] * design->noise[PVID_ROBOT_NOISE + place];
        set_input(self, &in[3u * n], j, q, v);
    }
    self->noise = (uint8_t)((self->noise + 1u) % PVID_ROBOT_NOISE);
    self->begun = true;
    self->config.model->values(in, &self->memory[self->at.values]);
}

/* sums[slot][4] += weight[4] value, and changes[slot][4] likewise of noisy - value, of each value. */
static void add_to_slots(float sums[], float changes[], const uint16_t slot[], const float value[], const float noisy[],
                         uint32_t values, const float weight[])
{
    const float w0 = weight[0];
    const float w1 = weight[1];
    const float w2 = weight[2];
    const float w3 = weight[3];
    for (uint32_t i = 0; i < values; i++) {
        float *sum = &sums[SPLINES * (uint32_t)slot[i]];
        float *change = &changes[SPLINES * (uint32_t)slot[i]];
        const float x = value[i];
        const float d = noisy[i] - x;
        sum[0] += w0 * x;
        sum[1] += w1 * x;
        sum[2] += w2 * x;
        sum[3] += w3 * x;
        change[0] += w0 * d;
        change[1] += w1 * d;
        change[2] += w2 * d;
        change[3] += w3 * d;
    }
}

/* Adds the values of a step, and what the noise changes in them, to the four splines. */
static void add_values(pvid_robot_f32 *self)
{
    const pvid_robot_model_f32 *model = self->config.model;
    const pvid_robot_design_f32 *design = self->config.design;
    const uint32_t step = self->tick / design->decimation;
    const uint32_t first = model->forces;
    const float *values = &self->memory[self->at.values];
    float *noisy = &self->memory[self->at.values + model->entries];
    float *sums = &self->memory[self->at.sums];
    float *changes = &sums[SPLINES * ((uint32_t)self->slots + model->joints)];
    float weight[SPLINES] = {0.0f, 0.0f, 0.0f, 0.0f};
    model->values(&self->memory[self->at.inputs + (3u * (uint32_t)model->joints)], noisy);
    weights_of(self->spline, &design->spline[step], design->interval, weight);
    add_to_slots(sums, changes, model->slot, values, noisy, first, weight);
    weights_of(self->spline, &design->slope[step], design->interval, weight);
    add_to_slots(sums, changes, &model->slot[first], &values[first], &noisy[first], model->entries - first, weight);
}

/* The oldest spline is complete: its rows become white, and its sums those of the next one. */
static void end_interval(pvid_robot_f32 *self)
{
    const float *w = self->config.design->white;
    const uint32_t width = width_of(self);
    const uint8_t oldest = (uint8_t)((self->spline + 1u) % SPLINES);
    float *sums = &self->memory[self->at.sums + oldest];
    self->spline = oldest;
    if (self->young > 0u) {
        self->young--;
        for (uint32_t i = 0; i < width; i++) {
            sums[SPLINES * i] = 0.0f;
        }
        return;
    }
    const uint8_t third = (uint8_t)((self->latest + 1u) % PAST);
    const uint8_t second = (uint8_t)((self->latest + 2u) % PAST);
    const float *last = &self->memory[self->at.white + (self->latest * width)];
    const float *middle = &self->memory[self->at.white + (second * width)];
    float *fresh = &self->memory[self->at.white + (third * width)];
    for (uint32_t i = 0; i < width; i++) {
        fresh[i] = ((w[0] * sums[SPLINES * i]) + (w[1] * last[i])) + ((w[2] * middle[i]) + (w[3] * fresh[i]));
        sums[SPLINES * i] = 0.0f;
    }
    self->latest = third;
    self->row = 0;
}

/* ---- rows ---- */

/* Rows of a joint in excess of its share of the parameters. */
static float free_rows(const pvid_robot_f32 *self, uint8_t joint)
{
    return (float)self->rows[joint] - ((float)self->config.model->p / (float)self->config.model->joints);
}

/* Enough rows of a joint for s_i^2: free_rows is 1 at least. */
static bool has_rows(const pvid_robot_f32 *self, uint8_t joint)
{
    const uint32_t n = self->config.model->joints;
    return (self->rows[joint] * n) >= ((2u * (uint32_t)self->config.model->p) + n);
}

/* The lower triangle of x x^T. */
static void add_square(float to[], const float x[], uint32_t n)
{
    float *row = to;
    for (uint32_t i = 0; i < n; i++) {
        const float own = x[i];
        PVID_UNROLL_BY_FOUR
        for (uint32_t j = 0; j <= i; j++) {
            row[j] += own * x[j];
        }
        row = &row[i + 1u];
    }
}

/* The white row of a joint at rest: the next one is white of itself. */
static pvid_reason leave_row(pvid_robot_f32 *self, uint8_t joint)
{
    const pvid_robot_model_f32 *model = self->config.model;
    float *u = &self->memory[self->at.white + (self->latest * width_of(self))];
    for (uint32_t i = first_of(model, joint); i < model->end[joint]; i++) {
        u[i] = 0.0f;
        u[(uint32_t)self->slots + model->joints + i] = 0.0f;
    }
    u[(uint32_t)self->slots + joint] = 0.0f;
    self->rest[joint]--;
    self->row = (uint8_t)(self->row + 2u);
    return PVID_HELD_NOT_EXCITED;
}

static pvid_reason add_row(pvid_robot_f32 *self)
{
    const pvid_robot_model_f32 *model = self->config.model;
    const uint8_t joint = (uint8_t)(self->row / 2u);
    if (self->rest[joint] > 0u) {
        return leave_row(self, joint);
    }
    const uint16_t first = first_of(model, joint);
    const uint32_t n = (uint32_t)model->end[joint] - first;
    const float *u = &self->memory[self->at.white + (self->latest * width_of(self)) + first];
    const float *d = &u[(uint32_t)self->slots + model->joints];
    const float *p = &self->memory[(joint < self->corrected) ? self->at.next : self->at.p];
    float *s = &self->memory[self->at.s + before(model, joint)];
    float *f = &self->memory[self->at.f + first];
    const float y = u[((uint32_t)self->slots + joint) - first];
    self->row++;
    float e = y;
    bool fits = pvid_magnitude_f32(y) <= ROW_LIMIT; /* NaN fails the comparison */
    for (uint32_t i = 0; i < n; i++) {
        e -= u[i] * p[model->column[first + i]];
        fits = fits && (pvid_magnitude_f32(u[i]) <= ROW_LIMIT) && (pvid_magnitude_f32(d[i]) <= ROW_LIMIT);
    }
    if (!fits || !(pvid_magnitude_f32(e) <= ROW_LIMIT)) {
        pvid_count_up(&self->saturated);
        return PVID_REJECTED_SATURATED;
    }
    if ((self->number > 0u) && has_rows(self, joint) && (self->doubt[joint] < OPEN) && !self->rounded[joint] &&
        ((e * e * free_rows(self, joint)) > (GATE * self->q[joint]))) {
        self->doubt[joint] += DOUBT;
        pvid_count_up(&self->outliers);
        return PVID_REJECTED_OUTLIER;
    }
    self->doubt[joint] -= (self->doubt[joint] > 0u) ? 1u : 0u;
    self->rows[joint]++;
    self->since++;
    add_square(s, u, n);
    for (uint32_t i = 0; i < n; i++) {
        f[i] += u[i] * e;
    }
    self->q[joint] += e * e;
    return PVID_ACCUMULATED;
}

/* What the added noise changes in the row that add_row has added. */
static void add_noise(pvid_robot_f32 *self)
{
    const pvid_robot_model_f32 *model = self->config.model;
    const uint8_t joint = (uint8_t)(self->row / 2u);
    const uint16_t first = first_of(model, joint);
    const uint32_t changes = (uint32_t)self->slots + model->joints + first;
    add_square(&self->memory[self->at.d + before(model, joint)],
               &self->memory[self->at.white + (self->latest * width_of(self)) + changes],
               (uint32_t)model->end[joint] - first);
    self->row++;
}

/* ---- the estimate, a stage a tick ---- */

/* All rows of a joint count less. */
static void forget(pvid_robot_f32 *self, uint8_t joint, float by)
{
    const pvid_robot_model_f32 *model = self->config.model;
    float *memory = self->memory;
    const uint32_t end = before(model, (uint8_t)(joint + 1u));
    for (uint32_t i = before(model, joint); i < end; i++) {
        memory[self->at.s + i] *= by;
        memory[self->at.d + i] *= by;
    }
    for (uint32_t i = first_of(model, joint); i < model->end[joint]; i++) {
        memory[self->at.f + i] *= by;
    }
    self->q[joint] *= by;
    const float rows = by * (float)self->rows[joint];
    self->rows[joint] = (uint32_t)rows;
}

/* 1 / s_i^2. */
static float weight_of(const pvid_robot_f32 *self, uint8_t joint)
{
    return free_rows(self, joint) / ((self->q[joint] > LEAST_Q) ? self->q[joint] : LEAST_Q);
}

/* M and the right side begin as those of the start. */
static void begin_assembly(pvid_robot_f32 *self)
{
    const pvid_robot_model_f32 *model = self->config.model;
    float *memory = self->memory;
    memset(&memory[self->at.m], 0, triangle(model->p) * sizeof memory[0]);
    for (uint32_t k = 0; k < model->p; k++) {
        const float sd = self->config.start_sd[k];
        const float weight = 1.0f / (sd * sd);
        memory[self->at.m + triangle(k) + k] = weight;
        memory[self->at.z + k] = weight * (self->config.start[k] - memory[self->at.p + k]);
    }
}

/* Adds the triangle of a joint to that of all parameters. */
static void assemble(pvid_robot_f32 *self, uint8_t joint, uint32_t from, uint32_t to)
{
    const pvid_robot_model_f32 *model = self->config.model;
    const float weight = weight_of(self, joint);
    const uint16_t first = first_of(model, joint);
    const float *x = &self->memory[from + before(model, joint)];
    for (uint32_t i = first; i < model->end[joint]; i++) {
        float *row = &self->memory[to + triangle(model->column[i])];
        PVID_UNROLL_BY_FOUR
        for (uint32_t j = first; j <= i; j++) {
            row[model->column[j]] += weight * x[j - first];
        }
        x = &x[(i - first) + 1u];
    }
}

/* Adds F and D p to the right side. */
static void add_forces(pvid_robot_f32 *self, uint8_t joint)
{
    const pvid_robot_model_f32 *model = self->config.model;
    float *memory = self->memory;
    const float weight = weight_of(self, joint);
    const uint8_t *column = &model->column[first_of(model, joint)];
    const uint32_t n = (uint32_t)model->end[joint] - first_of(model, joint);
    const float *d = &memory[self->at.d + before(model, joint)];
    float p[PVID_ROBOT_P];
    float sum[PVID_ROBOT_P];
    for (uint32_t i = 0; i < n; i++) {
        p[i] = model->share[column[i]] * memory[self->at.p + column[i]];
        sum[i] = memory[self->at.f + first_of(model, joint) + i];
    }
    for (uint32_t i = 0; i < n; i++) {
        float mine = d[i] * p[i];
        PVID_UNROLL_BY_FOUR
        for (uint32_t j = 0; j < i; j++) {
            mine += d[j] * p[j];
            sum[j] += d[j] * p[i];
        }
        sum[i] += mine;
        d = &d[i + 1u];
    }
    for (uint32_t i = 0; i < n; i++) {
        memory[self->at.z + column[i]] += weight * sum[i];
    }
}

static float product(const float x[], const float y[], uint32_t n)
{
    float sum = 0.0f;
    PVID_UNROLL_BY_FOUR
    for (uint32_t k = 0; k < n; k++) {
        sum += x[k] * y[k];
    }
    return sum;
}

/* Row i of L, M - D = L L^T, in the place of M's, and z = L^-1 of the right side; false: a pivot is too small. */
static bool factor_row(float m[], const float d[], float z[], uint32_t i)
{
    float *row = &m[triangle(i)];
    for (uint32_t j = 0; j < (i + 1u); j++) {
        row[j] -= d[triangle(i) + j];
    }
    const float diagonal = row[i];
    for (uint32_t j = 0; j < i; j++) {
        const float *other = &m[triangle(j)];
        row[j] = (row[j] - product(row, other, j)) / other[j];
    }
    const float pivot = diagonal - product(row, row, i);
    if (!(pivot > (PIVOT * diagonal)) || !pvid_finite_f32(pivot)) {
        return false;
    }
    row[i] = sqrtf(pivot);
    z[i] = (z[i] - product(row, z, i)) / row[i];
    return true;
}

/* x = L^-T z in the place of z[n], whose entries below `last` are needed; z is zero behind it where it is shorter. */
static void backward(const float m[], float z[], uint32_t n)
{
    for (uint32_t i = n; i > 0u; i--) {
        const float *row = &m[triangle(i - 1u)];
        const float x = z[i - 1u] / row[i - 1u];
        z[i - 1u] = x;
        PVID_UNROLL_BY_FOUR
        for (uint32_t k = 0; k < (i - 1u); k++) {
            z[k] -= row[k] * x;
        }
    }
}

/* z = L^-1 z [n], whose entries before k are 0. */
static void forward(const float m[], float z[], uint32_t k, uint32_t n)
{
    for (uint32_t i = k; i < n; i++) {
        const float *row = &m[triangle(i)];
        z[i] = (z[i] - product(&row[k], &z[k], i - k)) / row[i];
    }
}

/* x^T D x of a lower triangle. */
static float quadratic(const float d[], const float x[], uint32_t n)
{
    const float *row = d;
    float sum = 0.0f;
    for (uint32_t i = 0; i < n; i++) {
        sum += x[i] * ((2.0f * product(row, x, i)) + (row[i] * x[i]));
        row = &row[i + 1u];
    }
    return sum;
}

/* F and Q of a joint at p + delta. */
static void correct(pvid_robot_f32 *self, uint8_t joint)
{
    const pvid_robot_model_f32 *model = self->config.model;
    const uint16_t first = first_of(model, joint);
    const uint32_t n = (uint32_t)model->end[joint] - first;
    const float *s = &self->memory[self->at.s + before(model, joint)];
    const float *delta = &self->memory[self->at.delta];
    float *f = &self->memory[self->at.f + first];
    float d[PVID_ROBOT_P];
    float change = 0.0f;
    for (uint32_t i = 0; i < n; i++) {
        d[i] = delta[model->column[first + i]];
        change -= d[i] * f[i];
    }
    for (uint32_t i = 0; i < n; i++) {
        float sum = s[i] * d[i];
        PVID_UNROLL_BY_FOUR
        for (uint32_t j = 0; j < i; j++) {
            sum += s[j] * d[j];
            f[j] -= s[j] * d[i];
        }
        f[i] -= sum;
        s = &s[i + 1u];
    }
    for (uint32_t i = 0; i < n; i++) {
        change -= d[i] * f[i];
    }
    const float q = self->q[joint] + change;
    const float before_it = self->q[joint];
    self->q[joint] = q;
    self->rounded[joint] = q < (FALL * before_it);
    self->corrected = (uint8_t)(joint + 1u);
}

/* p + delta; false: it is beyond its limit. */
static bool take_delta(pvid_robot_f32 *self)
{
    const uint32_t n = self->config.model->p;
    float *memory = self->memory;
    backward(&memory[self->at.m], &memory[self->at.z], n);
    memcpy(&memory[self->at.delta], &memory[self->at.z], n * sizeof memory[0]);
    for (uint32_t k = 0; k < n; k++) {
        memory[self->at.next + k] = memory[self->at.p + k] + memory[self->at.delta + k];
    }
    return are_within(&memory[self->at.next], n, ROW_LIMIT);
}

/* Times the noise in the columns: the variance of the estimate beyond that of columns without. */
static float wider(const pvid_robot_f32 *self)
{
    return 1.0f + (QUADRATIC * self->part);
}

/* `part` of a joint and of those before it; 1 in place of that of a joint that begins again. */
static void end_correction(pvid_robot_f32 *self, uint8_t joint)
{
    const pvid_robot_model_f32 *model = self->config.model;
    const uint32_t n = (uint32_t)model->end[joint] - first_of(model, joint);
    float part = 1.0f;
    if (self->rounded[joint]) {
        forget(self, joint, 0.0f);
        self->rounded[joint] = false;
    } else {
        float p[PVID_ROBOT_P];
        for (uint32_t i = 0; i < n; i++) {
            p[i] = self->memory[self->at.p + model->column[first_of(model, joint) + i]];
        }
        const float noise = quadratic(&self->memory[self->at.d + before(model, joint)], p, n) * weight_of(self, joint);
        part = (noise < (float)self->rows[joint]) ? (noise / (float)self->rows[joint]) : 1.0f;
    }
    self->part = ((joint == 0u) || (part > self->part)) ? part : self->part;
}

/* x = L^-1 e_k, x = A^-1 e_k, its variance: by their number in the last one, two or three ticks. */
static pvid_reason find_error(pvid_robot_f32 *self, uint32_t k, uint32_t tick)
{
    const uint32_t n = self->config.model->p;
    float *x = &self->memory[self->at.z];
    const uint32_t ticks = ticks_of_error(n);
    if (tick == 0u) {
        memset(x, 0, n * sizeof x[0]);
        x[k] = 1.0f;
        forward(&self->memory[self->at.m], x, k, n);
    }
    if ((tick + 2u) == ((ticks > 2u) ? ticks : 2u)) {
        backward(&self->memory[self->at.m], x, n);
    }
    if ((tick + 1u) < ticks) {
        return PVID_ACCUMULATED;
    }
    const float noise = quadratic(&self->memory[self->at.noise], x, n);
    const float error = sqrtf(x[k] + (wider(self) * noise));
    self->memory[self->at.fresh + n + k] = error;
    return ((noise <= x[k]) && (error < (KNOWN * self->config.start_sd[k]))) ? PVID_ACCUMULATED : PVID_HELD_UNCERTAIN;
}

static void publish(pvid_robot_f32 *self)
{
    float *memory = self->memory;
    const uint32_t n = self->config.model->p;
    memcpy(&memory[self->at.fresh], &memory[self->at.p], n * sizeof memory[0]);
    pvid_count_up(&self->number);
    pvid_publication_write(&self->mark, &memory[self->at.shared], &memory[self->at.copy], &memory[self->at.fresh],
                           2u * (size_t)n * sizeof memory[0], self->number);
}

/* One stage; the next one, or the next joint or parameter, follows. */
static pvid_reason do_stage(pvid_robot_f32 *self)
{
    const uint32_t n = self->config.model->p;
    float *memory = self->memory;
    const uint8_t i = self->index;
    uint32_t all = 1; /* of the stage */
    pvid_reason held = PVID_ACCUMULATED;
    pvid_reason reason = PVID_ACCUMULATED;
    switch (self->stage) {
    case ASSEMBLE:
        all = self->config.model->joints;
        if (i == 0u) {
            begin_assembly(self);
        }
        assemble(self, i, self->at.s, self->at.m);
        break;
    case NOISE:
        all = self->config.model->joints;
        if (i == 0u) {
            memset(&memory[self->at.noise], 0, triangle(n) * sizeof memory[0]);
        }
        assemble(self, i, self->at.d, self->at.noise);
        break;
    case FORCES:
        all = self->config.model->joints;
        add_forces(self, i);
        break;
    case FACTOR:
        all = n;
        held = factor_row(&memory[self->at.m], &memory[self->at.noise], &memory[self->at.z], i) ? PVID_ACCUMULATED
                                                                                                : PVID_HELD_SINGULAR;
        break;
    case BACKWARD:
        held = take_delta(self) ? PVID_ACCUMULATED : PVID_HELD_SINGULAR;
        break;
    case CORRECT:
        all = self->config.model->joints;
        correct(self, i);
        if ((i + 1u) == all) {
            memcpy(&memory[self->at.p], &memory[self->at.next], n * sizeof memory[0]);
            self->corrected = 0;
        }
        break;
    case PART:
        all = self->config.model->joints;
        end_correction(self, i);
        break;
    case ERRORS:
        all = ticks_of_error(n) * n;
        held = find_error(self, i / ticks_of_error(n), i % ticks_of_error(n));
        break;
    case PUBLISH:
        self->factor = true;
        publish(self);
        reason = PVID_UPDATED;
        break;
    default:
        break;
    }
    self->index = (uint8_t)(i + 1u);
    if (held != PVID_ACCUMULATED) {
        pvid_count_up(&self->held);
        self->stage = IDLE;
        return held;
    }
    if (self->index >= all) {
        self->index = 0;
        self->stage = (uint8_t)((self->stage == PUBLISH) ? IDLE : (self->stage + 1u));
    }
    return reason;
}

/* What a free tick does: the row of a joint, what noise changes in it, else a stage. Where an interval has too few free
 * ticks the first two are one. */
static pvid_reason do_task(pvid_robot_f32 *self)
{
    const pvid_robot_model_f32 *model = self->config.model;
    if ((self->row % 2u) == 1u) {
        add_noise(self);
        return PVID_ACCUMULATED;
    }
    if (self->row < (2u * model->joints)) {
        const pvid_reason reason = add_row(self);
        if ((reason == PVID_ACCUMULATED) && (ticks_of_rows(self->config.design, model->joints) == model->joints)) {
            add_noise(self);
        }
        return reason;
    }
    if (self->stage != IDLE) {
        return do_stage(self);
    }
    bool enough = self->since >= ((uint32_t)self->config.group * model->joints);
    for (uint8_t j = 0; j < model->joints; j++) {
        if (self->rows[j] >= self->config.memory) { /* whether or not estimates are held */
            forget(self, j, 0.5f);
            return PVID_ACCUMULATED;
        }
        enough = enough && has_rows(self, j);
    }
    if (enough) {
        self->since = 0;
        self->index = 0;
        self->stage = ASSEMBLE;
        self->factor = false;
    }
    return PVID_ACCUMULATED;
}

pvid_reason pvid_robot_step_f32(pvid_robot_f32 *self, const float sample[])
{
    if ((self == NULL) || (self->memory == NULL) || (sample == NULL)) {
        return PVID_NOT_READY;
    }
    const pvid_robot_design_f32 *design = self->config.design;
    const uint32_t n = self->config.model->joints;
    if (!are_within(sample, n, PVID_ANGLE_LIMIT_F32) || !are_within(&sample[n], n, ROW_LIMIT)) {
        pvid_count_up(&self->rejected);
        pvid_robot_gap_f32(self);
        return are_within(sample, 2u * n, LARGEST) ? PVID_REJECTED_SATURATED : PVID_REJECTED_NOT_FINITE;
    }
    for (uint32_t i = 0; i < (2u * n); i++) {
        float *ring = &self->memory[self->at.ring + (2u * i * design->taps)];
        ring[self->place] = sample[i];
        ring[(uint32_t)self->place + design->taps] = sample[i];
    }
    self->place = (uint16_t)(((self->place + 1u) < design->taps) ? (self->place + 1u) : 0u);
    if (self->filled < design->taps) {
        self->filled++;
        if (self->filled < design->taps) {
            return PVID_WARMING_UP;
        }
    }
    const uint32_t within = self->tick % design->decimation;
    const uint32_t last = (uint32_t)design->decimation - 1u;
    add_torques(self);
    if (within == 0u) {
        take_step(self);
    }
    if (within == ((last > 0u) ? 1u : 0u)) {
        add_values(self);
    }
    const bool is_end = (self->tick + 1u) == ((uint32_t)design->interval * design->decimation);
    const bool is_free = !is_end && ((last > 1u) ? (within > 1u) : (within == last));
    const pvid_reason reason = is_free ? do_task(self) : PVID_ACCUMULATED;
    self->tick++;
    if ((reason == PVID_REJECTED_OUTLIER) || (reason == PVID_REJECTED_SATURATED)) {
        pvid_robot_gap_f32(self);
    } else if (is_end) {
        self->tick = 0;
        end_interval(self);
    } else {
        /* an interval goes on */
    }
    return ((reason == PVID_ACCUMULATED) && (self->number == 0u) && (self->rows[0] == 0u)) ? PVID_WARMING_UP : reason;
}

/* ---- results ---- */

bool pvid_robot_read_f32(const pvid_robot_f32 *self, float estimate[], uint32_t *number)
{
    if ((self == NULL) || (self->memory == NULL) || (estimate == NULL)) {
        return false;
    }
    return pvid_publication_read(&self->mark, &self->memory[self->at.shared], &self->memory[self->at.copy], estimate,
                                 2u * (size_t)self->config.model->p * sizeof estimate[0], number);
}

bool pvid_robot_covariance_f32(const pvid_robot_f32 *self, uint8_t k, float out[])
{
    if ((self == NULL) || (self->memory == NULL) || (out == NULL) || !self->factor || (k >= self->config.model->p)) {
        return false;
    }
    const uint32_t n = self->config.model->p;
    const float *m = &self->memory[self->at.m];
    const float *row = &self->memory[self->at.noise];
    float x[PVID_ROBOT_P] = {0.0f};
    x[k] = 1.0f;
    forward(m, x, k, n);
    backward(m, x, n);
    memset(out, 0, n * sizeof out[0]);
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t j = 0; j < i; j++) {
            out[i] += row[j] * x[j];
            out[j] += row[j] * x[i];
        }
        out[i] += row[i] * x[i];
        row = &row[i + 1u];
    }
    forward(m, out, 0, n);
    backward(m, out, n);
    for (uint32_t i = 0; i < n; i++) {
        out[i] = x[i] + (wider(self) * out[i]);
    }
    return true;
}

uint32_t pvid_robot_hash_f32(uint32_t hash, const pvid_robot_f32 *self, pvid_reason reason)
{
    const float *memory = self->memory;
    const uint32_t n = self->config.model->p;
    for (uint32_t k = 0; k < n; k++) {
        hash = pvid_fnv_word(hash, pvid_bits_f32(memory[self->at.p + k]));
        hash = pvid_fnv_word(hash, pvid_bits_f32(memory[self->at.fresh + n + k]));
    }
    for (uint32_t i = 0; i < self->slots; i++) {
        hash = pvid_fnv_word(hash, pvid_bits_f32(memory[self->at.f + i]));
    }
    for (uint32_t j = 0; j < self->config.model->joints; j++) {
        hash = pvid_fnv_word(hash, pvid_bits_f32(self->q[j]));
    }
    return pvid_fnv_word(hash, (uint32_t)reason);
}
