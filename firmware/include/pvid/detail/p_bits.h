/* pvid/detail/p_bits.h - a bit for each parameter, and places of d theta / d p. Not API. */
#ifndef PVID_DETAIL_P_BITS_H
#define PVID_DETAIL_P_BITS_H

#include <stdint.h>

#include "pvid/config.h"

#if PVID_MAX_P > 8
typedef uint16_t pvid_p_bits;
#define PVID_P_ALL 0xFFFFu
#else
typedef uint8_t pvid_p_bits;
#define PVID_P_ALL 0xFFu
#endif

/* Largest number of non-zeros of d theta / d p: places of them are of 8 bits. */
#if (PVID_MAX_THETA * PVID_MAX_P) > 255
#define PVID_MAX_C 255
#else
#define PVID_MAX_C (PVID_MAX_THETA * PVID_MAX_P)
#endif

#endif
