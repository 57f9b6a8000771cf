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

static inline pvid_strong_filters_f32 pvid_strong_begin_f32(const float *weight, size_t half, float middle, float after,
                                                            float before)
{
    const float even = (after - middle) + (before - middle);
    const pvid_strong_filters_f32 sums = {middle, weight[0] * even, weight[2u * half] * even,
                                          weight[3u * half] * (after - before), weight[4u * half] * even};
    return sums;
}

static inline void pvid_strong_add_f32(pvid_strong_filters_f32 *self, const float *weight, size_t half, float after,
                                       float before)
{
    const pvid_strong_filters_f32 more = pvid_strong_begin_f32(weight, half, self->middle, after, before);
    self->order0 += more.order0;
    self->order2 += more.order2;
    self->order3 += more.order3;
    self->order4 += more.order4;
}

/* Channel 0, phi, or 1, y, by the bank. */
pvid_strong_filters_f32 pvid_strong_window_filter_f32(const pvid_strong_window_f32 *self, size_t channel);

/* Both channels by five points `stride` apart in a ring of `length` whose oldest sample is at head. */
static inline void pvid_strong_five_points_f32(const pvid_strong_window_f32 *self, pvid_strong_filters_f32 *phi,
                                               pvid_strong_filters_f32 *y)
{
    const size_t stride = self->bank.stride;
    const size_t length = self->length;
    size_t place = self->head;
    float phis[5];
    float ys[5];
    PVID_UNROLL
    for (size_t i = 0; i < 5u; i++) {
        phis[i] = self->samples[place][0];
        ys[i] = self->samples[place][1];
        place += stride;
        place = (place >= length) ? (place - length) : place;
    }
    *phi = pvid_strong_five_f32(phis);
    *y = pvid_strong_five_f32(ys);
}

/* Takes a sample of each channel into the sums of their blocks, whose values become the points at `head`. */
void pvid_strong_window_blocks_f32(pvid_strong_window_f32 *self, size_t head);

/* Counts a sample of a window that is not full yet. Returns whether it is full. */
static inline bool pvid_strong_window_fills_f32(pvid_strong_window_f32 *self)
{
    if (self->missing > 0u) {
        self->missing--;
    }
    return self->missing == 0u;
}

/* Stores a sample of each channel. When the window is full, writes phi, phi'', phi''', phi'''' (its order 1 is not set)
 * and u, u', u'', and returns true. */
static inline bool pvid_strong_window_step_f32(pvid_strong_window_f32 *self, float phi, float y,
                                               float d_phi[PVID_ORDERS], float u[3])
{
    const size_t head = self->head;
    self->samples[head][0] = phi;
    self->samples[head][1] = y;
    self->head = (uint16_t)((head + 1u == self->length) ? 0u : (head + 1u));
    pvid_strong_filters_f32 of_phi;
    pvid_strong_filters_f32 of_y;
    if (self->five_points) {
        if (!pvid_strong_window_fills_f32(self)) {
            return false;
        }
        pvid_strong_five_points_f32(self, &of_phi, &of_y);
        d_phi[0] = of_phi.middle;
    } else {
        if (self->bank.block > 1u) {
            pvid_strong_window_blocks_f32(self, head);
        }
        if (!pvid_strong_window_fills_f32(self)) {
            return false;
        }
        of_phi = pvid_strong_window_filter_f32(self, 0);
        of_y = pvid_strong_window_filter_f32(self, 1);
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
