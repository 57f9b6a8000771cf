/* rig.h: a motor, by the midpoint rule in RIG_SUBSTEPS a tick, with dry friction that sticks; a converter of 12 bits
 * with an offset and noise, an encoder of 4096 counts. Its numbers are macros. */
#include "rig.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#ifndef RIG_RATE
#define RIG_RATE 2000.0f
#endif
#ifndef RIG_SUBSTEPS
#define RIG_SUBSTEPS 20
#endif
#ifndef RIG_R
#define RIG_R 0.62f
#define RIG_L 9.0e-4f
#define RIG_K 0.042f
#define RIG_J 6.5e-5f
#define RIG_B 2.2e-5f
#define RIG_TC 0.014f
#define RIG_I0 0.12f
#define RIG_CURRENT (40.0f / 4096.0f)
#endif
#ifndef RIG_DELAY
#define RIG_DELAY 0.0f /* of the bridge [ticks], 0..1 */
#endif
#ifndef RIG_LOAD
#define RIG_LOAD 0.0f /* [N m], constant */
#endif
#ifndef RIG_FAN
#define RIG_FAN 0.0f /* [N m s^2] */
#endif
#ifndef RIG_DEAD
#define RIG_DEAD 0.0f /* voltage drop of the sign of the current [V] */
#endif
#ifndef RIG_AMPLITUDE
#define RIG_AMPLITUDE 150.0f /* of the reference [rad/s] */
#endif

#define TURN 6.2831853f
#define ANGLE (TURN / 4096.0f)

static struct {
    float i;
    float w;
    float angle; /* within a turn */
    int32_t turns;
    float before; /* voltage of the tick before */
    uint32_t random;
    float sine; /* of the reference */
    float cosine;
    float largest[3]; /* |V|, |i|, |w| so far */
} rig;

static float half_sum(float x, float rate, float step)
{
    return x + (0.5f * step * rate);
}

static float friction_of(float w, float torque, bool *sticks)
{
    const float tc = RIG_TC;
    *sticks = (w < 1.0e-6f) && (w > -1.0e-6f) && (torque < tc) && (torque > -tc);
    if (*sticks) {
        return torque;
    }
    const float sign = (w > 0.0f) ? 1.0f : (w < 0.0f) ? -1.0f : (torque > 0.0f) ? 1.0f : -1.0f;
    return tc * sign;
}

static void step(float voltage, float h)
{
    bool sticks;
    const float drop = (rig.i > 0.0f) ? RIG_DEAD : -RIG_DEAD;
    const float fan = RIG_FAN * rig.w * ((rig.w < 0.0f) ? -rig.w : rig.w);
    float torque = (RIG_K * rig.i) - (RIG_B * rig.w) - fan - RIG_LOAD;
    const float dw = (torque - friction_of(rig.w, torque, &sticks)) / RIG_J;
    const float di = (voltage - drop - (RIG_R * rig.i) - (RIG_K * rig.w)) / RIG_L;
    const float i = half_sum(rig.i, di, h);
    const float w = half_sum(rig.w, dw, h);
    torque = (RIG_K * i) - (RIG_B * w) - fan - RIG_LOAD;
    const float w_next = rig.w + (h * (torque - friction_of(rig.w, torque, &sticks)) / RIG_J);
    rig.i += h * (voltage - drop - (RIG_R * i) - (RIG_K * w)) / RIG_L;
    rig.angle += h * w;
    rig.w = ((w_next * rig.w) < 0.0f) ? 0.0f : w_next;
    if (rig.angle >= TURN) {
        rig.angle -= TURN;
        rig.turns++;
    } else if (rig.angle < 0.0f) {
        rig.angle += TURN;
        rig.turns--;
    }
}

static float noise(void) /* -1..1 */
{
    rig.random = (rig.random * 1664525u) + 1013904223u;
    return ((float)(rig.random >> 8) * (2.0f / 16777216.0f)) - 1.0f;
}

static float counts_of(float x)
{
    const float magic = 12582912.0f;
    return (x + magic) - magic;
}

void rig_read(float sample[3])
{
    sample[0] = 0.0f; /* the commissioning's own */
    sample[1] = RIG_CURRENT * counts_of(((rig.i + RIG_I0) / RIG_CURRENT) + (0.5f * noise()));
    sample[2] = ANGLE * ((4096.0f * (float)rig.turns) + counts_of(rig.angle / ANGLE));
}

/* One turn a second. */
static void advance_reference(void)
{
    const float a = TURN / RIG_RATE;
    const float next = (rig.sine * (1.0f - (0.5f * a * a))) + (rig.cosine * a);
    rig.cosine = (rig.cosine * (1.0f - (0.5f * a * a))) - (rig.sine * a);
    rig.sine = next;
    const float size = 1.5f - (0.5f * ((rig.sine * rig.sine) + (rig.cosine * rig.cosine)));
    rig.sine *= size;
    rig.cosine *= size;
}

static void keep_largest(int signal, float x)
{
    const float size = (x < 0.0f) ? -x : x;
    rig.largest[signal] = (size > rig.largest[signal]) ? size : rig.largest[signal];
}

void rig_apply(float voltage)
{
    const float h = 1.0f / (RIG_RATE * (float)RIG_SUBSTEPS);
    const int late = (int)(RIG_DELAY * (float)RIG_SUBSTEPS);
    for (int k = 0; k < RIG_SUBSTEPS; k++) {
        step((k < late) ? rig.before : voltage, h);
    }
    rig.before = voltage;
    keep_largest(0, voltage);
    keep_largest(1, rig.i);
    keep_largest(2, rig.w);
    advance_reference();
}

void rig_start(void)
{
}

/* The timer: the interrupt itself. */
void rig_wait(void)
{
    rig_tick();
}

void rig_stop(void)
{
    rig.i = 0.0f;
    rig.w = 0.0f;
    rig.sine = 0.0f;
    rig.cosine = 1.0f;
}

void rig_reference(float speed[3])
{
    speed[0] = RIG_AMPLITUDE * rig.sine;
    speed[1] = RIG_AMPLITUDE * TURN * rig.cosine;
    speed[2] = -RIG_AMPLITUDE * TURN * TURN * rig.sine;
}

float rig_follow(void)
{
    const uint32_t ticks = (uint32_t)(2.0f * RIG_RATE);
    float sum = 0.0f;
    for (uint32_t k = 0u; k < ticks; k++) {
        const float error = rig.w - (RIG_AMPLITUDE * rig.sine);
        sum += error * error;
        rig_tick();
    }
    return sqrtf(sum / (float)ticks);
}

float rig_largest(int signal)
{
    return rig.largest[signal];
}
