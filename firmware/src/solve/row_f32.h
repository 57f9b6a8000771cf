/* Check and innovation of a row before it is added to the sums, for the estimator and the strong form. Private to the
 * core, inlined. */
#ifndef PVID_ROW_F32_H
#define PVID_ROW_F32_H

#include "number/count.h"
#include "number/finite_f32.h"
#include "solve/state_f32.h"

/* y^2 + N^T N, in the order of the n_own entries. */
static inline float pvid_row_squares_f32(size_t n_own, const float n[], float y)
{
    float squares = y * y;
    for (size_t i = 0; i < n_own; i++) {
        squares += n[i] * n[i];
    }
    return squares;
}

/* Accepts a row of n_own entries or counts it as rejected. One comparison of the sum of squares checks all entries; the
 * reason is sought only after a rejection. */
static inline pvid_reason pvid_row_accept_f32(pvid_estimator_f32 *self, size_t n_own, const float n[], float y,
                                              float squares)
{
    if (squares <= (PVID_ROW_LIMIT * PVID_ROW_LIMIT)) {
        return PVID_ACCUMULATED;
    }
    bool finite = pvid_finite_f32(y);
    for (size_t i = 0; i < n_own; i++) {
        finite = finite && pvid_finite_f32(n[i]);
    }
    pvid_count_up(finite ? &self->counters.rejected_saturated : &self->counters.rejected_not_finite);
    return finite ? PVID_REJECTED_SATURATED : PVID_REJECTED_NOT_FINITE;
}

/* innovation += C^T N e */
static inline void pvid_row_accumulate_innovation_f32(pvid_estimator_f32 *self, size_t n_p, const float gradient[],
                                                      float e)
{
#if PVID_FEEDBACK
    for (size_t a = 0; a < n_p; a++) {
        self->innovation[a] += gradient[a] * e;
    }
#else
    (void)self;
    (void)n_p;
    (void)gradient;
    (void)e;
#endif
}

#endif
