#include "number/uncontracted.h"

#include "full_angle_f32.h"

#include <string.h>

#include "number/finite_f32.h"

enum { STAGE_FIT, STAGE_SOLVE, STAGE_SWEEP, STAGE_APPLY };
enum { PHI = 0, U = 1 };
enum { REMAINDER_Y = 0, REMAINDER_C1 = 1, REMAINDER_C2 = 2 };

#define FUNCTIONS_PER_STAGE 6u
#define SAMPLES_PER_STAGE 4u

/* Below this L2 = (l2 / rho2)^2 is implausible, and 1 / L1 too large. */
#define L2_MIN 0.05f

/* The correction begins after this many windows, with steps and errors below these; it ends at errors above the last.
 */
#define SETTLED_GROUPS 4u
#define SETTLED_STEP 0.02f
#define SETTLED_ERROR 0.05f
#define LOST_ERROR 0.2f

void pvid_weak_angle_init_f32(pvid_weak_angle_f32 *self, const pvid_weak_config_f32 *config)
{
    const pvid_weak_design_f32 *design = config->design;
    memset(self, 0, sizeof *self);
    self->length = (uint16_t)(design->window + ((design->window + 1u) / 2u));
    self->window = design->window;
    self->dt = (float)design->decimation / config->sample_rate_hz;
    self->inverse_l1_square = 1.0f / (config->l1 * config->l1);
    self->passes = config->passes;
    self->full_angle = config->full_angle;
    self->channels = (uint8_t)(config->friction ? PVID_WEAK_REMAINDERS : 1u);
    self->stage = STAGE_FIT;
}

void pvid_weak_angle_add_sample_f32(pvid_weak_angle_f32 *self, float phi, float u)
{
    self->ring[self->head][PHI] = phi;
    self->ring[self->head][U] = u;
    self->head = (uint16_t)((self->head + 1u == self->length) ? 0u : (self->head + 1u));
}

void pvid_weak_angle_begin_f32(pvid_weak_angle_f32 *self, const float p[])
{
    const bool friction = self->channels > 1u;
    self->place = (uint16_t)((self->head >= self->window) ? (self->head - self->window)
                                                          : ((self->head + self->length) - self->window));
    self->first = self->place;
    for (size_t i = 0; i < PVID_KAPITZA_P; i++) {
        self->p[i] = p[i];
    }
    self->offset = p[PVID_KAPITZA_C];
    self->friction[0] = friction ? p[PVID_KAPITZA_C1] : 0.0f;
    self->friction[1] = friction ? p[PVID_KAPITZA_C2] : 0.0f;
    self->l2 = (p[PVID_KAPITZA_D1] - p[PVID_KAPITZA_D2]) - 1.0f;
    self->physical = self->l2 > L2_MIN;
    self->l1 = p[PVID_KAPITZA_D2] / (self->physical ? self->l2 : 1.0f);
    memset(self->remainder, 0, sizeof self->remainder);
    memset(self->normal, 0, sizeof self->normal);
    self->pass = 0;
    self->index = 0;
    self->stage = STAGE_FIT;
}

/* ---- a and b of the window ---- */

/* Adds a function to the normal equations of e = A a + B b. */
static void fit_function(pvid_weak_angle_f32 *self, const float theta[], const float column[], const float remainder[])
{
    const float a = column[PVID_WEAK_COLUMN_A];
    const float b = column[PVID_WEAK_COLUMN_B];
    float e = column[PVID_WEAK_COLUMN_Y];
    for (size_t i = 0; i < PVID_KAPITZA_WEAK_THETA; i++) {
        e -= column[i] * theta[i];
    }
    e -= remainder[REMAINDER_Y];
    e -= self->friction[0] * remainder[REMAINDER_C1];
    e -= self->friction[1] * remainder[REMAINDER_C2];
    self->normal[0] += a * a;
    self->normal[1] += a * b;
    self->normal[2] += b * b;
    self->normal[3] += a * e;
    self->normal[4] += b * e;
}

static void solve(pvid_weak_angle_f32 *self)
{
    const float *n = self->normal;
    const float product = n[0] * n[2];
    const float determinant = product - (n[1] * n[1]);
    const bool regular = determinant > (1.0e-5f * product);
    const float inverse = 1.0f / (regular ? determinant : 1.0f);
    self->a = regular ? (((n[3] * n[2]) - (n[4] * n[1])) * inverse) : 0.0f;
    self->b = regular ? (((n[4] * n[0]) - (n[3] * n[1])) * inverse) : 0.0f;
    memset(self->normal, 0, sizeof self->normal);
    memset(self->next, 0, sizeof self->next);
}

/* ---- the motion, sample by sample ---- */

/* x - sin x and 1 - cos x for |x| < 1, relative error below 3e-6. */
static float sine_remainder(float x)
{
    const float x2 = x * x;
    return (x * x2) * ((1.0f / 6.0f) - (x2 * ((1.0f / 120.0f) - (x2 * (1.0f / 5040.0f)))));
}

static float versine(float x)
{
    const float x2 = x * x;
    return x2 * (0.5f - (x2 * ((1.0f / 24.0f) - (x2 * (1.0f / 720.0f)))));
}

/* Trapezoid integration by one sample; returns the double integral less dt^2/6 f. */
static float integrate(pvid_weak_integral_f32 *self, float dt, bool first, float f)
{
    const float half_dt = 0.5f * dt;
    const float once = self->once + ((self->before + f) * half_dt);
    const float twice = self->twice + ((self->once + once) * half_dt);
    self->once = first ? 0.0f : once;
    self->twice = first ? 0.0f : twice;
    self->before = f;
    return self->twice - (((dt * dt) / 6.0f) * f);
}

static size_t place_after(const pvid_weak_angle_f32 *self, size_t place)
{
    return (place + 1u == self->length) ? 0u : (place + 1u);
}

static size_t place_before(const pvid_weak_angle_f32 *self, size_t place)
{
    return (place == 0u) ? ((size_t)self->length - 1u) : (place - 1u);
}

/* e1 and e2 of the remainder, and of each friction, [channel][2]. */
typedef struct {
    float e[PVID_WEAK_REMAINDERS][2];
    float g;
} moment;

static moment moment_of(pvid_weak_angle_f32 *self)
{
    const size_t place = self->place;
    const bool first = self->index == 0u;
    const float d1 = self->p[PVID_KAPITZA_D1];
    const float d2 = self->p[PVID_KAPITZA_D2];
    const float phi = self->ring[place][PHI];
    const float after = self->ring[place_after(self, place)][PHI];
    const float before = first ? phi : self->ring[place_before(self, place)][PHI];
    const float rate = (after - before) / (first ? self->dt : (2.0f * self->dt));
    const float g = self->p[PVID_KAPITZA_W] + self->ring[place][U];
    const float angle = phi - self->offset;
    const float force = g * angle;
    const float t = self->dt * ((float)self->index - (0.5f * (float)(self->window - 1u)));
    const float i2 = integrate(&self->motion, self->dt, first, force);
    const float q =
        ((self->a + (self->b * t)) - (d1 * phi)) - (d2 * i2); /* phi: a already contains the effect of c here */
    const float q_rate = (self->b - (d1 * rate)) - (d2 * self->motion.once);
    const float k = d1 - 1.0f; /* L2 (1 + L1) */
    const float a1 = q + (k * angle);
    const float v1 = q_rate + (k * rate);
    moment now;
    memset(&now, 0, sizeof now);
    now.g = g;
    if (self->full_angle) {
        const float a2 = a1 + angle;
        const float v2 = v1 + rate;
        const float acceleration1 = (self->l2 * force) - (g * a1);
        const float acceleration2 = -(d2 * force);
        const float sine = angle - sine_remainder(angle);
        const float lift = versine(angle);
        now.e[REMAINDER_Y][0] = (g * sine_remainder(a1)) + (((lift * acceleration2) + (sine * (v2 * v2))) / self->l1);
        now.e[REMAINDER_Y][1] = (g * sine_remainder(a2)) + ((lift * acceleration1) - (sine * (v1 * v1)));
    }
    now.e[REMAINDER_C1][0] = -(v1 * self->inverse_l1_square);
    now.e[REMAINDER_C2][0] = rate * self->inverse_l1_square;
    now.e[REMAINDER_C2][1] = -(self->l1 * now.e[REMAINDER_C2][0]);
    return now;
}

/* next += chi'' (m1 + G I2(m2)). */
static void sweep_sample(pvid_weak_angle_f32 *self, const pvid_weak_design_f32 *design)
{
    const size_t functions = design->functions;
    const bool first = self->index == 0u;
    const float d1 = self->p[PVID_KAPITZA_D1];
    const float d2 = self->p[PVID_KAPITZA_D2];
    const float *chi2 = &design->chi[((3u * (size_t)self->index) + 1u) * functions];
    const moment now = moment_of(self);
    for (size_t j = 0; j < self->channels; j++) {
        const float difference = now.e[j][1] - now.e[j][0];
        const float m1 = ((d1 - 1.0f) * difference) - now.e[j][0];
        const float row = m1 + (now.g * integrate(&self->remainder_integral[j], self->dt, first, d2 * difference));
        for (size_t k = 0; (k < functions) && !first; k++) { /* chi'' is 0 at the first sample, and not read */
            self->next[k][j] += chi2[k] * row;
        }
    }
    self->place = (uint16_t)place_after(self, self->place);
    self->index++;
}

/* ---- the result ---- */

static bool remainder_is_finite(const pvid_weak_angle_f32 *self, size_t functions)
{
    float sum = 0.0f;
    for (size_t k = 0; k < functions; k++) {
        for (size_t j = 0; j < PVID_WEAK_REMAINDERS; j++) {
            sum += self->remainder[k][j] * self->remainder[k][j];
        }
    }
    return pvid_finite_f32(sum);
}

static void apply(const pvid_weak_angle_f32 *self, size_t functions, float columns[][PVID_WEAK_TERMS])
{
    const bool on = self->on && self->physical && remainder_is_finite(self, functions);
    for (size_t k = 0; k < functions; k++) {
        columns[k][PVID_WEAK_COLUMN_Y] -= on ? self->remainder[k][REMAINDER_Y] : 0.0f;
        columns[k][PVID_WEAK_COLUMN_C1] = on ? self->remainder[k][REMAINDER_C1] : 0.0f;
        columns[k][PVID_WEAK_COLUMN_C2] = on ? self->remainder[k][REMAINDER_C2] : 0.0f;
    }
}

static void end_pass(pvid_weak_angle_f32 *self)
{
    memcpy(self->remainder, self->next, sizeof self->remainder);
    self->place = self->first;
    self->index = 0;
    self->pass++;
    self->stage = (uint8_t)((self->pass < self->passes) ? STAGE_FIT : STAGE_APPLY);
}

bool pvid_weak_angle_step_f32(pvid_weak_angle_f32 *self, const pvid_weak_design_f32 *design, const float theta[],
                              float columns[][PVID_WEAK_TERMS])
{
    const size_t functions = design->functions;
    switch (self->stage) {
    case STAGE_FIT:
        for (size_t i = 0; (i < FUNCTIONS_PER_STAGE) && (self->index < functions); i++) {
            fit_function(self, theta, columns[self->index], self->remainder[self->index]);
            self->index++;
        }
        if (self->index == functions) {
            self->index = 0;
            self->stage = STAGE_SOLVE;
        }
        return false;
    case STAGE_SOLVE:
        solve(self);
        self->stage = STAGE_SWEEP;
        return false;
    case STAGE_SWEEP:
        for (size_t i = 0; (i < SAMPLES_PER_STAGE) && (self->index < self->window - 1u); i++) {
            sweep_sample(self, design);
        }
        if (self->index == self->window - 1u) { /* chi'' is 0 at the last sample too */
            end_pass(self);
        }
        return false;
    default:
        apply(self, functions, columns);
        return true;
    }
}

uint32_t pvid_weak_angle_stages_f32(const pvid_weak_angle_f32 *self, const pvid_weak_design_f32 *design)
{
    const uint32_t fit = (design->functions + (FUNCTIONS_PER_STAGE - 1u)) / FUNCTIONS_PER_STAGE;
    const uint32_t sweep = ((uint32_t)design->window + (SAMPLES_PER_STAGE - 2u)) / SAMPLES_PER_STAGE;
    return (self->passes * (fit + 1u + sweep)) + 1u;
}

bool pvid_weak_angle_switch_f32(pvid_weak_angle_f32 *self, const float p[], float worst, uint16_t groups)
{
    float moved = 0.0f;
    for (size_t i = 0; i < PVID_KAPITZA_P; i++) {
        const float step = (p[i] / self->p[i]) - 1.0f;
        const float size = (step < 0.0f) ? -step : step;
        moved = (size <= moved) ? moved : size;
    }
    const bool was_on = self->on;
    if (was_on) {
        self->on = worst <= LOST_ERROR;
    } else {
        self->on = (groups >= SETTLED_GROUPS) && (moved < SETTLED_STEP) && (worst < SETTLED_ERROR);
    }
    return self->on && !was_on;
}
