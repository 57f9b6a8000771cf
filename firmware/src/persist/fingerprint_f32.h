/* One number for a configuration with all its tables: equal configurations have equal ones. Private to the core. */
#ifndef PVID_FINGERPRINT_F32_H
#define PVID_FINGERPRINT_F32_H

#include <stdint.h>

#include "pvid/strong.h"

/* FNV-1a over every field that init reads, in their order; the configuration must be one that init accepts. Costs a
 * hash of all tables. */
uint32_t pvid_fingerprint_strong_f32(const pvid_strong_config_f32 *config);

#endif
