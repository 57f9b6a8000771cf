#include "number/uncontracted.h"

#include "persist/fingerprint_f32.h"

#include <stddef.h>

#include "judge/gate_f32.h"
#include "number/fingerprint_numbers_f32.h"
#include "solve/settings_f32.h"
#include "pvid/fnv_word.h"

uint32_t pvid_fingerprint_strong_f32(const pvid_strong_config_f32 *config)
{
    uint32_t hash = pvid_fingerprint_float(PVID_FNV_START, config->sample_rate_hz);
    hash = pvid_fingerprint_float(hash, config->l1);
    hash = pvid_fingerprint_float(hash, config->drive_min);
    hash = pvid_fnv_word(hash, config->bank.half);
    hash = pvid_fnv_word(hash, config->bank.stride);
    hash = pvid_fnv_word(hash, config->bank.block);
    hash = pvid_fingerprint_floats(hash, config->bank.weights, (size_t)PVID_ORDERS * config->bank.half);
    hash = pvid_fingerprint_gate_f32(hash, &config->gate);
    hash = pvid_fingerprint_float(hash, config->estimator.correlation);
    hash = pvid_fingerprint_float(hash, config->estimator.row_weight);
    hash = pvid_fnv_word(hash, config->exact_every);
    return pvid_fingerprint_estimator_f32(hash, &config->estimator, PVID_KAPITZA_P);
}
