#include "number/uncontracted.h"

#include "number/fingerprint_numbers_f32.h"

#include "number/finite_f32.h"
#include "pvid/fnv_word.h"

uint32_t pvid_fingerprint_floats(uint32_t hash, const float values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, pvid_bits_f32(values[i]));
    }
    return running;
}

uint32_t pvid_fingerprint_float(uint32_t hash, float value)
{
    return pvid_fnv_word(hash, pvid_bits_f32(value));
}
