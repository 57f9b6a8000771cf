#include "number/uncontracted.h"

#include "pvid/fnv.h"

#include <stddef.h>

#include "number/finite_f32.h"

uint32_t pvid_fnv_estimator_f32(uint32_t hash, const pvid_estimator_f32 *estimator, pvid_reason reason)
{
    const pvid_model_f32 *model = estimator->model;
    const uint16_t n = (uint16_t)(model->n_moments + model->n_theta + 2u);
    float sums[PVID_MAX_SUMS];
    for (size_t i = 0; i < model->n_p; i++) {
        hash = pvid_fnv_word(hash, pvid_bits_f32(estimator->p[i]));
    }
    pvid_information_read_f32(&estimator->information, sums);
    for (size_t i = 0; i < n; i++) {
        hash = pvid_fnv_word(hash, pvid_bits_f32(sums[i]));
    }
    return pvid_fnv_word(hash, (uint32_t)reason);
}
