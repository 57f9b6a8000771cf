/* Whether a window is to be used: ranges and least deviations of the samples. Private to the core. */
#ifndef PVID_WEAK_LIMITS_F32_H
#define PVID_WEAK_LIMITS_F32_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/weak.h"

/* delay: steps from a sample to the last step that it is part of. */
void pvid_weak_limits_init_f32(pvid_weak_limits_f32 *self, const pvid_weak_config_f32 *config, uint16_t delay);

/* Forgets samples beyond their ranges. */
void pvid_weak_limits_reset_f32(pvid_weak_limits_f32 *self);

/* Takes a step of a half, at a tick with these samples. first: it is the half's first step. */
void pvid_weak_limits_step_f32(pvid_weak_limits_f32 *self, size_t samples, const float sample[], size_t half,
                               bool first);

/* Behind the last step of a half, which has so many. */
void pvid_weak_limits_half_f32(pvid_weak_limits_f32 *self, size_t samples, size_t half, uint16_t hop);

/* Whether a sample of the last two halves was beyond its range. */
bool pvid_weak_limits_beyond_f32(const pvid_weak_limits_f32 *self);

/* Whether a sample moved too little in one of the last two halves, or a sign was in doubt for too long. */
bool pvid_weak_limits_still_f32(const pvid_weak_limits_f32 *self);

#endif
