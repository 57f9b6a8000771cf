/* A simulated rig; host/src/pvid/twin/sensor.py documents it and computes the same operations. */
#include "sensor.h"

#include "stream_rig.h"

#define TONES 3u
#define SEED 2463534242u
#define NOISE_DRAWS 3u

static const struct {
    uint16_t steps; /* a sample */
    float step_squared;
    float w;
    float ratio2;
    float coupling;
    float phi1; /* release [rad] */
    float phi;
    float counts_per_rad;
    float counts_per_m;
    float tones[TONES][4]; /* position, velocity, stiffness, share of u */
} constants = STREAM_SENSOR_CONSTANTS;

static struct {
    uint32_t seed;
    float phi1; /* [rad] */
    float phi;
    float velocity1; /* [rad/step] */
    float velocity;
    float position[TONES];      /* [m] */
    float tone_velocity[TONES]; /* [m/step] */
} rig;

void sensor_start(void)
{
    rig.seed = SEED;
    rig.phi1 = constants.phi1;
    rig.phi = constants.phi;
    rig.velocity1 = 0.0f;
    rig.velocity = 0.0f;
    for (uint32_t k = 0; k < TONES; k++) {
        rig.position[k] = constants.tones[k][0];
        rig.tone_velocity[k] = constants.tones[k][1];
    }
}

static int32_t read(float value, float counts_per_unit)
{
    int32_t noise = 0;
    for (uint32_t draw = 0; draw < NOISE_DRAWS; draw++) {
        rig.seed = (rig.seed * 1664525u) + 1013904223u;
        noise += (int32_t)(rig.seed >> 16) - 32768;
    }
    const float noisy = (value * counts_per_unit) + ((float)noise * (1.0f / 65536.0f));
    const float raised = noisy + 0.5f;
    const int32_t toward_zero = (int32_t)raised;
    return ((float)toward_zero > raised) ? (toward_zero - 1) : toward_zero;
}

static void advance(void)
{
    float gain = constants.w;
    for (uint32_t k = 0; k < TONES; k++) {
        gain = gain + (constants.tones[k][3] * rig.position[k]);
    }
    gain = gain * constants.step_squared;
    rig.velocity1 = rig.velocity1 + (gain * ((constants.ratio2 * rig.phi) - rig.phi1));
    rig.velocity = rig.velocity + (gain * (rig.phi1 - (constants.coupling * rig.phi)));
    rig.phi1 = rig.phi1 + rig.velocity1;
    rig.phi = rig.phi + rig.velocity;
    for (uint32_t k = 0; k < TONES; k++) {
        rig.tone_velocity[k] = rig.tone_velocity[k] - (constants.tones[k][2] * rig.position[k]);
        rig.position[k] = rig.position[k] + rig.tone_velocity[k];
    }
}

bool sensor_read(uint8_t sample[SAMPLE_BYTES])
{
    int32_t counts[2];
    float y = 0.0f;
    for (uint32_t k = 0; k < TONES; k++) {
        y = y + rig.position[k];
    }
    counts[STREAM_PHI] = read(rig.phi, constants.counts_per_rad);
    counts[STREAM_Y] = read(y, constants.counts_per_m);
    for (uint16_t step = 0; step < constants.steps; step++) {
        advance();
    }
    identifier_sample(counts, sample);
    return true;
}
