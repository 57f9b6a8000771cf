/* pvid/snapshot_q31.h - snapshot.h for the fixed-point identifiers. */
#ifndef PVID_SNAPSHOT_Q31_H
#define PVID_SNAPSHOT_Q31_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/snapshot_slots.h"
#include "pvid/strong_q31.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Size of a snapshot of an identifier [bytes]. */
#define PVID_SNAPSHOT_STRONG_Q31 PVID_SNAPSHOT_BYTES(sizeof(pvid_strong_q31))

/* As pvid_snapshot_save_strong_f32. */
size_t pvid_snapshot_save_strong_q31(const pvid_strong_q31 *self, const pvid_strong_config_q31 *config,
                                     uint32_t generation, uint8_t image[], size_t room);

/* As pvid_snapshot_restore_strong_f32. */
pvid_snapshot_status pvid_snapshot_restore_strong_q31(pvid_strong_q31 *self, const pvid_strong_config_q31 *config,
                                                      const uint8_t image[], size_t length);

#ifdef __cplusplus
}
#endif

#endif
