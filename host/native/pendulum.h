/* The two-link pendulum of bench.campaign: full equations of motion with the imperfections of a real rig. */
#ifndef PVID_PENDULUM_H
#define PVID_PENDULUM_H

#include <stddef.h>
#include <stdint.h>

/* Torques are per unit of body 2's mass; indices 1 and 2 stand for the pivot and the joint. */
typedef struct {
    double l1, l2, rho2; /* [m] */
    double g;            /* gravity in the plane of motion [m/s^2] */
    double viscous[2];   /* torque per rate [m^2/s] */
    double dry[2];       /* torque of dry friction [m^2/s^2] */
    double slip;         /* dry friction is dry tanh(rate/slip) [rad/s], > 0 */
    double slant;        /* angle of the pivot's slide to the vertical [rad] */
} pvid_pendulum;

/* Runge-Kutta of order 4 from state x = phi1, phi1 + phi [rad] and their rates [rad/s].
 *
 * acceleration: of the pivot along its slide at every half step, [2 steps + 1], [m/s^2]. out: [steps + 1][4], the
 * state after every step and before the first. Ends early iff an angle exceeds `limit` [rad] or is not finite; returns
 * the number of states written. */
uint32_t pvid_pendulum_run(const pvid_pendulum *self, const double x[4], const double acceleration[], uint32_t steps,
                           double step_s, double limit, double out[]);

#endif
