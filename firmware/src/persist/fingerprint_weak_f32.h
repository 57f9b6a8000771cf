/* One number each for a compiled model, a design and a configuration of the weak form in float32: what
 * differs has, but for chance, another one. Private to the core. */
#ifndef PVID_FINGERPRINT_WEAK_F32_H
#define PVID_FINGERPRINT_WEAK_F32_H

#include <stdint.h>

#include "pvid/weak.h"

/* FNV-1a over every field and table, in their order; the configuration must be one that init accepts. The functions of
 * the model are hashed by their results at two points: they have the same bits in every build. */
uint32_t pvid_fingerprint_weak_model_f32(const pvid_weak_model_f32 *model);
uint32_t pvid_fingerprint_weak_design_f32(const pvid_weak_design_f32 *design);
/* The configuration alone, without its design. */
uint32_t pvid_fingerprint_weak_f32(const pvid_weak_config_f32 *config);

#endif
