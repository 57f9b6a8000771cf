/* The other baseline of the side-by-side table: an extended Kalman filter of 7 states, float32.
 *
 *   x = (phi, phi', q, q', w, d1, d2),  phi'' = G q,  q'' = -d1 G q - d2 G phi,  G = w + u
 *
 * the measured angle at every sample. u = y''/l1 comes from a folded smoother of 71 taps, as the weak form's does, but
 * at every sample; the angle waits in a ring for the same instant. The same filter in float64 is
 * bench.references.kalman, which says how it is tuned.
 *
 *   ekf_init_f32(&filter, &config);
 *   ekf_sample_f32(&filter, phi, y);      every tick, in s, rad, m
 */
#ifndef EKF_F32_H
#define EKF_F32_H

#include <stdbool.h>
#include <stdint.h>

#define EKF_N 7
#define EKF_MOTION 4 /* states that move; the others are constants */
#define EKF_HALF 35  /* taps on each side */
#define EKF_TAPS (2 * EKF_HALF + 1)

typedef struct {
    float dt;             /* between samples [s] */
    float angle_variance; /* of a sample's noise [rad^2] */
    float rate_noise;     /* variance that a sample adds to phi' [rad^2/s^2]; to q', over w^2 */
    float start[3];       /* w [1/s^2], d1, d2 */
    float start_sd[3];
    float second[EKF_HALF]; /* weights of (y[i] - y[0]) + (y[-i] - y[0]), i = 1..: u = y''/l1 [1/s^2] */
} ekf_config_f32;

typedef struct {
    ekf_config_f32 config;
    float x[EKF_N];
    float p[EKF_N][EKF_N]; /* covariance, both triangles */
    float u;               /* at the last filtered sample */
    bool started;
    uint16_t head, filled; /* place of the oldest sample; samples so far, at most EKF_TAPS */
    float angles[EKF_TAPS], heights[EKF_TAPS];
} ekf_f32;

void ekf_init_f32(ekf_f32 *self, const ekf_config_f32 *config);

/* One sample in; the state then belongs to the sample EKF_HALF before it. Returns whether a window was full. */
bool ekf_sample_f32(ekf_f32 *self, float phi, float y);

#endif
