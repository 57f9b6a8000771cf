/* What the noise of the sensors alone adds to the information of a window. Private to the core. */
#ifndef PVID_WEAK_NOISE_F32_H
#define PVID_WEAK_NOISE_F32_H

#include <stddef.h>

#include "pvid/weak.h"

/* Q_j of a kind's rows, at most. */
void pvid_weak_noise_shares_f32(const pvid_weak_white_f32 *white, const pvid_weak_design_f32 *design,
                                float share[PVID_MAX_POWER]);

/* The first entry of the noise table from `place` on that is of this kind and of two regressors; behind the table:
 * none.
 */
size_t pvid_weak_noise_next_f32(const pvid_weak_design_f32 *design, uint8_t kind, size_t place);

/* Lists the non-zeros from..to-1 of C by rows of the kind, whose `thetas` rows begin at `first`; from 0 on in order. */
void pvid_weak_noise_list_f32(const pvid_weak_design_f32 *design, size_t first, size_t thetas, size_t from, size_t to,
                              pvid_weak_slopes_f32 *slopes);

/* Adds what this entry and those behind it of the same two columns add to C^T M C for each unit of the rows' weight: to
 * the upper triangle of s. rows: weight of a window. Returns the place behind them. */
size_t pvid_weak_noise_add_f32(const pvid_weak_design_f32 *design, size_t place, const float share[], float rows,
                               const pvid_weak_slopes_f32 *slopes, float s[][PVID_MAX_P]);

/* How often that is to be called for a kind. */
size_t pvid_weak_noise_pairs_f32(const pvid_weak_design_f32 *design, uint8_t kind);

#endif
