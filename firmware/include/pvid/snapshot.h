/* pvid/snapshot.h - saves an identifier's state and restores it after a power cut, bit for bit.
 *
 * A snapshot is the identifier's memory with a header, a generation and a checksum. restore refuses a snapshot
 * that is damaged, truncated or from another identifier, and then changes nothing.
 *
 *   static uint8_t image[PVID_SNAPSHOT_STRONG_F32];
 *   (at the start, after init:)
 *   choice = pvid_snapshot_choose(flash_slot_0, flash_slot_1, sizeof image);
 *   if (choice.newest >= 0)
 *       status = pvid_snapshot_restore_strong_f32(&identifier, &config, flash_slot[choice.newest], sizeof image);
 *   if (samples were missed) pvid_strong_gap_f32(&identifier);
 *   (from time to time, between two ticks:)
 *   n = pvid_snapshot_save_strong_f32(&identifier, &config, choice.generation, image, sizeof image);
 *   write n bytes to the slot choice.next, then choose again
 *
 * Two slots. The slot to write is never that of the newest valid snapshot; a power cut at any byte of a write
 * leaves that one valid. The caller writes the bytes to flash, in any order.
 *
 * A snapshot is valid for the same build (release, sizes, byte order, width of pointers: all in `layout`), the
 * same form and core, the same configuration and tables. Pointers are not saved: they keep the values of init. The
 * checksum detects accidents, not attacks. Not thread-safe: no tick during these functions.
 *
 * Layout of a snapshot, all numbers little-endian:
 *    0 magic "PVSS"   4 bytes in all   8 version, that of the library   12 kind   16 layout   20 model   24 design
 *   28 configuration   32 generation   36 the object's bytes, its pointers as 0 (NULL) or 1   and last CRC-32 of all
 *   before it. Model and design are 0 but for the identifiers of snapshot_weak.h
 */
#ifndef PVID_SNAPSHOT_H
#define PVID_SNAPSHOT_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/snapshot_slots.h"
#include "pvid/strong.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Size of a snapshot of an identifier [bytes]. */
#define PVID_SNAPSHOT_STRONG_F32 PVID_SNAPSHOT_BYTES(sizeof(pvid_strong_f32))

/* Writes a snapshot of `self` to image[]; config is the configuration of its init. Returns its length [bytes].
 * Fails (returns 0, writes nothing) iff
 *   - it does not fit into `room` [bytes], or
 *   - `self` is not initialised.
 *
 * Cost: a copy and a checksum of the object and a hash of the tables, some ticks long. */
size_t pvid_snapshot_save_strong_f32(const pvid_strong_f32 *self, const pvid_strong_config_f32 *config,
                                     uint32_t generation, uint8_t image[], size_t room);

/* Restores `self`, initialised with config, from the snapshot at image[0 .. length - 1]; bytes after the snapshot
 * are ignored. Any answer but PVID_SNAPSHOT_RESTORED leaves `self` unchanged. */
pvid_snapshot_status pvid_snapshot_restore_strong_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config,
                                                      const uint8_t image[], size_t length);

#ifdef __cplusplus
}
#endif

#endif
