/* What the noise of the sensors alone adds to the information of a window. Private to the core. */
#ifndef PVID_FOURIER_NOISE_F32_H
#define PVID_FOURIER_NOISE_F32_H

#include <stddef.h>

#include "pvid/fourier.h"

/* Entries of the noise table that are added at a time. */
#define PVID_FOURIER_NOISE_ENTRIES 1u

/* Q_j of a kind's rows, at most. */
void pvid_fourier_noise_shares_f32(const pvid_fourier_white_f32 *white, const pvid_fourier_design_f32 *design,
                                   float share[PVID_MAX_POWER]);

/* Adds what entry `one` of the noise table, whose kind begins with theta `first`, adds to C^T M C at p for each unit of
 * the rows' weight: to the upper triangle of s. rows: weight of a window. */
void pvid_fourier_noise_add_f32(const pvid_fourier_design_f32 *design, const pvid_fourier_noise_f32 *one, size_t first,
                                const float share[PVID_MAX_POWER], float rows, const float c[], float s[][PVID_MAX_P]);

#endif
