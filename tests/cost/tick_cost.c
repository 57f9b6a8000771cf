/* Runs one stage of a tick, or a whole method's tick, a given number of times, for an instruction counter.
 *
 *   tick_cost STAGE TICKS      the difference between two values of TICKS is the stage's cost
 *
 * Inputs are a fixed pseudo-random sequence; no stage's path depends on them once warm.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ekf_f32.h"
#include "pvid/pvid.h"
#include "rls_f32.h"
#include "ud_f32.h"
#include "weak_rig.h"

static uint32_t generator = 1u;

static float noise(void)
{
    generator = (generator * 1664525u) + 1013904223u;
    return ((float)(generator >> 8) / 8388608.0f) - 1.0f;
}

/* x[k+1] = 2 c x[k] - x[k-1]: a cosine without libm. */
typedef struct {
    float cosine, now, before;
} oscillator;

static float tone(oscillator *self)
{
    const float next = (2.0f * self->cosine * self->now) - self->before;
    self->before = self->now;
    self->now = next;
    return self->before;
}

#define SAMPLES 1024u
static float phi_samples[SAMPLES], y_samples[SAMPLES];
static float derivatives_phi[SAMPLES][PVID_ORDERS], derivatives_u[SAMPLES][3];
static float rows[SAMPLES][PVID_KAPITZA_STRONG_THETA], row_y[SAMPLES];

static pvid_strong_f32 identifier;
static pvid_strong_f32 exact;     /* all sums projected at every row: the paper's law literally */
static pvid_strong_f32 staged;    /* a solve at every eighth row */
static pvid_strong_f32 smoothing; /* behind a Savitzky-Golay bank of 315 samples in blocks of nine */
static rls_f32 rls;
static ud_f32 ud;
static ekf_f32 kalman;

/* Five-point differences among zeros: what the bank costs, with rows that stay those above. */
#define POINTS 17
#define BLOCK 9
static float long_bank[PVID_ORDERS * POINTS];

static void start(pvid_strong_f32 *self, const pvid_strong_config_f32 *config)
{
    if (pvid_strong_init_f32(self, config) != PVID_OK) {
        exit(2);
    }
}

/* The configurations, which the identifiers read where they are. */
static pvid_strong_config_f32 lazily, exactly, in_stages, smoothly;

static void prepare_variants(const pvid_strong_config_f32 *config)
{
    lazily = *config;
    exactly = *config;
    in_stages = *config;
    smoothly = *config;
    for (uint32_t order = 0; order < PVID_ORDERS; order++) {
        for (uint32_t i = 0; i < 2u; i++) {
            long_bank[(order * POINTS) + i] = pvid_five_points_f32[(2u * order) + i];
        }
    }
    start(&identifier, &lazily);
    exactly.exact_every = 1;
    start(&exact, &exactly);
    in_stages.estimator.divider = 8;
    start(&staged, &in_stages);
    smoothly.bank = (pvid_fir_bank_f32){.half = POINTS, .stride = 1, .block = BLOCK, .weights = long_bank};
    start(&smoothing, &smoothly);
}

/* The filter's u is a second difference of the nearest samples, its other taps 0: they cost the same. */
static void prepare_kalman(void)
{
    ekf_config_f32 config = {
        .dt = 1.0e-3f,
        .angle_variance = 5.0e-8f,
        .rate_noise = 1.0e-10f,
        .start = {31.0f, 8.9f, 5.6f},
        .start_sd = {1.5f, 0.4f, 0.3f},
        .second = {1.0e6f / 0.3f},
    };
    ekf_init_f32(&kalman, &config);
}

static void prepare(void)
{
    /* cos(2 pi f / 1000) for the rig's modes and two of its tones: smooth enough to be differentiated */
    oscillator slow = {0.9999891f, 1.0f, 0.9999891f};
    oscillator fast = {0.9998706f, 1.0f, 0.9998706f};
    oscillator pivot_slow = {0.9999761f, 1.0f, 0.9999761f};
    oscillator pivot_fast = {0.9996682f, 1.0f, 0.9996682f};
    static const float scale_phi[PVID_ORDERS] = {0.1f, 1.0f, 24.0f, 300.0f, 13000.0f};
    static const float scale_u[3] = {8.0f, 150.0f, 3000.0f};
    for (uint32_t i = 0; i < SAMPLES; i++) {
        phi_samples[i] = (0.08f * tone(&slow)) + (0.02f * tone(&fast));
        y_samples[i] = (0.006f * tone(&pivot_slow)) + (0.004f * tone(&pivot_fast));
        for (uint32_t k = 0; k < PVID_ORDERS; k++) {
            derivatives_phi[i][k] = scale_phi[k] * noise();
        }
        for (uint32_t k = 0; k < 3u; k++) {
            derivatives_u[i][k] = scale_u[k] * noise();
        }
        pvid_kapitza_strong_row_f32(derivatives_phi[i], derivatives_u[i], &row_y[i], rows[i]);
    }
    pvid_strong_config_f32 config = {
        .sample_rate_hz = 1000.0f,
        .l1 = 0.3f,
        .bank = {.half = 2, .stride = 1, .weights = pvid_five_points_f32},
        .estimator = pvid_estimator_defaults_f32,
    };
    const float start[3] = {30.0f, 9.0f, 5.0f};
    for (int i = 0; i < 3; i++) {
        config.estimator.start[i] = start[i];
        config.estimator.start_sd[i] = start[i];
        config.estimator.lower[i] = 0.01f;
        config.estimator.upper[i] = 1.0e4f;
    }
    config.estimator.row_sd = 1000.0f;
    config.estimator.feedback_hz = 10.0f;
    config.estimator.forgetting_s = 10.0f;
    prepare_variants(&config);
    prepare_kalman();
    rls_init_f32(&rls, 0.9999f, 1.0e6f);
    ud_init_f32(&ud, 0.9999f, 1.0e6f);
    weak_rig_prepare(noise);
}

static volatile float sink;

static void nothing(uint32_t i)
{
    sink = rows[i][0];
}

static void row(uint32_t i)
{
    float n[PVID_KAPITZA_STRONG_THETA];
    float y;
    pvid_kapitza_strong_row_f32(derivatives_phi[i], derivatives_u[i], &y, n);
    sink = y + n[0];
}

static void estimator(uint32_t i)
{
    sink = (float)pvid_strong_row_step_f32(&identifier, derivatives_phi[i], derivatives_u[i]);
}

static void exact_tick(uint32_t i)
{
    sink = (float)pvid_strong_step_f32(&exact, phi_samples[i], y_samples[i]);
}

static void staged_tick(uint32_t i)
{
    sink = (float)pvid_strong_step_f32(&staged, phi_samples[i], y_samples[i]);
}

static void tick(uint32_t i)
{
    sink = (float)pvid_strong_step_f32(&identifier, phi_samples[i], y_samples[i]);
}

static void smoothing_tick(uint32_t i)
{
    sink = (float)pvid_strong_step_f32(&smoothing, phi_samples[i], y_samples[i]);
}

static void kalman_tick(uint32_t i)
{
    (void)ekf_sample_f32(&kalman, phi_samples[i], y_samples[i]);
    sink = kalman.x[4];
}

static void assess(uint32_t i)
{
    pvid_estimate_f32 estimate;
    pvid_strong_assess_f32(&identifier, &estimate);
    sink = estimate.se[i % 3u];
}

static void rls_step(uint32_t i)
{
    rls_step_f32(&rls, rows[i], row_y[i]);
    sink = rls.theta[0];
}

static void ud_step(uint32_t i)
{
    ud_step_f32(&ud, rows[i], row_y[i]);
    sink = ud.theta[0];
}

/* Whole periods of 768 ticks, from window to window, make a mean. */
static void weak(uint32_t i)
{
    weak_rig_tick(phi_samples[i], y_samples[i]);
    sink = phi_samples[i];
}

static const struct {
    const char *name;
    void (*run)(uint32_t i);
} stages[] = {
    {"nothing", nothing},
    {"row", row},
    {"estimator", estimator},
    {"tick", tick},
    {"exact", exact_tick},
    {"staged", staged_tick},
    {"smoothing", smoothing_tick},
    {"assess", assess},
    {"weak", weak},
    {"rls", rls_step},
    {"ud", ud_step},
    {"kalman", kalman_tick},
};

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: tick_cost STAGE TICKS\n");
        return 2;
    }
    prepare();
    for (uint32_t i = 0; i < SAMPLES; i++) { /* warm: windows full, S positive */
        (void)pvid_strong_step_f32(&identifier, phi_samples[i], y_samples[i]);
        (void)pvid_strong_step_f32(&smoothing, phi_samples[i], y_samples[i]);
        (void)ekf_sample_f32(&kalman, phi_samples[i], y_samples[i]);
        (void)pvid_strong_step_f32(&exact, phi_samples[i], y_samples[i]);
        (void)pvid_strong_step_f32(&staged, phi_samples[i], y_samples[i]);
    }
    for (uint32_t s = 0; s < sizeof stages / sizeof stages[0]; s++) {
        if (strcmp(argv[1], stages[s].name) == 0) {
            const uint32_t ticks = (uint32_t)strtoul(argv[2], NULL, 10);
            for (uint32_t i = 0; i < ticks; i++) {
                stages[s].run(i % SAMPLES);
            }
            return 0;
        }
    }
    fprintf(stderr, "tick_cost: no stage %s\n", argv[1]);
    return 2;
}
