/* The 58 sums of the strong form (theory.md 2): added to in blocks of four rows and folded into the second level.
 * Private to the core. */
#ifndef PVID_KAPITZA_SUMS_F32_H
#define PVID_KAPITZA_SUMS_F32_H

#include <stddef.h>

#include "pvid/detail/strong_state.h"

/* Adds PVID_STRONG_ROWS rows: those of a block and the last one. Cost: 10 operations a sum. */
void pvid_kapitza_add_rows_f32(const pvid_strong_row_f32 block[restrict], const pvid_strong_row_f32 *restrict last,
                               float low[restrict]);

/* Folds the sums first..end-1 into the second level, after forgetting (information.h). */
void pvid_kapitza_fold_f32(pvid_strong_sums_f32 *self, size_t first, size_t end);

/* The values high + low of all sums. */
void pvid_kapitza_read_f32(const pvid_strong_sums_f32 *self, float sums[PVID_STRONG_SUMS]);

#endif
