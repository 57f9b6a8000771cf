/* The solve at every tick of the strong form. Private to the core. */
#ifndef PVID_KAPITZA_SOLVE_F32_H
#define PVID_KAPITZA_SOLVE_F32_H

#include "pvid/kapitza.h"

/* Adds an accepted row to the sums and takes one step of p. */
pvid_reason pvid_kapitza_solve_f32(pvid_estimator_f32 *self, const float n[], float y);

/* The same with a dead zone: a function of its own, whose sums need stack. */
pvid_reason pvid_kapitza_solve_in_zone_f32(pvid_estimator_f32 *self, const float n[], float y);

#endif
