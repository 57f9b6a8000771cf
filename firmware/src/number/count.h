/* Counters that stop at their end. Private to the core. */
#ifndef PVID_COUNT_H
#define PVID_COUNT_H

#include <stdint.h>

static inline void pvid_count_up(uint32_t *counter)
{
    const uint32_t next = *counter + 1u;
    if (next != 0u) {
        *counter = next;
    }
}

static inline void pvid_count_up_16(uint16_t *counter)
{
    if (*counter < UINT16_MAX) {
        (*counter)++;
    }
}

#endif
