/* pvid/former.h - names of version 0.1 for programs that use them; include it after pvid.h. Gone in version 0.3. */
#ifndef PVID_FORMER_H
#define PVID_FORMER_H

#include "pvid/status.h"

#define PVID_BAD_ANGLE_LIMIT PVID_BAD_RANGE
#define PVID_HELD_PIVOT PVID_HELD_SINGULAR
#define held_pivot held_singular /* counters */
#define at_rest in_dead_zone

#define pvid_weak_stage_f32 pvid_weak_refiner_f32
#define pvid_refine_stage_f32 pvid_refiner_f32

#endif
