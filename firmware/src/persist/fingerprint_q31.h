/* One number for a fixed-point configuration with all its tables, as fingerprint_f32.h. Private to the core. */
#ifndef PVID_FINGERPRINT_Q31_H
#define PVID_FINGERPRINT_Q31_H

#include <stdint.h>

#include "pvid/strong_q31.h"

uint32_t pvid_fingerprint_strong_q31(const pvid_strong_config_q31 *config);

#endif
