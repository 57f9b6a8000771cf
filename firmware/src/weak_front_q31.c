#include "weak_front_q31.h"

#include <stddef.h>

#include "integer_q31.h"

enum { PHI = 0, Y = 1 };

void pvid_weak_front_init_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design)
{
    self->half = (uint16_t)((design->taps - 1u) / 2u);
    self->length = (uint16_t)((design->taps + design->decimation) - 1u);
    self->decimation = design->decimation;
    const uint32_t ticks = (design->decimation > 1u) ? (design->decimation / 2u) : 1u;
    self->slice = (uint16_t)((self->half + (ticks - 1u)) / ticks);
    pvid_weak_front_reset_q31(self);
}

void pvid_weak_front_reset_q31(pvid_weak_front_q31 *self)
{
    self->head = 0;
    self->wait = (uint16_t)((2u * self->half) + 1u);
    self->pair = self->half;
}

static void begin_job(pvid_weak_front_q31 *self)
{
    /* the newest sample stands before head, the centre `half` before that */
    const uint16_t back = (uint16_t)(self->half + 1u);
    const uint16_t centre = (uint16_t)((self->head >= back) ? (self->head - back) : ((self->head + self->length) - back));
    self->middle[PHI] = self->ring[centre][PHI];
    self->middle[Y] = self->ring[centre][Y];
    self->sum[PHI] = 0;
    self->sum[Y] = 0;
    self->pair = 0;
    self->newer = centre;
    self->older = centre;
}

/* A slice of pairs, outwards from the centre, in runs that do not cross the ring's ends. A weight times the sum of two
 * differences fits 32 bits by design. */
static void continue_job(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design)
{
    const size_t left = (size_t)self->half - self->pair;
    const size_t last = self->pair + ((left < self->slice) ? left : self->slice);
    const size_t length = self->length;
    const int32_t middle_phi = 2 * self->middle[PHI];
    const int32_t middle_y = 2 * self->middle[Y];
    int64_t sum_phi = self->sum[PHI];
    int64_t sum_y = self->sum[Y];
    size_t newer = self->newer;
    size_t older = self->older;
    size_t i = self->pair;
    while (i < last) {
        newer = (newer + 1u == length) ? 0u : (newer + 1u);
        older = (older == 0u) ? (length - 1u) : (older - 1u);
        const size_t ahead = length - newer;
        const size_t behind = older + 1u;
        const size_t room = (ahead < behind) ? ahead : behind;
        const size_t run = ((last - i) < room) ? (last - i) : room;
        const int32_t *after = self->ring[newer];
        const int32_t *before = self->ring[older];
        for (const size_t end = i + run; i < end; i++) {
            sum_phi += design->smooth[i] * ((after[PHI] + before[PHI]) - middle_phi);
            sum_y += design->second[i] * ((after[Y] + before[Y]) - middle_y);
            after += 2;
            before -= 2;
        }
        newer += run - 1u;
        older -= run - 1u;
    }
    self->sum[PHI] = sum_phi;
    self->sum[Y] = sum_y;
    self->newer = (uint16_t)newer;
    self->older = (uint16_t)older;
    self->pair = (uint16_t)last;
}

bool pvid_weak_front_step_q31(pvid_weak_front_q31 *self, const pvid_weak_design_q31 *design, int32_t phi, int32_t y,
                              int32_t *f, int64_t *u)
{
    self->ring[self->head][PHI] = phi;
    self->ring[self->head][Y] = y;
    self->head = (uint16_t)((self->head + 1u == self->length) ? 0u : (self->head + 1u));
    self->wait--;
    if (self->wait == 0u) {
        self->wait = self->decimation;
        begin_job(self);
    }
    if (self->pair == self->half) {
        return false;
    }
    continue_job(self, design);
    if (self->pair < self->half) {
        return false;
    }
    const int64_t smooth = (self->middle[PHI] * ((int64_t)1 << design->smooth_bits)) + self->sum[PHI];
    *f = (int32_t)pvid_round_shift_q31(smooth, design->phi_shift);
    *u = pvid_round_shift_q31(self->sum[Y], design->u_shift);
    return true;
}

uint16_t pvid_weak_front_ticks_q31(const pvid_weak_front_q31 *self)
{
    return (uint16_t)((self->half + (self->slice - 1u)) / self->slice);
}
