/* The remainder of a window's linear rows: sines and cosines of large angles, friction (theory.md 5, (12)). Private to
 * the core.
 *
 * If q = phi''/G is known over the window, the motion is known: phi1 = q + (d1 - 1) (phi - c). The exact equations are
 *
 *   phi'' = G q + (d1 - 1) (e2 - e1) - e1,   q'' = -d1 phi'' - d2 G (phi - c) + d2 (e2 - e1)
 *   e1 = G (a1 - sin a1) + ((1 - cos phi) a2'' + sin phi a2'^2) / L1 - c1 a1' / l1^2 + c2 phi' / l1^2
 *   e2 = G (a2 - sin a2) + (1 - cos phi) a1'' - sin phi a1'^2 - c2 L1 phi' / l1^2
 *
 * with the absolute angles a1 = phi1 and a2 = phi1 + phi, and the friction c1, c2 of the joints over the mass of body 2
 * [m^2/s]. In the weak form they add the remainder int chi'' (m1 + G I2(m2)) to Y, with m1 = (d1 - 1) (e2 - e1) - e1
 * and m2 = d2 (e2 - e1). The terms of e without c1 and c2 are subtracted from Y; those of c1 and c2 become two more
 * columns. q follows from a fit of the window's a and b. The remainder changes this fit: therefore several passes.
 * Error of w: 0.02 % at 0.13 rad, 0.3 % at 0.16 rad. */
#ifndef PVID_WEAK_ANGLE_F32_H
#define PVID_WEAK_ANGLE_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/weak.h"

/* True if the correction is compiled in and configured. */
static inline bool pvid_angle_correction_enabled_f32(const pvid_weak_angle_f32 *self)
{
    return (PVID_FULL_ANGLE == 1) && (self != NULL);
}

/* No samples, correction off. Passes 1..PVID_MAX_PASSES. */
void pvid_weak_angle_init_f32(pvid_weak_angle_f32 *self, const pvid_weak_config_f32 *config);

/* Stores a decimated sample. */
void pvid_weak_angle_add_sample_f32(pvid_weak_angle_f32 *self, float phi, float u);

/* Begins the window that the last sample completed, at p. */
void pvid_weak_angle_begin_f32(pvid_weak_angle_f32 *self, const float p[]);

/* One stage; `columns` are those of the window's rows before whitening. The last stage subtracts the remainder from Y
 * and fills the two columns of friction. If the correction is off or p is not physical, Y is unchanged and these
 * columns are 0. Returns whether this was the last stage. Cost of a stage: 4 samples of about 80 operations, and one or
 * three operations per function. */
bool pvid_weak_angle_step_f32(pvid_weak_angle_f32 *self, const pvid_weak_design_f32 *design, const float theta[],
                              float columns[][PVID_WEAK_TERMS]);

/* Number of stages. */
uint32_t pvid_weak_angle_stages_f32(const pvid_weak_angle_f32 *self, const pvid_weak_design_f32 *design);

/* Enables the correction once the estimate has converged; disables it if the standard errors become large. p: after the
 * window's steps; worst: largest relative standard error; groups: windows used. (A correction at the first window would
 * diverge.) Returns true if this call enabled it: the sums, which lack the correction, must be renewed then. */
bool pvid_weak_angle_switch_f32(pvid_weak_angle_f32 *self, const float p[], float worst, uint16_t groups);

#endif
