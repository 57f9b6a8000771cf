/* A simulated motor in place of sensors, bridge and timer, for firmware/examples/commission.c. */
#ifndef RIG_H
#define RIG_H

#ifdef __cplusplus
extern "C" {
#endif

#ifndef RIG_BANDWIDTH
#define RIG_BANDWIDTH 500.0f /* of the current controller [rad/s] */
#endif

void rig_tick(void); /* the program's */

void rig_read(float sample[3]);
void rig_apply(float voltage);
void rig_start(void);               /* the timer */
void rig_wait(void);                /* for its next tick, once the commissioning has nothing to do */
void rig_stop(void);                /* until the motor stands */
void rig_reference(float speed[3]); /* [rad/s], [rad/s^2], [rad/s^3] */
float rig_follow(void);             /* two seconds of the reference; rms error of the true speed [rad/s] */
float rig_largest(int signal);      /* |V|, |i|, |w| so far */

#ifdef __cplusplus
}
#endif

#endif
