/* The estimator on rows of your own: a flywheel, torque = J a + b v + c sign(v). Equations in ten lines of Python
 * instead, without derivatives of noisy signals: `pvid model build`. */
#include <stdio.h>

#include "pvid/estimator.h"

#define PARAMETERS 3

/* theta = p: the torque is linear in J, b and c. */
static void theta(const float p[], float out[])
{
    for (int k = 0; k < PARAMETERS; k++) {
        out[k] = p[k];
    }
}

static void jacobian(const float p[], float c[])
{
    (void)p;
    for (int k = 0; k < PARAMETERS; k++) {
        c[k] = 1.0f;
    }
}

static const uint8_t diagonal[PARAMETERS] = {0, 1, 2};

static pvid_model_f32 flywheel; /* what is not set below is 0: the estimator does without */

static void describe(void)
{
    flywheel.n_theta = PARAMETERS;
    flywheel.n_p = PARAMETERS;
    flywheel.n_moments = PARAMETERS * (PARAMETERS + 1) / 2;
    flywheel.n_c = PARAMETERS;
    flywheel.positive = 7u; /* all three */
    flywheel.c_row = diagonal;
    flywheel.c_column = diagonal;
    flywheel.theta = theta;
    flywheel.jacobian = jacobian;
}

static const float truth[PARAMETERS] = {0.02f, 0.05f, 0.1f}; /* kg m^2, N m s, N m */

int main(void)
{
    static pvid_estimator_f32 estimator;
    pvid_estimator_config_f32 config = pvid_estimator_defaults_f32;
    describe();
    config.model = &flywheel;
    for (int k = 0; k < PARAMETERS; k++) {
        config.start[k] = 0.03f;
        config.start_sd[k] = 0.03f;
        config.lower[k] = 0.001f;
        config.upper[k] = 1.0f;
    }
    config.row_sd = 0.01f; /* noise of the torque [N m] */
    config.update_rate_hz = 1000.0f;
    const pvid_status status = pvid_estimator_init_f32(&estimator, &config);
    if (status != PVID_OK) {
        return 1;
    }
    float v = 0.0f;
    uint32_t seed = 1u;
    for (int tick = 0; tick < 5000; tick++) { /* your rig: sensors; here a simulation */
        const float drive = (((tick / 200) % 2) != 0) ? 1.0f : -1.0f;
        const float sign = (v > 0.0f) ? 1.0f : -1.0f;
        const float a = (drive - (truth[1] * v) - (truth[2] * sign)) / truth[0];
        seed = (seed * 1664525u) + 1013904223u;
        const float noise = 0.017f * (((float)(seed >> 8) / 8388608.0f) - 1.0f);
        const float row[PARAMETERS] = {a, v, sign};
        (void)pvid_estimator_step_f32(&estimator, row, drive + noise);
        v += 0.001f * a;
    }
    pvid_estimate_f32 estimate;
    pvid_estimator_assess_f32(&estimator, &estimate);
    for (int k = 0; k < PARAMETERS; k++) {
        printf("%.5f +- %.5f, in truth %.5f\n", (double)estimate.p[k], (double)estimate.se[k], (double)truth[k]);
    }
    return 0;
}
