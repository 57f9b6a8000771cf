#include "number/uncontracted.h"

#include "pvid/fnv_refine.h"

#include <stddef.h>

#include "number/finite_f32.h"

#define NOT_FINITE 0x7FC00000u

static uint32_t add(uint32_t hash, const float values[], size_t n)
{
    uint32_t sum = hash;
    for (size_t i = 0; i < n; i++) {
        sum = pvid_fnv_word(sum, pvid_finite_f32(values[i]) ? pvid_bits_f32(values[i]) : NOT_FINITE);
    }
    return sum;
}

uint32_t pvid_fnv_refine_f32(uint32_t hash, const pvid_refine_f32 *refinement, pvid_reason reason)
{
    uint32_t sum = add(hash, refinement->linear, PVID_REFINE_PARAMETERS);
    sum = add(sum, refinement->work.state, PVID_REFINE_STATES);
    sum = add(sum, &refinement->level, 1);
    return pvid_fnv_word(sum, (uint32_t)reason);
}
