/* pvid/information.h - the sums M, B, yy of least squares, exact enough for any length of a run.
 *
 *   M = sum N N^T (distinct entries only),  B = sum N Y,  yy = sum Y^2,  weight = sum 1     (theory.md 4)
 *
 * A plain float32 sum stops growing after 2^24 equal terms. Here each sum has two levels: terms are added to
 * `low`, and every `block` groups `low` is folded into `high`; the part that `high` cannot represent remains in
 * `low` (exact two-sum). Forgetting multiplies both levels once per block. The value of a sum is high + low.
 */
#ifndef PVID_INFORMATION_H
#define PVID_INFORMATION_H

#include <stdint.h>

#include "pvid/config.h"
#include "pvid/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Layout of the sums: n_moments of M, block by block (model.h), n_theta of B, yy, weight. In an estimator b and rr take
 * the places of B and yy (estimator.h). */
#define PVID_MAX_SUMS (PVID_MAX_MOMENTS + PVID_MAX_THETA + 2)

/* Limit of the root of a row's sum of squares: 2^32 such rows fit into float32. */
#define PVID_ROW_LIMIT 1.0e14f

/* State: detail/information_state.h, not API. Only the functions below write to it. */
typedef struct pvid_information_f32 pvid_information_f32;

/* Zeroes the sums for `model`. forgetting_groups: time constant of forgetting [groups of rows], >= 4; 0: no
 * forgetting. */
void pvid_information_init_f32(pvid_information_f32 *self, const pvid_model_f32 *model, float forgetting_groups);

/* Adds a row within PVID_ROW_LIMIT and writes the new values of the sums, as pvid_information_read_f32 does. sums
 * may be NULL. A model of several kinds takes it as a row of kind 0. Cost: one product and two additions per sum. */
void pvid_information_add_f32(pvid_information_f32 *self, const pvid_model_f32 *model, const float n[], float y,
                              float sums[PVID_MAX_SUMS]);

/* Ends a group of rows (one tick of the strong form, one window of the weak form); folds and forgets at the end of
 * a block. */
void pvid_information_end_group_f32(pvid_information_f32 *self);

/* Multiplies all sums by factor, 0..1. */
void pvid_information_fade_f32(pvid_information_f32 *self, float factor);

/* Writes the values sums[0 .. n_moments + n_theta + 1] in the layout above. */
void pvid_information_read_f32(const pvid_information_f32 *self, float sums[PVID_MAX_SUMS]);

/* Writes tail[0] = yy, tail[1] = weight. */
void pvid_information_tail_f32(const pvid_information_f32 *self, float tail[2]);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/information_state.h"

#endif
