#include "number/uncontracted.h"

#include <stddef.h>

#include "number/finite_f32.h"
#include "pvid/fnv_word.h"
#include "pvid/strong.h"

uint32_t pvid_fnv_strong_f32(uint32_t hash, const pvid_strong_estimator_f32 *estimator, pvid_reason reason)
{
    uint32_t running = hash;
    for (size_t i = 0; i < PVID_KAPITZA_P; i++) {
        running = pvid_fnv_word(running, pvid_bits_f32(estimator->p[i]));
    }
    for (size_t i = 0; i < PVID_STRONG_SUMS; i++) {
        running = pvid_fnv_word(running, pvid_bits_f32(estimator->sums.high[i] + estimator->sums.low[i]));
    }
    return pvid_fnv_word(running, (uint32_t)reason);
}
