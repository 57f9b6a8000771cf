/* pvid/kapitza_parameters.h - indices and numbers of the pendulum's parameters, for both cores. Meaning:
 * kapitza.h, kapitza_weak.h. */
#ifndef PVID_KAPITZA_PARAMETERS_H
#define PVID_KAPITZA_PARAMETERS_H

#include "pvid/config.h"

/* ---- the strong form ---- */

#define PVID_KAPITZA_P 3
#define PVID_KAPITZA_STRONG_THETA 11

enum { PVID_KAPITZA_W = 0, PVID_KAPITZA_D1 = 1, PVID_KAPITZA_D2 = 2 };

/* ---- the weak form ---- */

#define PVID_KAPITZA_WEAK_THETA 8
#define PVID_KAPITZA_WEAK_P 4
#define PVID_KAPITZA_ZEROED_THETA 5
#define PVID_KAPITZA_FRICTION_THETA 10
#define PVID_KAPITZA_FRICTION_P 6

/* Indices in p after PVID_KAPITZA_D2: the encoder's offset, friction at the pivot and at the joint [m^2/s]. */
enum { PVID_KAPITZA_C = 3, PVID_KAPITZA_C1 = 4, PVID_KAPITZA_C2 = 5 };

/* Whether the bounds of pvid/config.h have room for friction. */
#define PVID_KAPITZA_HAS_FRICTION ((PVID_MAX_P >= 6) && (PVID_MAX_MOMENTS >= 55))

#endif
