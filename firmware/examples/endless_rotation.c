/* A motor that turns one way for two minutes, with the raw 16-bit counter of its encoder: dc_motor_counted_phi joins
 * what the counter takes apart, and the angle that the core gets stays small. Here a motor is simulated. */
#include <math.h>
#include <stdio.h>

#include "dc_motor_identifier.h"

#define COUNT (6.2831853 / 4096.0) /* [rad] */

static double phi;   /* [rad] */
static double w;     /* [rad/s] */
static double i_now; /* [A] */

/* Your board: the converter, and the register of the timer that counts the encoder. */
static float current(void)
{
    return (float)(floor(((i_now + 0.03) * 409.6) + 0.5) / 409.6);
}

static uint16_t counter(void)
{
    return (uint16_t)(int32_t)fmod(floor((phi / COUNT) + 0.5), 65536.0);
}

/* A period of a motor at this voltage: R = 1.2 ohm, L = 3 mH, k = 0.05, J = 2e-4, b = 1e-4, Tc = 0.012. */
static void turn(double volts)
{
    for (int part = 0; part < 100; part++) {
        const double h = 1.0e-5;
        const double i_mid = i_now + ((0.5 * h) * (volts - (1.2 * i_now) - (0.05 * w)) / 3.0e-3);
        const double w_mid = w + ((0.5 * h) * ((0.05 * i_now) - (1.0e-4 * w) - 0.012) / 2.0e-4);
        i_now += h * (volts - (1.2 * i_mid) - (0.05 * w_mid)) / 3.0e-3;
        w += h * ((0.05 * i_mid) - (1.0e-4 * w_mid) - 0.012) / 2.0e-4;
        phi += h * w_mid;
    }
}

int main(void)
{
    dc_motor_estimate result;
    if (dc_motor_begin() != PVID_OK) {
        return 1;
    }
    for (uint32_t tick = 0; tick < 120000u; tick++) {
        const double t = 0.001 * (double)tick;
        const double volts = 8.0 + (2.0 * sin(5.7 * t)) + sin(19.5 * t) + (0.5 * sin(61.0 * t));
        const float sample[DC_MOTOR_SAMPLES] = {(float)volts, current(), dc_motor_counted_phi(counter(), 65536u)};
        (void)dc_motor_step(sample);
        turn(volts);
    }
    if (!dc_motor_result(&result)) {
        return 1;
    }
    printf("%.0f turns, standing %d: %s = %.4f\n", phi / 6.2831853, (int)result.standing.state, dc_motor_parameter[0],
           (double)result.value[0]);
    return (result.standing.state == PVID_STANDING_VALID) ? 0 : 1;
}
