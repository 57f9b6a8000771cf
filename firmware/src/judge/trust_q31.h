/* The hash of the conditions of trust_q31.h. Private to the core. */
#ifndef PVID_JUDGE_TRUST_Q31_H
#define PVID_JUDGE_TRUST_Q31_H

#include "pvid/trust_q31.h"

/* Continued from `hash`. */
uint32_t pvid_fingerprint_trust_q31(uint32_t hash, const pvid_trust_config_q31 *config);

#endif
