/* Whether a model and a design may be used: every index, count and number. Private to the core. */
#ifndef PVID_FOURIER_VALID_F32_H
#define PVID_FOURIER_VALID_F32_H

#include "pvid/fourier.h"

/* The status names what is out of range. Reads nothing beyond the tables' lengths. */
pvid_status pvid_fourier_valid_f32(const pvid_fourier_design_f32 *design);

#endif
