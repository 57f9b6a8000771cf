/* pvid/information.h - the sums M, B, yy of least squares, kept so that they neither stall nor drift.
 *
 *   M = sum N N^T (distinct entries only),  B = sum N Y,  yy = sum Y^2,  weight = sum 1     (theory.md 4)
 *
 * A plain float32 sum stops growing after 2^24 equal terms. Here each sum has two levels: terms go
 * into `low`, and after `block` groups of rows `low` is folded into `high`; what the fold cannot
 * represent stays in `low` (an exact two-sum), so nothing is lost. Forgetting multiplies both levels
 * once a block. The value of a sum is high + low.
 */
#ifndef PVID_INFORMATION_H
#define PVID_INFORMATION_H

#include <stdint.h>

#include "pvid/config.h"
#include "pvid/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Layout of the sums: n_moments of M, n_theta of B, yy, weight. */
#define PVID_MAX_SUMS (PVID_MAX_MOMENTS + PVID_MAX_THETA + 2)

/* The root of a row's sum of squares may not exceed this: 2^32 such rows still fit into float32. */
#define PVID_ROW_LIMIT 1.0e14f

/* State: detail/information_state.h. Only the functions below write to it. */
typedef struct pvid_information_f32 pvid_information_f32;

/* Empty sums for `model`; forgetting_groups is the time constant of forgetting in groups of rows,
 * 0 for none (else at least 4). */
void pvid_information_init_f32(pvid_information_f32 *self, const pvid_model_f32 *model, float forgetting_groups);

/* Adds one row and writes the values of the sums with it, as pvid_information_read_f32 would: the
 * row must be within PVID_ROW_LIMIT. sums may be NULL where the model does not accumulate by itself.
 * Cost: a product and two additions a sum. */
void pvid_information_add_f32(pvid_information_f32 *self, const pvid_model_f32 *model, const float n[], float y,
                              float sums[PVID_MAX_SUMS]);

/* Ends a group of rows (one tick of the strong form, one window of the weak form): folds and
 * forgets when a block is complete. */
void pvid_information_end_group_f32(pvid_information_f32 *self);

/* Multiplies all that was gathered by factor, 0..1. */
void pvid_information_fade_f32(pvid_information_f32 *self, float factor);

/* sums[0 .. n_moments + n_theta + 1] = the current values, in the layout above. */
void pvid_information_read_f32(const pvid_information_f32 *self, float sums[PVID_MAX_SUMS]);

/* tail[0] = yy, tail[1] = weight. */
void pvid_information_tail_f32(const pvid_information_f32 *self, float tail[2]);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/information_state.h"

#endif
