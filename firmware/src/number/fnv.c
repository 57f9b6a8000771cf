#include "pvid/fnv_word.h"

#include <stddef.h>

uint32_t pvid_fnv_word(uint32_t hash, uint32_t word)
{
    for (size_t shift = 0; shift < 32u; shift = (uint8_t)(shift + 8u)) {
        hash = (hash ^ ((word >> shift) & 0xFFu)) * 0x01000193u;
    }
    return hash;
}
