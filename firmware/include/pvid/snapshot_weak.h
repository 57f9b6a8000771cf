/* pvid/snapshot_weak.h - snapshots of the weak form: weak.h.
 *
 * Usage, slots and layout as in snapshot_slots.h. A snapshot of another model or design is refused with a status of its
 * own.
 */
#ifndef PVID_SNAPSHOT_WEAK_H
#define PVID_SNAPSHOT_WEAK_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/snapshot_slots.h"
#include "pvid/weak.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Size of a snapshot of an identifier [bytes]. */
#define PVID_SNAPSHOT_WEAK_F32 PVID_SNAPSHOT_BYTES(sizeof(pvid_weak_f32))

/* Writes a snapshot of `self` to image[]; config is the configuration of its init. Returns its length [bytes].
 * Fails (returns 0, writes nothing) iff
 *   - it does not fit into `room` [bytes], or
 *   - `self` is not initialised.
 *
 * Cost: a copy and a checksum of the object and a hash of the tables, some ticks long. */
size_t pvid_snapshot_save_weak_f32(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config, uint32_t generation,
                                   uint8_t image[], size_t room);

/* Restores `self`, initialised with config, from the snapshot at image[0 .. length - 1]; bytes after the snapshot
 * are ignored. Any answer but PVID_SNAPSHOT_RESTORED leaves `self` unchanged. */
pvid_snapshot_status pvid_snapshot_restore_weak_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                                    const uint8_t image[], size_t length);

#ifdef __cplusplus
}
#endif

#endif
