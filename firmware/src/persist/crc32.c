#include "pvid/crc32.h"

/* CRC of the sixteen values of half a byte; polynomial 0xEDB88320. */
static const uint32_t crc_of_nibble[16] = {
    0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u, 0x4DB26158u, 0x5005713Cu,
    0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu, 0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu,
};

uint32_t pvid_crc32(uint32_t crc, const uint8_t bytes[], size_t n)
{
    uint32_t rest = ~crc;
    for (size_t i = 0; i < n; i++) {
        rest ^= bytes[i];
        rest = (rest >> 4) ^ crc_of_nibble[rest & 0xFu];
        rest = (rest >> 4) ^ crc_of_nibble[rest & 0xFu];
    }
    return ~rest;
}
