/* Hashes of a refinement's model and configuration. Private to the core. */
#ifndef PVID_FINGERPRINT_REFINE_F32_H
#define PVID_FINGERPRINT_REFINE_F32_H

#include <stdint.h>

#include "pvid/refine.h"

/* Continued from `hash`. */
uint32_t pvid_fingerprint_refine_model_f32(uint32_t hash);
uint32_t pvid_fingerprint_refine_f32(uint32_t hash, const pvid_refine_config_f32 *config);

#endif
