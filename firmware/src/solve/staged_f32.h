/* The engine that solves in stages; pvid/estimator.h declares the stages. Private to the core. */
#ifndef PVID_STAGED_F32_H
#define PVID_STAGED_F32_H

#include "solve/state_f32.h"

/* pvid_estimator_add_f32 for b = B - M theta and rr. */
pvid_reason pvid_staged_add_f32(pvid_estimator_f32 *self, const float n[], float y);

#endif
