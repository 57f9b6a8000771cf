#include "weak_rig.h"

#include <stdint.h>
#include <stdlib.h>

#include "pendulum/kapitza_design_f32.h"

static pvid_weak_f32 identifier;

void weak_rig_prepare(float (*noise)(void))
{
    pvid_weak_config_f32 config = kapitza_config_f32;
    config.drive_min = NULL; /* every window is processed */
    config.range = NULL;
    config.estimator.forgetting_s = 7.4f; /* 9.6 windows: a fold at every one */
    config.estimator.kappa_min = 0.0f;
    if (pvid_weak_init_f32(&identifier, &config) != PVID_OK) {
        exit(2);
    }
    const uint32_t period = (uint32_t)kapitza_design_f32.decimation * kapitza_design_f32.hop;
    for (uint32_t i = 0; i < 4u * period; i++) {
        weak_rig_tick(0.1f * noise(), 0.01f * noise());
    }
}

void weak_rig_tick(float phi, float y)
{
    const float sample[KAPITZA_WEAK_SAMPLES] = {y, phi};
    (void)pvid_weak_step_f32(&identifier, sample);
}
