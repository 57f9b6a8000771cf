/* One number each for a compiled model, a design and a configuration of the weak form in fixed point: what
 * differs has, but for chance, another one. Private to the core. */
#ifndef PVID_FINGERPRINT_WEAK_Q31_H
#define PVID_FINGERPRINT_WEAK_Q31_H

#include <stdint.h>

#include "pvid/weak_q31.h"

/* FNV-1a over every field and table, in their order; the configuration must be one that init accepts. The functions of
 * the model are hashed by their results at two points: they have the same bits in every build. */
uint32_t pvid_fingerprint_weak_model_q31(const pvid_weak_model_q31 *model);
uint32_t pvid_fingerprint_weak_design_q31(const pvid_weak_design_q31 *design);
/* The configuration alone, without its design. */
uint32_t pvid_fingerprint_weak_q31(const pvid_weak_config_q31 *config);

#endif
