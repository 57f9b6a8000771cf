/* Commissions a motor and then moves it: excites it within its limits, takes R, L, k, J, b and Tc, and follows a speed
 * with gains that are made of them. rig.h is yours: two sensors, a bridge, a timer. */
#include <stdio.h>

#include "dc_motor_commission.h"
#include "rig.h"

/* ---- gains from parameters ---- */

typedef struct {
    float kp; /* [V/A] current controller: its zero cancels the pole R/L of the winding, */
    float ki; /* [V/A a tick] so that the loop is one of first order with this bandwidth */
    float p[DC_MOTOR_PARAMETERS];
} motor_gains;

static motor_gains gains_of(const float p[DC_MOTOR_PARAMETERS], float bandwidth, float period_s)
{
    motor_gains gains;
    gains.kp = p[DC_MOTOR_L] * bandwidth;
    gains.ki = p[DC_MOTOR_R] * bandwidth * period_s;
    for (int k = 0; k < DC_MOTOR_PARAMETERS; k++) {
        gains.p[k] = p[k];
    }
    return gains;
}

/* Voltage for a speed [rad/s], its first and second derivative: by the equations of the motor, and the current
 * controller on what they leave. */
static float voltage(const motor_gains *g, const float w[3], float current, float *integral)
{
    const float *p = g->p;
    const float friction = (w[0] > 0.0f) ? p[DC_MOTOR_TC] : -p[DC_MOTOR_TC];
    const float wanted = ((p[DC_MOTOR_J] * w[1]) + (p[DC_MOTOR_B] * w[0]) + friction) / p[DC_MOTOR_K];
    const float slope = ((p[DC_MOTOR_J] * w[2]) + (p[DC_MOTOR_B] * w[1])) / p[DC_MOTOR_K];
    const float error = wanted - (current - p[DC_MOTOR_I0]);
    *integral += g->ki * error;
    return (p[DC_MOTOR_K] * w[0]) + (p[DC_MOTOR_R] * wanted) + (p[DC_MOTOR_L] * slope) + (g->kp * error) + *integral;
}

/* ---- the tick, a timer interrupt ---- */

static motor_gains gains;
static float integral;
static volatile bool follows; /* after the commissioning */

void rig_tick(void)
{
    float sample[DC_MOTOR_SAMPLES]; /* V, i, phi */
    float drive[DC_MOTOR_DRIVES];
    rig_read(sample);
    if (follows) {
        float speed[3];
        rig_reference(speed);
        drive[0] = voltage(&gains, speed, sample[1], &integral);
    } else {
        (void)dc_motor_commission_step(sample, drive);
    }
    rig_apply(drive[0]);
}

/* ---- the main loop ---- */

static long thousandths(float x)
{
    return (long)((x * 1000.0f) + ((x < 0.0f) ? -0.5f : 0.5f));
}

static void follow(const char *what, const float p[DC_MOTOR_PARAMETERS])
{
    gains = gains_of(p, RIG_BANDWIDTH, 1.0e-6f * (float)DC_MOTOR_PERIOD_US);
    integral = 0.0f;
    rig_stop();
    follows = true;
    const long rms = thousandths(rig_follow());
    follows = false;
    printf("%s: rms speed error %ld.%03ld rad/s\n", what, rms / 1000, rms % 1000);
}

int main(void)
{
    const pvid_commission_result_f32 *result = dc_motor_commission_result();
    if ((dc_motor_commission_init() != PVID_OK) || !dc_motor_commission_start()) {
        return 1;
    }
    rig_start();
    while (result->verdict == PVID_COMMISSION_PENDING) {
        if (!dc_motor_commission_work()) {
            rig_wait();
        }
    }
    printf("verdict %d, bursts differ by %ld thousandths of their errors, misfits %ld and %ld thousandths\n",
           (int)result->verdict, thousandths(result->difference), thousandths(result->misfit[0]),
           thousandths(result->misfit[1]));
    for (int k = 0; k < DC_MOTOR_PARAMETERS; k++) {
        printf("%s %ld +- %ld\n", dc_motor_parameter[k], (long)(result->value[k] * 1.0e9f),
               (long)(result->error[k] * 1.0e9f));
    }
    if (result->verdict != PVID_COMMISSION_DONE) {
        return 1;
    }
    float guess[DC_MOTOR_PARAMETERS];
    for (int k = 0; k < DC_MOTOR_PARAMETERS; k++) {
        guess[k] = ((k % 2) == 0) ? 1.3f * result->value[k] : result->value[k] / 1.3f;
    }
    follow("30 % off", guess);
    follow("commissioned", result->value);
    return 0;
}
