/* Common part of all snapshots: the copy without its pointers, and the seal. Private to the core. */
#ifndef PVID_SNAPSHOT_SEAL_H
#define PVID_SNAPSHOT_SEAL_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/snapshot_slots.h"

typedef enum {
    /* 1 to 4 were identifiers of the pendulum alone */
    PVID_SNAPSHOT_KIND_WEAK_F32 = 5,
    PVID_SNAPSHOT_KIND_WEAK_Q31 = 6,
    PVID_SNAPSHOT_KIND_REFINE_F32 = 7
} pvid_snapshot_kind;

/* Identity of a snapshot: only a snapshot with the same identity is restored. */
typedef struct {
    pvid_snapshot_kind kind;
    uint32_t layout; /* hash of sizes and places */
    uint32_t model;  /* hash of the compiled model */
    uint32_t design; /* hash of the design's tables */
    uint32_t config; /* hash of the configuration */
    size_t bytes;    /* of the object and of the memory saved after it */
} pvid_snapshot_identity;

/* A pointer in an object. One into the object itself is NULL or points to `target`; any other keeps the value of init.
 */
typedef struct {
    uint32_t place;  /* offset in the object */
    uint32_t target; /* offset that it points to, or PVID_SNAPSHOT_OF_INIT */
} pvid_snapshot_pointer;

#define PVID_SNAPSHOT_OF_INIT UINT32_MAX

/* Size of an object, and its pointers by ascending places. */
typedef struct {
    size_t bytes;
    const pvid_snapshot_pointer *pointers; /* [n_pointers] */
    size_t n_pointers;
} pvid_snapshot_shape;

/* Writes a snapshot of an object and of the identity->bytes - shape->bytes bytes at `behind` (NULL: none); returns
 * its length. Fails (returns 0, writes nothing) iff it does not fit into `room`. */
size_t pvid_snapshot_save(uint8_t image[], size_t room, const pvid_snapshot_identity *identity, uint32_t generation,
                          const void *object, const pvid_snapshot_shape *shape, const void *behind);

/* Restores both if image[] contains an undamaged snapshot of this identity. */
pvid_snapshot_status pvid_snapshot_restore(const uint8_t image[], size_t length, const pvid_snapshot_identity *identity,
                                           uint8_t object[], const pvid_snapshot_shape *shape, void *behind);

/* Hash of words that describe the object's layout, and of the machine's byte order. */
uint32_t pvid_snapshot_layout(const uint32_t words[], size_t n);

#endif
