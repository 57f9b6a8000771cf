/* What `pvid bench longevity` needs besides the core: the motion of a rig that changes under way, and the peers.
 * Host only. */
#ifndef LONGEVITY_H
#define LONGEVITY_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/pvid.h"
#include "rls_f32.h"
#include "ud_f32.h"

/* Moves the pendulum of theory.md (1), or of its full equations, on by `ticks` steps of fourth-order Runge-Kutta and
 * writes phi at the start of each.  x: phi1, phi and their rates;  p: d1, d2;  w[ticks];  u[2 ticks + 1]: at the ends
 * and the middles of steps. */
void longevity_motion(bool full, double x[4], uint32_t ticks, double step, const double p[2], const double w[],
                      const double u[], double phi[]);

/* A recursive estimator of all eleven parameters, behind the strong form's differentiators and rows. */
typedef struct {
    pvid_differentiator_f32 phi;
    pvid_differentiator_f32 y;
    float inverse_l1;
    float scale[PVID_KAPITZA_STRONG_THETA]; /* of theta, so that what is estimated is near 1 */
    float y_scale;
    bool factored; /* ud, else rls */
    rls_f32 rls;
    ud_f32 ud;
} longevity_peer;

extern const uint32_t longevity_peer_bytes;

/* theta: typical parameters; y_scale: a typical Y. */
bool longevity_peer_init(longevity_peer *self, bool factored, float lambda, const pvid_fir_bank_f32 *bank,
                         float sample_rate_hz, float l1, const float theta[], float y_scale);

/* Steps through samples; those that are no number are left out, and start the windows again. Returns the ticks done
 * before an estimate was no number: `ticks` if none was. */
uint32_t longevity_peer_run(longevity_peer *self, uint32_t ticks, const float phi[], const float y[]);

/* Its estimate of w. */
float longevity_peer_w(const longevity_peer *self);

#endif
