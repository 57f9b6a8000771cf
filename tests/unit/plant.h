/* The standard rig, simulated: what the weak form's tests identify. */
#ifndef PLANT_H
#define PLANT_H

#include <math.h>

#define PLANT_RATE 1000.0 /* samples a second */

/* Two-link pendulum on a pivot shaken by three tones, equations (1) of theory.md, fourth-order
 * Runge-Kutta in double: samples phi and y. */
typedef struct {
    double t;
    double state[4]; /* phi1, phi, and their rates */
} plant_state;

static const double plant_p[3] = {31.666666666666668, 8.875, 5.625};
static const double plant_l1 = 0.3;

static double plant_tone(double t, int derivative)
{
    static const double amplitude[3] = {6e-3, 5e-3, 4e-3}, hertz[3] = {1.1, 2.3, 4.1}, phase[3] = {0.3, 1.7, 4.0};
    double sum = 0.0;
    for (int i = 0; i < 3; i++) {
        const double omega = 2.0 * 3.14159265358979323846 * hertz[i];
        const double one = amplitude[i] * sin((omega * t) + phase[i]);
        sum += (derivative == 0) ? one : (-omega * omega * one);
    }
    return sum;
}

static void plant_rate(double t, const double x[4], double dx[4])
{
    const double l2 = plant_p[1] - plant_p[2] - 1.0; /* L2 */
    const double g = plant_p[0] + (plant_tone(t, 2) / plant_l1);
    dx[0] = x[2];
    dx[1] = x[3];
    dx[2] = (-g * x[0]) + (l2 * g * x[1]);
    dx[3] = (g * x[0]) - ((plant_p[1] - 1.0) * g * x[1]);
}

static inline void plant_step(plant_state *plant, double *phi, double *y)
{
    const double h = 1.0 / PLANT_RATE;
    double k[4][4];
    double x[4];
    *phi = plant->state[1];
    *y = plant_tone(plant->t, 0);
    plant_rate(plant->t, plant->state, k[0]);
    for (int stage = 1; stage < 4; stage++) {
        const double part = (stage == 3) ? h : (h / 2.0);
        for (int i = 0; i < 4; i++) {
            x[i] = plant->state[i] + (part * k[stage - 1][i]);
        }
        plant_rate(plant->t + part, x, k[stage]);
    }
    for (int i = 0; i < 4; i++) {
        plant->state[i] += (h / 6.0) * (k[0][i] + (2.0 * k[1][i]) + (2.0 * k[2][i]) + k[3][i]);
    }
    plant->t += h;
}

static inline plant_state released_plant(void)
{
    const plant_state plant = {0.0, {0.06, 0.08, 0.0, 0.0}};
    return plant;
}

#endif
