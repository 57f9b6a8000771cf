/* pvid/snapshot_slots.h - results, size and slots of snapshots, for every identifier. Usage: snapshot.h. */
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
