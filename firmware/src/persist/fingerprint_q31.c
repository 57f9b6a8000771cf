#include "persist/fingerprint_q31.h"

#include <stddef.h>

#include "judge/gate_q31.h"
#include "number/fingerprint_numbers_q31.h"
#include "solve/settings_q31.h"
#include "persist/fingerprint_tables.h"
#include "pvid/fnv_word.h"

static uint32_t bank_of(uint32_t hash, const pvid_fir_bank_q31 *bank)
{
    const int32_t limits[] = {bank->phi_max, bank->y_max, bank->centre};
    uint32_t running = pvid_fnv_word(hash, bank->half);
    running = pvid_fnv_word(running, bank->stride);
    running = pvid_fnv_word(running, bank->block);
    running = pvid_fingerprint_words(running, limits, sizeof limits / sizeof limits[0]);
    running = pvid_fingerprint_bytes(running, bank->phi_shift, sizeof bank->phi_shift);
    running = pvid_fingerprint_bytes(running, bank->y_shift, sizeof bank->y_shift);
    return pvid_fingerprint_table(running, bank->weights, (size_t)PVID_ORDERS * bank->half);
}

static uint32_t row_of(uint32_t hash, const pvid_strong_row_q31 *row)
{
    const uint32_t running = pvid_fingerprint_formats(hash, row->phi_shift, sizeof row->phi_shift);
    const int32_t single[] = {row->phi3, row->reference};
    return pvid_fingerprint_words(pvid_fingerprint_formats(running, row->finer, sizeof row->finer), single,
                                  sizeof single / sizeof single[0]);
}

uint32_t pvid_fingerprint_strong_q31(const pvid_strong_config_q31 *config)
{
    const int32_t scalars[] = {config->phi_offset, config->y_offset, config->drive_min};
    uint32_t hash = pvid_fingerprint_words(PVID_FNV_START, scalars, sizeof scalars / sizeof scalars[0]);
    hash = pvid_fingerprint_words(hash, config->u_multiplier, PVID_Y_ORDERS_Q31);
    hash = bank_of(hash, &config->bank);
    hash = row_of(hash, &config->row);
    hash = pvid_fingerprint_bytes(hash, config->u_shift, sizeof config->u_shift);
    hash = pvid_fnv_word(hash, config->drive_ticks);
    hash = pvid_fingerprint_gate_q31(hash, &config->gate);
    return pvid_fingerprint_estimator_q31(hash, &config->estimator, 0, PVID_KAPITZA_P);
}
