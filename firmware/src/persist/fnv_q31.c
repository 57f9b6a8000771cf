#include "pvid/fnv_q31.h"

#include <stddef.h>

uint32_t pvid_fnv_estimator_q31(uint32_t hash, const pvid_estimator_q31 *estimator, pvid_reason reason)
{
    const pvid_information_q31 *information = &estimator->information;
    uint32_t running = hash;
    for (size_t a = 0; a < estimator->model->n_p; a++) {
        running = pvid_fnv_word(running, (uint32_t)estimator->p[a]);
    }
    for (size_t i = 0; i < information->n_sums; i++) {
        const uint64_t sum = (uint64_t)information->sums[i];
        running = pvid_fnv_word(running, (uint32_t)(sum & 0xFFFFFFFFu));
        running = pvid_fnv_word(running, (uint32_t)(sum >> 32));
    }
    running = pvid_fnv_word(running, information->exponent);
    return pvid_fnv_word(running, (uint32_t)reason);
}
