#include "pvid/strong_q31.h"

#include <stddef.h>

#include "pvid/fnv_word.h"

uint32_t pvid_fnv_strong_q31(uint32_t hash, const pvid_kapitza_estimator_q31 *estimator, pvid_reason reason)
{
    uint32_t running = hash;
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        running = pvid_fnv_word(running, (uint32_t)estimator->p[a]);
    }
    for (size_t i = 0; i < PVID_KAPITZA_SUMS_Q31; i++) {
        const uint64_t sum = (uint64_t)estimator->sums[i];
        running = pvid_fnv_word(running, (uint32_t)(sum & 0xFFFFFFFFu));
        running = pvid_fnv_word(running, (uint32_t)(sum >> 32));
    }
    running = pvid_fnv_word(running, estimator->exponent);
    return pvid_fnv_word(running, (uint32_t)reason);
}
