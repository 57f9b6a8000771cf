/* pvid/crc32.h - CRC-32 of zlib (polynomial 0xEDB88320), for frames and snapshots. */
#ifndef PVID_CRC32_H
#define PVID_CRC32_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Continues crc over n bytes; start with 0. Table: 64 bytes; cost: two look-ups per byte. */
uint32_t pvid_crc32(uint32_t crc, const uint8_t bytes[], size_t n);

#ifdef __cplusplus
}
#endif

#endif
