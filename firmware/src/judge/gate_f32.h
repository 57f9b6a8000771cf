/* The judgement of gate.h, inlined where it is made at every tick. Private to the core. */
#ifndef PVID_JUDGE_GATE_F32_H
#define PVID_JUDGE_GATE_F32_H

#include <stdbool.h>

#include "number/finite_f32.h"
#include "pvid/gate.h"

/* Largest scale [square of a residual]: far beyond any accepted row. */
#define PVID_GATE_SCALE_MAX 1.0e30f

/* pvid_gate_passes_f32. */
static inline bool pvid_gate_judges_f32(pvid_gate_f32 *self, float square)
{
    if (!(self->limit > 0.0f) || !pvid_finite_f32(square)) {
        return true;
    }
    const bool warming_up = self->judged < self->memory;
    const bool passes = warming_up || (square <= (self->limit * self->scale));
    float scale = self->scale * self->widening;
    if (passes) {
        self->judged = warming_up ? (self->judged + 1.0f) : self->judged;
        scale = self->scale + ((square - self->scale) / self->judged);
    }
    scale = (scale > self->floor) ? scale : self->floor;
    self->scale = (scale < PVID_GATE_SCALE_MAX) ? scale : PVID_GATE_SCALE_MAX;
    return passes;
}

#endif
