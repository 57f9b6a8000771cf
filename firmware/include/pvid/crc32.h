/* pvid/crc32.h - the checksum of frames and of saved states: CRC-32 as zlib's (polynomial 0xEDB88320). */
#ifndef PVID_CRC32_H
#define PVID_CRC32_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* crc continued over n bytes; the first call continues 0. A table of 64 bytes, two look-ups a byte. */
uint32_t pvid_crc32(uint32_t crc, const uint8_t bytes[], size_t n);

#ifdef __cplusplus
}
#endif

#endif
