/* Hashes of parts that the fixed-point configurations have in common, continued from `hash`. Private to the core. */
#ifndef PVID_FINGERPRINT_PARTS_Q31_H
#define PVID_FINGERPRINT_PARTS_Q31_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/estimator_q31.h"
#include "pvid/gate_q31.h"
#include "pvid/trust_q31.h"

uint32_t pvid_fingerprint_words(uint32_t hash, const int32_t values[], size_t n);
uint32_t pvid_fingerprint_formats(uint32_t hash, const int8_t values[], size_t n);

/* Tables may be in their own address space. */
uint32_t pvid_fingerprint_table(uint32_t hash, const PVID_TABLE int32_t *values, size_t n);

uint32_t pvid_fingerprint_estimator_q31(uint32_t hash, const pvid_estimator_config_q31 *config, size_t n_theta,
                                        size_t n_p);
uint32_t pvid_fingerprint_trust_q31(uint32_t hash, const pvid_trust_config_q31 *config);
uint32_t pvid_fingerprint_gate_q31(uint32_t hash, const pvid_gate_config_q31 *config);

#endif
