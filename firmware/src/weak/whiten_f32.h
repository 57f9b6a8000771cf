/* Whitening of a window's rows at the present p (theory.md 5). Private to the core.
 *
 * The noise of the angle enters a row's residual through the filter chi'''' + d1 w chi'' + d2 w^2 chi. The covariance
 * of a window's rows is therefore R0(p), a combination of the design's six Gram tables, times the variance of the
 * decimated angle. With R0 = L L^T the rows of L^-1 (Y, N) have independent noise. Each call processes one function. */
#ifndef PVID_WEAK_WHITEN_F32_H
#define PVID_WEAK_WHITEN_F32_H

#include <stddef.h>

#include "pvid/weak.h"

/* Takes p = (w, d1, d2, ..) for the calls that follow. */
void pvid_weak_whiten_begin_f32(pvid_weak_whiten_f32 *self, const float p[]);

/* Row `row` of R0's lower triangle. */
void pvid_weak_whiten_combine_f32(pvid_weak_whiten_f32 *self, const pvid_weak_design_f32 *design, size_t row);

/* A row of L; call it for rows 0.. in order. If R0 cannot be factored, the rows keep the whitening of the design. */
void pvid_weak_whiten_factor_f32(pvid_weak_whiten_f32 *self, size_t row);

/* Replaces a row of x by that row of L^-1 x; call it for rows 0.. in order. */
void pvid_weak_whiten_row_f32(const pvid_weak_whiten_f32 *self, size_t row, float x[][PVID_WEAK_TERMS]);

/* inverse[0..row] = row `row` of L^-1. */
void pvid_weak_whiten_inverse_f32(const pvid_weak_whiten_f32 *self, size_t row, float inverse[]);

/* Adds a row's part of trace number `which`: trace(R0^-1 G22), trace(R0^-1 G20), trace(R0^-1 G00). These are the
 * square that noise of unit variance adds to the columns of chi'' phi and chi phi. The first row starts the sum, the
 * last one divides it by K: self->trace is then the argument of the model's `noise` (pvid/model.h). */
void pvid_weak_whiten_trace_f32(pvid_weak_whiten_f32 *self, const pvid_weak_design_f32 *design, size_t row,
                                const float inverse[], size_t which);

#endif
