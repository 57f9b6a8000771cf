/* The seal of a snapshot, whatever it is of. Private to the core. */
#ifndef PVID_SNAPSHOT_SEAL_H
#define PVID_SNAPSHOT_SEAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "pvid/snapshot.h"

typedef enum {
    PVID_SNAPSHOT_KIND_STRONG_F32 = 1,
    PVID_SNAPSHOT_KIND_WEAK_F32 = 2,
    PVID_SNAPSHOT_KIND_WEAK_Q31 = 3
} pvid_snapshot_kind;

/* What a snapshot must be of to be restored. */
typedef struct {
    pvid_snapshot_kind kind;
    uint32_t layout; /* hash of sizes and places */
    uint32_t config; /* hash of the configuration */
    size_t bytes;    /* of the object */
} pvid_snapshot_identity;

/* Seals the object whose bytes stand at PVID_SNAPSHOT_HEADER; returns the length of the whole. */
size_t pvid_snapshot_seal(uint8_t image[], const pvid_snapshot_identity *identity, uint32_t generation);

/* Whether image[] holds an undamaged snapshot of this identity. */
pvid_snapshot_status pvid_snapshot_inspect(const uint8_t image[], size_t length,
                                           const pvid_snapshot_identity *identity);

/* Hash of words that say how an object lies in memory, and of the machine's byte order. */
uint32_t pvid_snapshot_layout(const uint32_t words[], size_t n);

/* In the place of a pointer, so that equal states have equal snapshots and no address gets into flash. */
static inline void pvid_snapshot_put_pointer(uint8_t object[], size_t place, const void *pointer)
{
    memset(&object[place], 0, sizeof pointer);
    object[place] = (pointer != NULL) ? 1u : 0u;
}

static inline bool pvid_snapshot_had_pointer(const uint8_t object[], size_t place)
{
    return object[place] != 0u;
}

#endif
