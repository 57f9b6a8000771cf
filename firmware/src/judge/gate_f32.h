/* The judgement of gate.h where it is made at every tick. Private to the core. */
#ifndef PVID_JUDGE_GATE_F32_H
#define PVID_JUDGE_GATE_F32_H

#include <stdbool.h>

#include "number/finite_f32.h"
#include "number/unroll.h"
#include "pvid/gate.h"

/* Largest scale [square of a residual]: far beyond any accepted row. */
#define PVID_GATE_SCALE_MAX 1.0e30f

/* The scale with one residual more, not yet below its largest value. */
static inline float pvid_gate_scale_with_f32(const pvid_gate_f32 *self, float square)
{
    const float scale = self->scale + ((square - self->scale) / self->judged);
    return (scale > self->floor) ? scale : self->floor;
}

/* Accepts a finite residual. */
static inline bool pvid_gate_accept_f32(pvid_gate_f32 *self, float square)
{
    const float scale = pvid_gate_scale_with_f32(self, square);
    self->scale = (scale < PVID_GATE_SCALE_MAX) ? scale : PVID_GATE_SCALE_MAX;
    return true;
}

/* Forgets the usual size: the next residuals are accepted, as the first ones were. */
static inline void pvid_gate_begin_anew_f32(pvid_gate_f32 *self)
{
    self->judged = 0.0f;
}

/* As behind init: a usual size from before means nothing. */
static inline void pvid_gate_restart_f32(pvid_gate_f32 *self)
{
    self->judged = 0.0f;
    self->scale = self->floor;
    self->usual = self->floor;
}

/* pvid_gate_passes_f32: inlined for a finite residual while the memory fills, and for one of usual size behind that. */
static inline bool pvid_gate_judges_f32(pvid_gate_f32 *self, float square)
{
    if (PVID_LIKELY(self->judged >= self->memory)) {
        if (PVID_LIKELY(square < (self->limit * self->scale))) {
            const float scale = pvid_gate_scale_with_f32(self, square);
            if (PVID_LIKELY(scale < PVID_GATE_SCALE_MAX)) {
                self->scale = scale;
                return true;
            }
        }
    } else if ((self->limit > 0.0f) && pvid_finite_f32(square)) {
        self->judged += 1.0f;
        return pvid_gate_accept_f32(self, square);
    } else {
        /* the gate is off, or the residual no number */
    }
    return pvid_gate_passes_f32(self, square);
}

/* The hash of a gate's settings, continued from `hash`. */
uint32_t pvid_fingerprint_gate_f32(uint32_t hash, const pvid_gate_config_f32 *config);

#endif
