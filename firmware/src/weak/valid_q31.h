/* Whether a model and a design may be used: every index, count, shift and factor. Private to the core. */
#ifndef PVID_WEAK_VALID_Q31_H
#define PVID_WEAK_VALID_Q31_H

#include "pvid/weak_q31.h"

/* The status names what is out of range. Reads nothing beyond the tables' lengths. No table that it accepts makes a
 * number overflow: what the tables do not bound is clamped (channels, integrals, S_h) or refused (jets). */
pvid_status pvid_weak_valid_q31(const pvid_weak_design_q31 *design);

#endif
