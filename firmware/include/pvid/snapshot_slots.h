/* pvid/snapshot_slots.h - saves an identifier's state and restores it after a power cut, bit for bit.
 *
 * A snapshot is the identifier's memory with a header, a generation and a checksum. restore refuses a snapshot
 * that is damaged, truncated or from another identifier, and then changes nothing. This header has what the snapshots
 * of all identifiers have in common; the functions are in snapshot_weak.h, snapshot_weak_q31.h and snapshot_refine.h.
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
 * Two slots. The slot to write is never that of the newest valid snapshot; a power cut at any byte of a write
 * leaves that one valid. The caller writes the bytes to flash, in any order.
 *
 * A snapshot is valid for the same build (release, sizes, byte order, width of pointers: all in `layout`), the
 * same form and core, the same model, design, configuration and tables. Pointers are not saved: they keep the values of
 * init. The checksum detects accidents, not attacks. Not thread-safe: no tick during these functions.
 *
 * Layout of a snapshot, all numbers little-endian:
 *    0 magic "PVSS"   4 bytes in all   8 version, that of the library   12 kind   16 layout   20 model   24 design
 *   28 configuration   32 generation   36 the object's bytes, its pointers as 0 (NULL) or 1   and last CRC-32 of all
 *   before it
 */
#ifndef PVID_SNAPSHOT_SLOTS_H
#define PVID_SNAPSHOT_SLOTS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Result of a restore. */
typedef enum {
    PVID_SNAPSHOT_RESTORED = 0,
    PVID_SNAPSHOT_NONE,          /* no snapshot begins here */
    PVID_SNAPSHOT_CUT_SHORT,     /* fewer bytes than its header states */
    PVID_SNAPSHOT_DAMAGED,       /* the checksum is wrong */
    PVID_SNAPSHOT_OTHER_VERSION, /* of another release */
    PVID_SNAPSHOT_OTHER_KIND,    /* of another form or core */
    PVID_SNAPSHOT_OTHER_LAYOUT,  /* of a build with other sizes, pointers or byte order */
    PVID_SNAPSHOT_OTHER_CONFIG,  /* of another configuration, or of other tables */
    PVID_SNAPSHOT_NOT_READY,     /* the identifier was not initialised with config, or a pointer is NULL */
    PVID_SNAPSHOT_OTHER_MODEL,   /* of another compiled model */
    PVID_SNAPSHOT_OTHER_DESIGN   /* of another design: sizes, filters, tables */
} pvid_snapshot_status;

#define PVID_SNAPSHOT_HEADER 36u

/* Size of a snapshot [bytes]: the upper limit of its kind. */
#define PVID_SNAPSHOT_BYTES(object) (PVID_SNAPSHOT_HEADER + (object) + 4u)

/* Which of two slots to read and which to write. */
typedef struct {
    int8_t newest;       /* slot of the newest valid snapshot, 0 or 1; -1: there is none */
    uint8_t next;        /* slot to write to */
    uint32_t generation; /* for the next snapshot */
} pvid_snapshot_choice;

/* Compares two slots of `size` bytes each. A slot is valid if it is complete and undamaged; restore checks whose
 * it is. Generations are compared modulo 2^32. Cost: the checksums of both. */
pvid_snapshot_choice pvid_snapshot_choose(const uint8_t slot_0[], const uint8_t slot_1[], size_t size);

#ifdef __cplusplus
}
#endif

#endif
