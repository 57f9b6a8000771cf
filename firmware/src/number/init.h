/* The frame of every init: both pointers given, else misuse; after a refusal the object is all zeros, which is not
 * ready. Private to the core, inlined. */
#ifndef PVID_INIT_H
#define PVID_INIT_H

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "pvid/config.h"
#include "pvid/status.h"

/* Returns whether the object and its configuration are given. */
static inline bool pvid_init_is_given(const void *self, const void *config)
{
    const bool given = (self != NULL) && (config != NULL);
    PVID_ASSERT(given);
    return given;
}

/* Returns the status of an init, after which the object of that size is ready or all zeros. */
static inline pvid_status pvid_init_end(void *self, size_t size, pvid_status status)
{
    if ((status != PVID_OK) && (self != NULL)) {
        memset(self, 0, size);
    }
    return status;
}

#endif
