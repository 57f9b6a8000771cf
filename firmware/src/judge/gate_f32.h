/* The judgement of gate.h where it is made at every tick. Private to the core. */
#ifndef PVID_JUDGE_GATE_F32_H
#define PVID_JUDGE_GATE_F32_H

#include <stdbool.h>

#include "number/finite_f32.h"
#include "pvid/gate.h"

/* Largest scale [square of a residual]: far beyond any accepted row. */
#define PVID_GATE_SCALE_MAX 1.0e30f

/* Accepts a finite residual. */
static inline bool pvid_gate_accept_f32(pvid_gate_f32 *self, float square)
{
    const float scale = self->scale + ((square - self->scale) / self->judged);
    const float larger = (scale > self->floor) ? scale : self->floor;
    self->scale = (larger < PVID_GATE_SCALE_MAX) ? larger : PVID_GATE_SCALE_MAX;
    return true;
}

/* pvid_gate_passes_f32: inlined for a residual of usual size behind a complete memory. */
static inline bool pvid_gate_judges_f32(pvid_gate_f32 *self, float square)
{
    const bool usual = (self->judged >= self->memory) && (square < (self->limit * self->scale));
    return usual ? pvid_gate_accept_f32(self, square) : pvid_gate_passes_f32(self, square);
}

#endif
