/* Hashes of parts that the float configurations have in common, continued from `hash`. Private to the core. */
#ifndef PVID_FINGERPRINT_PARTS_F32_H
#define PVID_FINGERPRINT_PARTS_F32_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/estimator.h"
#include "pvid/gate.h"
#include "pvid/trust.h"

/* The bits of numbers; those of a configuration that init accepts are finite. */
uint32_t pvid_fingerprint_float(uint32_t hash, float value);
uint32_t pvid_fingerprint_floats(uint32_t hash, const float values[], size_t n);

/* Without the fields that the identifiers fill in. */
uint32_t pvid_fingerprint_estimator_f32(uint32_t hash, const pvid_estimator_config_f32 *config, size_t n_p);

uint32_t pvid_fingerprint_gate_f32(uint32_t hash, const pvid_gate_config_f32 *config);
uint32_t pvid_fingerprint_trust_f32(uint32_t hash, const pvid_trust_config_f32 *config);

#endif
