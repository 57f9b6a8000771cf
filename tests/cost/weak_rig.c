#include "weak_rig.h"

#include <stdlib.h>

#include "pvid/pvid.h"

#define TAPS WEAK_RIG_TAPS
#define DECIMATION WEAK_RIG_DECIMATION
#define WINDOW WEAK_RIG_WINDOW
#define FUNCTIONS WEAK_RIG_FUNCTIONS
#define PAIRS ((FUNCTIONS * (FUNCTIONS + 1)) / 2)

static float smooth[(TAPS - 1) / 2];
static float second[(TAPS - 1) / 2];
static float chi[WINDOW * 3 * FUNCTIONS];
static float gram[6 * PAIRS];

static const pvid_weak_design_f32 design = {
    .taps = TAPS,
    .decimation = DECIMATION,
    .window = WINDOW,
    .functions = FUNCTIONS,
    .smooth = smooth,
    .second = second,
    .chi = chi,
    .gram = gram,
    .overlap = 1.5f,
    .lag = 8,
};

static pvid_weak_f32 identifier;

static void fill(float table[], uint32_t n, float scale, float (*noise)(void))
{
    for (uint32_t i = 0; i < n; i++) {
        table[i] = scale * noise();
    }
}

void weak_rig_prepare(float (*noise)(void))
{
    fill(smooth, (TAPS - 1) / 2, 1.0f / (float)TAPS, noise);
    fill(second, (TAPS - 1) / 2, 1.0e-4f, noise);
    fill(chi, WINDOW * 3 * FUNCTIONS, 1.0e-3f, noise);
    for (uint32_t row = 0; row < FUNCTIONS; row++) { /* G44 = I, the others 0 */
        gram[((row * (row + 1u)) / 2u) + row] = 1.0f;
    }
    pvid_weak_config_f32 config = {
        .sample_rate_hz = 1000.0f,
        .l1 = 0.3f,
        .design = &design,
        .zero_unknown = (WEAK_RIG_ZERO != 0),
        .iterations = 3,
        .estimator = pvid_estimator_defaults_f32,
        .trust = pvid_trust_defaults_f32,
    };
    const float start[4] = {30.0f, 9.0f, 5.0f, 0.0f};
    for (uint32_t i = 0; i < 4u; i++) {
        config.estimator.start[i] = start[i];
        config.estimator.start_sd[i] = (i < 3u) ? start[i] : 0.5f;
        config.estimator.lower[i] = (i < 3u) ? 0.01f : -3.0f;
        config.estimator.upper[i] = (i < 3u) ? 1.0e4f : 3.0f;
    }
    config.estimator.row_sd = 1.0e-3f;
    config.estimator.forgetting_s = 0.0096f * (float)WEAK_RIG_PERIOD; /* 9.6 windows: a fold at every one */
    config.estimator.kappa_min = 0.0f;
    if (pvid_weak_init_f32(&identifier, &config) != PVID_OK) {
        exit(2);
    }
    for (uint32_t i = 0; i < 4u * WEAK_RIG_PERIOD; i++) {
        weak_rig_tick(0.1f * noise(), 0.01f * noise());
    }
}

void weak_rig_tick(float phi, float y)
{
    (void)pvid_weak_step_f32(&identifier, phi, y);
}
