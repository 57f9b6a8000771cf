#include "number/fingerprint_numbers_q31.h"

#include "pvid/fnv_word.h"

uint32_t pvid_fingerprint_words(uint32_t hash, const int32_t values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, (uint32_t)values[i]);
    }
    return running;
}

uint32_t pvid_fingerprint_formats(uint32_t hash, const int8_t values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, (uint32_t)(int32_t)values[i]);
    }
    return running;
}

uint32_t pvid_fingerprint_table(uint32_t hash, const PVID_TABLE int32_t *values, size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, (uint32_t)values[i]);
    }
    return running;
}
