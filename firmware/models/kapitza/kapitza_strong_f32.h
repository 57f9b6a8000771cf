/* The strong form's `take_row` of model.h. Private to the core. */
#ifndef PVID_KAPITZA_STRONG_F32_H
#define PVID_KAPITZA_STRONG_F32_H

#include "pvid/kapitza.h"

pvid_reason pvid_kapitza_take_row_f32(pvid_estimator_f32 *self, const float n[], float y, float e,
                                      const float gradient[], bool ends_group);

#endif
