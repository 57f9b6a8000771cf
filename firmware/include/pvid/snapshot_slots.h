/* pvid/snapshot_slots.h - what snapshots of every identifier share: their answers, their size, the choice of a slot.
 *
 * snapshot.h explains their use. */
#ifndef PVID_SNAPSHOT_SLOTS_H
#define PVID_SNAPSHOT_SLOTS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Whether a snapshot could be restored, and why not. */
typedef enum {
    PVID_SNAPSHOT_RESTORED = 0,
    PVID_SNAPSHOT_NONE,          /* no snapshot begins here */
    PVID_SNAPSHOT_CUT_SHORT,     /* fewer bytes than its header states */
    PVID_SNAPSHOT_DAMAGED,       /* the checksum is wrong */
    PVID_SNAPSHOT_OTHER_VERSION, /* of another release */
    PVID_SNAPSHOT_OTHER_KIND,    /* of another form or core */
    PVID_SNAPSHOT_OTHER_LAYOUT,  /* of a build with other sizes, pointers or byte order */
    PVID_SNAPSHOT_OTHER_CONFIG,  /* of another configuration, or of other tables */
    PVID_SNAPSHOT_NOT_READY      /* the identifier was not initialised with config, or a pointer is NULL */
} pvid_snapshot_status;

#define PVID_SNAPSHOT_HEADER 28u

/* Bytes of a snapshot: room that is always enough for one of that kind. */
#define PVID_SNAPSHOT_BYTES(object) (PVID_SNAPSHOT_HEADER + (object) + 4u)

/* Which of two slots to read and which to write. */
typedef struct {
    int8_t newest;       /* slot of the newest valid snapshot, 0 or 1; -1: there is none */
    uint8_t next;        /* slot to write to */
    uint32_t generation; /* for the next snapshot */
} pvid_snapshot_choice;

/* Looks at two slots of `size` bytes each. Valid: whole and undamaged; of whose identifier, restore asks. Generations
 * are compared modulo 2^32. Costs the checksums of both. */
pvid_snapshot_choice pvid_snapshot_choose(const uint8_t slot_0[], const uint8_t slot_1[], size_t size);

#ifdef __cplusplus
}
#endif

#endif
