/* The derivatives of both channels of the strong form: one bank of filters, one place in both rings. Private to the
 * core, inlined: derivatives that no row uses are not computed. */
#ifndef PVID_STRONG_DERIVATIVES_F32_H
#define PVID_STRONG_DERIVATIVES_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "number/unroll.h"
#include "pvid/detail/strong_state.h"
#include "strong/differentiator_f32.h"

/* Takes the bank, the sample rate and l1. Fails as pvid_differentiator_init_f32. */
pvid_status pvid_strong_window_init_f32(pvid_strong_window_f32 *self, const pvid_strong_config_f32 *config);

/* Empties the window. */
void pvid_strong_window_reset_f32(pvid_strong_window_f32 *self);

/* The sums of the filters of orders 0, 2, 3, 4. */
typedef struct {
    float middle;
    float order0;
    float order2;
    float order3;
    float order4;
} pvid_strong_filters_f32;

/* Five points written out, the oldest first. */
static inline pvid_strong_filters_f32 pvid_strong_five_f32(const float x[5])
{
    const float middle = x[2];
    const float even1 = (x[3] - middle) + (x[1] - middle);
    const float even2 = (x[4] - middle) + (x[0] - middle);
    const float odd1 = x[3] - x[1];
    const float odd2 = x[4] - x[0];
    const pvid_strong_filters_f32 sums = {middle, 0.0f, (16.0f * even1) - even2, odd2 - (2.0f * odd1),
                                          even2 - (4.0f * even1)};
    return sums;
}

/* phi and y by the bank; of y the order 0 is not computed. */
void pvid_strong_window_filter_f32(const pvid_strong_window_f32 *self, const pvid_fir_bank_f32 *bank,
                                   pvid_strong_filters_f32 sums[2]);

/* The place in the ring so many places after another. */
static inline size_t pvid_strong_after_f32(const pvid_strong_window_f32 *self, size_t place, size_t ahead)
{
    const size_t after = place + ahead;
    return (after >= self->length) ? (after - self->length) : after;
}

/* Both channels by five points `stride` apart in a ring whose oldest sample is at this place; the newest are given. */
static inline void pvid_strong_five_points_f32(const pvid_strong_window_f32 *self, size_t oldest, float newest_phi,
                                               float newest_y, pvid_strong_filters_f32 *phi, pvid_strong_filters_f32 *y)
{
    const size_t stride = self->stride;
    size_t place = oldest;
    float phis[5] = {[4] = newest_phi};
    float ys[5] = {[4] = newest_y};
    PVID_UNROLL
    for (size_t i = 0; i < 4u; i++) {
        phis[i] = self->samples[place][0];
        ys[i] = self->samples[place][1];
        place = pvid_strong_after_f32(self, place, stride);
    }
    *phi = pvid_strong_five_f32(phis);
    *y = pvid_strong_five_f32(ys);
}

/* pvid_strong_window_f32.five_points of a full window. */
#define PVID_FIVE_POINTS_READY 2u

/* Takes a sample of each channel into a window of another bank, or one that is not full yet. Returns whether it
 * completes a block, and the window is full. */
bool pvid_strong_window_takes_f32(pvid_strong_window_f32 *self, const pvid_fir_bank_f32 *bank, float phi, float y);

/* Takes a sample of each channel. When it completes a block and the window is full, writes phi, phi'', phi''', phi''''
 * (its order 1 is not set) and u, u', u'', and returns true. */
static inline bool pvid_strong_window_step_f32(pvid_strong_window_f32 *self, const pvid_fir_bank_f32 *bank, float phi,
                                               float y, float d_phi[PVID_ORDERS], float u[3])
{
    const size_t head = self->head;
    const size_t oldest = pvid_strong_after_f32(self, head, 1);
    const uint32_t five_points = self->five_points;
    if (five_points == PVID_FIVE_POINTS_READY) {
        self->samples[head][0] = phi;
        self->samples[head][1] = y;
        self->head = (uint16_t)oldest;
    } else if (!pvid_strong_window_takes_f32(self, bank, phi, y)) {
        return false;
    } else {
        /* the window is full */
    }
    pvid_strong_filters_f32 of_phi;
    pvid_strong_filters_f32 of_y;
    if (five_points != 0u) {
        pvid_strong_five_points_f32(self, oldest, phi, y, &of_phi, &of_y);
        d_phi[0] = of_phi.middle;
    } else {
        pvid_strong_filters_f32 sums[2];
        pvid_strong_window_filter_f32(self, bank, sums);
        of_phi = sums[0];
        of_y = sums[1];
        d_phi[0] = (of_phi.middle + of_phi.order0) * self->phi_scale[0];
    }
    d_phi[2] = of_phi.order2 * self->phi_scale[1];
    d_phi[3] = of_phi.order3 * self->phi_scale[2];
    d_phi[4] = of_phi.order4 * self->phi_scale[3];
    u[0] = of_y.order2 * self->u_scale[0];
    u[1] = of_y.order3 * self->u_scale[1];
    u[2] = of_y.order4 * self->u_scale[2];
    return true;
}

#endif
