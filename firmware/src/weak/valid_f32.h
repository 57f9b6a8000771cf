/* Whether a model and a design may be used: every index, count and number. Private to the core. */
#ifndef PVID_WEAK_VALID_F32_H
#define PVID_WEAK_VALID_F32_H

#include "pvid/weak.h"

/* The status names what is out of range. Reads nothing beyond the tables' lengths. */
pvid_status pvid_weak_valid_f32(const pvid_weak_design_f32 *design);

#endif
