#include "weak_front_f32.h"

#include <stddef.h>

enum { PHI = 0, Y = 1 };

void pvid_weak_front_init_f32(pvid_weak_front_f32 *self, const pvid_weak_design_f32 *design, float sample_rate_hz,
                              float l1)
{
    self->half = (uint16_t)((design->taps - 1u) / 2u);
    self->length = (uint16_t)((design->taps + design->decimation) - 1u);
    self->decimation = design->decimation;
    const uint32_t ticks = (design->decimation > 1u) ? (design->decimation / 2u) : 1u;
    self->slice = (uint16_t)((self->half + (ticks - 1u)) / ticks);
    self->smooth = design->smooth;
    self->second = design->second;
    self->u_scale = (sample_rate_hz * sample_rate_hz) / l1;
    pvid_weak_front_reset_f32(self);
}

void pvid_weak_front_reset_f32(pvid_weak_front_f32 *self)
{
    self->head = 0;
    self->wait = (uint16_t)((2u * self->half) + 1u);
    self->pair = self->half;
}

static void begin_job(pvid_weak_front_f32 *self)
{
    /* the newest sample stands before head, the centre `half` before that */
    const uint16_t back = (uint16_t)(self->half + 1u);
    const uint16_t centre =
        (uint16_t)((self->head >= back) ? (self->head - back) : ((self->head + self->length) - back));
    self->middle[PHI] = self->ring[centre][PHI];
    self->middle[Y] = self->ring[centre][Y];
    self->sum[PHI] = 0.0f;
    self->sum[Y] = 0.0f;
    self->pair = 0;
    self->newer = centre;
    self->older = centre;
}

/* A slice of pairs, outwards from the centre, in runs that do not cross the ring's ends. */
static inline void continue_job(pvid_weak_front_f32 *self)
{
    const size_t left = (size_t)self->half - self->pair;
    const size_t last = self->pair + ((left < self->slice) ? left : self->slice);
    const size_t length = self->length;
    const float middle_phi = self->middle[PHI];
    const float middle_y = self->middle[Y];
    float sum_phi = self->sum[PHI];
    float sum_y = self->sum[Y];
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
        const float *after = self->ring[newer];
        const float *before = self->ring[older];
        for (const size_t end = i + run; i < end; i++) {
            sum_phi += self->smooth[i] * ((after[PHI] - middle_phi) + (before[PHI] - middle_phi));
            sum_y += self->second[i] * ((after[Y] - middle_y) + (before[Y] - middle_y));
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

bool pvid_weak_front_step_f32(pvid_weak_front_f32 *self, float phi, float y, float *smooth_phi, float *u)
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
    continue_job(self);
    if (self->pair < self->half) {
        return false;
    }
    *smooth_phi = self->middle[PHI] + self->sum[PHI];
    *u = self->sum[Y] * self->u_scale;
    return true;
}

uint16_t pvid_weak_front_ticks_f32(const pvid_weak_front_f32 *self)
{
    return (uint16_t)((self->half + (self->slice - 1u)) / self->slice);
}
