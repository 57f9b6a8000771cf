/* pvid/snapshot_refine.h - snapshot_weak.h for an identifier with a second stage: both in one image.
 *
 * Usage, slots and layout as in snapshot_slots.h. A snapshot of another model, design or setting of either stage is
 * refused.
 */
#ifndef PVID_SNAPSHOT_REFINE_H
#define PVID_SNAPSHOT_REFINE_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/refine.h"
#include "pvid/snapshot_slots.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Size of a snapshot of an identifier with its refinement, at most [bytes]. */
#define PVID_SNAPSHOT_REFINE_F32 PVID_SNAPSHOT_BYTES(sizeof(pvid_weak_f32) + sizeof(pvid_refine_f32))

/* As pvid_snapshot_save_weak_f32, of both stages. Fails as well if config.refine is NULL. */
size_t pvid_snapshot_save_refine_f32(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config, uint32_t generation,
                                     uint8_t image[], size_t room);

/* As pvid_snapshot_restore_weak_f32, of both stages. PVID_SNAPSHOT_NOT_READY as well if config.refine is NULL. */
pvid_snapshot_status pvid_snapshot_restore_refine_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                                      const uint8_t image[], size_t length);

#ifdef __cplusplus
}
#endif

#endif
