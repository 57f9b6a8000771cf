/* pvid/snapshot.h - saves an identifier's state and restores it, so that a run goes on after the power was off.
 *
 * A snapshot is the identifier as it stands in memory, sealed: with what made it, a generation and a checksum. A
 * restored identifier continues bit for bit, whatever it was in the middle of. A snapshot that is damaged, cut short
 * or not of this identifier is refused, and nothing is changed.
 *
 *   static uint8_t image[PVID_SNAPSHOT_WEAK_F32];
 *   (at the start, after init:)
 *   choice = pvid_snapshot_choose(flash_slot_0, flash_slot_1, sizeof image);
 *   if (choice.newest >= 0)
 *       status = pvid_snapshot_restore_weak_f32(&identifier, &config, flash_slot[choice.newest], sizeof image);
 *   if (samples were missed) pvid_weak_gap_f32(&identifier);
 *   (from time to time, between two ticks:)
 *   n = pvid_snapshot_save_weak_f32(&identifier, &config, choice.generation, image, sizeof image);
 *   write n bytes to the slot choice.next, then choose again
 *
 * Two slots: the one written to is never that of the newest valid snapshot, so power that fails at any byte of a
 * write leaves that one to be found. How bytes get into flash is the caller's business; they may be written in any
 * order.
 *
 * What a snapshot is good for: the same build (release, sizes, byte order, width of pointers: all in `layout`), the
 * same form and core, the same configuration with the same tables. Pointers are not saved: they stay what init made of
 * them. The checksum guards against accident, not against malice. Not thread-safe: no tick while one of these works.
 *
 * Layout of a snapshot, all numbers little-endian:
 *    0 magic "PVSS"   4 bytes in all   8 version, that of the library   12 kind   16 layout   20 configuration
 *   24 generation   28 the object's bytes, its pointers as 0 (NULL) or 1   and last CRC-32 of all before it
 */
#ifndef PVID_SNAPSHOT_H
#define PVID_SNAPSHOT_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/snapshot_slots.h"
#include "pvid/strong.h"
#include "pvid/weak.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Room for a snapshot of an identifier [bytes]. */
#define PVID_SNAPSHOT_STRONG_F32 PVID_SNAPSHOT_BYTES(sizeof(pvid_strong_f32))
#define PVID_SNAPSHOT_WEAK_F32 PVID_SNAPSHOT_BYTES(sizeof(pvid_weak_f32))
#define PVID_SNAPSHOT_WEAK_ANGLE_F32 PVID_SNAPSHOT_BYTES(sizeof(pvid_weak_f32) + sizeof(pvid_weak_angle_f32))

/* Writes a snapshot of `self` to image[] and returns its length [bytes], or 0 with nothing written iff it does not fit
 * into `room` [bytes] or `self` is not initialised. config: the configuration that `self` was initialised with. Cost: a
 * copy and a checksum of the object and a hash of the tables, as long as some ticks: call it where a tick can wait. */
size_t pvid_snapshot_save_strong_f32(const pvid_strong_f32 *self, const pvid_strong_config_f32 *config,
                                     uint32_t generation, uint8_t image[], size_t room);
/* PVID_SNAPSHOT_WEAK_ANGLE_F32 where the angle's storage is in use, else PVID_SNAPSHOT_WEAK_F32. */
size_t pvid_snapshot_save_weak_f32(const pvid_weak_f32 *self, const pvid_weak_config_f32 *config, uint32_t generation,
                                   uint8_t image[], size_t room);

/* Restores `self`, which has been initialised with config, from the snapshot at image[0 .. length - 1] (it may be
 * followed by anything). Whatever the answer but PVID_SNAPSHOT_RESTORED, `self` is left as it was. */
pvid_snapshot_status pvid_snapshot_restore_strong_f32(pvid_strong_f32 *self, const pvid_strong_config_f32 *config,
                                                      const uint8_t image[], size_t length);
pvid_snapshot_status pvid_snapshot_restore_weak_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config,
                                                    const uint8_t image[], size_t length);

#ifdef __cplusplus
}
#endif

#endif
