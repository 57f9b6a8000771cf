/* The strong form's `step` of model.h. Private to the core. */
#ifndef PVID_KAPITZA_STEP_F32_H
#define PVID_KAPITZA_STEP_F32_H

#include "pvid/kapitza.h"

pvid_reason pvid_kapitza_step_f32(pvid_estimator_f32 *self, const float n[], float y, float e, const float gradient[]);

#endif
