/* The window of a bank of derivative filters, for both cores. Private to the core. */
#ifndef PVID_FIR_WINDOW_H
#define PVID_FIR_WINDOW_H

#include <stdint.h>

#include "pvid/config.h"
#include "pvid/status.h"

/* Checks a bank's window, 2 half stride + 1 samples: the status names the field that makes it too short or too
 * long. */
static inline pvid_status pvid_fir_window(uint16_t half, uint16_t stride)
{
    if ((half < 2u) || (half > ((PVID_MAX_WINDOW - 1u) / 2u))) {
        return PVID_BAD_HALF;
    }
    if ((stride < 1u) || (((2u * (uint32_t)half * stride) + 1u) > PVID_MAX_WINDOW)) {
        return PVID_BAD_STRIDE;
    }
    return PVID_OK;
}

#endif
