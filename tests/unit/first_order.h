/* A small mechanism for the weak form, made by hand: x' = a u - b x + c + d sgn(u), with channels of all kinds. Its
 * model, a design, a configuration, and the mechanism itself, simulated in double. */
#ifndef FIRST_ORDER_H
#define FIRST_ORDER_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "pvid/weak.h"

#define PI 3.14159265358979323846

/* Channels: u, u I[x], u t, u I^2[x], x, sgn(u), 1. Only u, x, sgn(u) and 1 are in rows; the others are summed. */
enum { U, U_I1, U_T, U_I2, X, SIGN, ONE, CHANNELS };

static void prepare_of(const float jet[], float out[])
{
    out[0] = jet[0]; /* derivative of a run: u */
    out[1] = jet[0]; /* argument of sgn */
}

static void values_of(const float in[], float out[])
{
    /* u, x, the run of u (no gain), sgn(u) */
    out[0] = in[0];
    out[1] = in[1];
    out[2] = in[3];
    out[3] = in[1]; /* the integrand */
}

static void form_of(const float gain[], const float integral[], float t, float channel[])
{
    channel[U] = gain[0];
    channel[U_I1] = gain[0] * integral[0];
    channel[U_T] = gain[0] * t;
    channel[U_I2] = gain[0] * integral[1];
    channel[X] = gain[1];
    channel[SIGN] = gain[2];
}

static void theta_of(const float p[], float theta[])
{
    memcpy(theta, p, 4u * sizeof theta[0]);
}

static void jacobian_of(const float p[], float c[])
{
    (void)p;
    for (int i = 0; i < 4; i++) {
        c[i] = 1.0f;
    }
}

static const uint8_t diagonal[4] = {0, 1, 2, 3};
static const pvid_model_f32 parameters = {
    .n_theta = 4,
    .n_p = 4,
    .n_moments = 10,
    .n_c = 4,
    .positive = 3u,
    .c_row = diagonal,
    .c_column = diagonal,
    .theta = theta_of,
    .jacobian = jacobian_of,
};

static const pvid_weak_signal signals[2] = {{0, PVID_SIGNAL_SAMPLED}, {1, PVID_SIGNAL_SAMPLED}};
static const pvid_weak_jet jets[2] = {{0, 0}, {1, 0}};
static const pvid_weak_channel channels[CHANNELS] = {
    [U] = {0, PVID_WEAK_NONE, 0, PVID_WEAK_NONE, PVID_WEAK_NONE},
    [U_I1] = {0, 0, 1, U, PVID_WEAK_NONE},
    [U_T] = {0, PVID_WEAK_NONE, 1, U, PVID_WEAK_NONE},
    [U_I2] = {0, 0, 2, U, U_T},
    [X] = {1, PVID_WEAK_NONE, 0, PVID_WEAK_NONE, PVID_WEAK_NONE},
    [SIGN] = {2, PVID_WEAK_NONE, 0, PVID_WEAK_NONE, PVID_WEAK_NONE},
    [ONE] = {PVID_WEAK_NONE, PVID_WEAK_NONE, 0, PVID_WEAK_NONE, PVID_WEAK_NONE},
};
static const pvid_weak_term_f32 terms[5] = {
    {U, 0, 0, 1.0f}, {X, 0, 1, -1.0f}, {ONE, 0, 2, 1.0f}, {SIGN, 0, 3, 1.0f}, {X, 1, 4, 1.0f}};
static const pvid_weak_kind kinds[1] = {{4, 0, 0, 5}};

static const pvid_weak_model_f32 mechanism = {
    .samples = 2,
    .signals = 2,
    .jets = 2,
    .runs = 1,
    .signs = 1,
    .gains = 3,
    .integrands = 1,
    .channels = CHANNELS,
    .kinds = 1,
    .signal = signals,
    .jet = jets,
    .channel = channels,
    .term = terms,
    .kind = kinds,
    .prepare = prepare_of,
    .values = values_of,
    .form = form_of,
    .model = &parameters,
};

#define RATE 200.0 /* samples a second */
#define HOP 48
#define FUNCTIONS 9
#define POWER 4
#define HIGHEST ((FUNCTIONS / 2) + (POWER / 2))
#define SD 1.0e-4

static float circle[(5 * HOP) / 2];
static const pvid_weak_filter_f32 filters[2] = {{0, NULL}, {0, NULL}};
static const pvid_weak_noise_f32 noise[2] = {{0, 0, 1, 1, (float)(SD * SD)}, {0, 1, 4, 4, (float)(SD * SD)}};
static const uint8_t error_order[1] = {0};
static const float error_variance[1] = {0.0f};
static const float sign_width[1] = {0.0f};
static const double truth[4] = {3.0, 2.0, 0.5, 0.2};

static inline pvid_weak_design_f32 design_of(const pvid_weak_model_f32 *model)
{
    for (int j = 0; j < (5 * HOP) / 2; j++) {
        const double turn = PI * (double)j / (double)HOP;
        circle[j] = ((j % HOP) == 0) ? 0.0f : (float)sin(turn);
    }
    const pvid_weak_design_f32 design = {
        .model = model,
        .functions = FUNCTIONS,
        .power = POWER,
        .decimation = 1,
        .hop = HOP,
        .compensator = filters,
        .circle = circle,
        .noise = noise,
        .n_noise = 2,
        .error_order = error_order,
        .error_variance = error_variance,
        .sign_width = sign_width,
        .overlap = 1.4f,
    };
    return design;
}

static inline pvid_weak_config_f32 config_of(const pvid_weak_design_f32 *design)
{
    pvid_weak_config_f32 config = {
        .sample_rate_hz = (float)RATE,
        .design = design,
        .compensation = true,
        .iterations = 3,
        .estimator = pvid_estimator_defaults_f32,
        .trust = pvid_trust_defaults_f32,
    };
    const float start[4] = {2.0f, 3.0f, 0.0f, 0.0f};
    for (int i = 0; i < 4; i++) {
        config.estimator.start[i] = start[i];
        config.estimator.start_sd[i] = 2.0f;
        config.estimator.lower[i] = (i < 2) ? 0.1f : -10.0f;
        config.estimator.upper[i] = 20.0f;
    }
    config.estimator.row_sd = 1.0f;
    return config;
}

/* u, and x by steps of a hundredth of a tick with the exact solution for a constant input. */
static inline double drive(double t)
{
    return sin(7.0 * t) + (0.7 * sin((19.0 * t) + 1.0)) + (0.5 * cos(31.0 * t));
}

typedef struct {
    double t;
    double x;
    uint32_t generator;
} first_order;

static inline float noise_of(first_order *self)
{
    double sum = 0.0; /* of 12 uniform numbers: variance 1 */
    for (int i = 0; i < 12; i++) {
        self->generator = (self->generator * 1664525u) + 1013904223u;
        sum += ((double)(self->generator >> 8) / 16777216.0) - 0.5;
    }
    return (float)(SD * sum);
}

static inline void next_sample(first_order *self, float sample[2])
{
    sample[0] = (float)drive(self->t);
    sample[1] = (float)self->x + noise_of(self);
    const int parts = 100;
    const double h = 1.0 / (RATE * (double)parts);
    for (int i = 0; i < parts; i++) {
        const double u = drive(self->t + (0.5 * h));
        const double input = (truth[0] * u) + truth[2] + (truth[3] * ((u > 0.0) ? 1.0 : -1.0));
        const double settled = input / truth[1];
        self->x = settled + ((self->x - settled) * exp(-truth[1] * h));
        self->t += h;
    }
}

#endif
