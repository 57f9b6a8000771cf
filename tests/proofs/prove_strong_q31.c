/* The strong form's identifier: any configuration; any tick on top of any state: any bank's derivatives, any estimator,
 * gate and drive. */
#include "any_estimator_q31.h"

#include "contracts.h"
#include "strong_contracts.h"
#include "pvid/strong_q31.h"

#define DRIVE_MAX ((int64_t)1 << 60)

static pvid_strong_q31 identifier; /* zeroed by init */

static void any_configuration(void)
{
    pvid_strong_config_q31 config;
    Frama_C_make_unknown((char *)&config, sizeof config);
    if (pvid_strong_init_q31(&identifier, &config) != PVID_OK) {
        return;
    }
    /*@ assert 0 <= identifier.drive_min && 0 <= identifier.drive_forgetting; */
    /*@ assert 1 <= identifier.gate.memory; */
    /*@ assert -0x40000000 <= identifier.gate.scale.m <= 0x40000000; */
    /*@ assert -2001 <= identifier.gate.scale.e <= 72; */
}

static uint8_t any_shift(void)
{
    return (uint8_t)any_u32(0, 62);
}

static void any_row_format(pvid_strong_row_q31 *row)
{
    row->n_a = any_shift();
    row->n_e = any_shift();
    row->part = any_shift();
    row->y = any_shift();
    for (size_t k = 0; k < 4u; k++) {
        row->n_phi2[k] = any_shift();
    }
    for (size_t k = 0; k < 5u; k++) {
        row->n_phi0[k] = any_shift();
    }
}

static void any_tick(void)
{
    any_state(&pvid_kapitza_strong_q31, &identifier.estimator);
    identifier.differentiator.bank.phi_max = any_i32(1, PVID_COUNTS_LIMIT_Q31);
    identifier.differentiator.bank.y_max = any_i32(1, PVID_COUNTS_LIMIT_Q31);
    identifier.differentiator.length = (uint16_t)any_u32(5, PVID_MAX_WINDOW);
    any_row_format(&identifier.row);
    identifier.u_multiplier = any_i32(1, INT32_MAX);
    identifier.u_shift = any_shift();
    identifier.phi_offset = any_i32(INT32_MIN, INT32_MAX);
    identifier.y_offset = any_i32(INT32_MIN, INT32_MAX);
    identifier.drive = any_i64(-DRIVE_MAX, DRIVE_MAX);
    identifier.drive_min = any_i64(0, DRIVE_MAX);
    identifier.drive_forgetting = any_i32(0, INT32_MAX);
    identifier.gate.limit.m = any_i32(0, PVID_ONE_Q30);
    identifier.gate.scale.m = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
    identifier.gate.scale.e = any_i32(-2001, 72);
    pvid_strong_freeze_q31(&identifier, any_bool());
    (void)pvid_strong_step_q31(&identifier, any_i32(INT32_MIN, INT32_MAX), any_i32(INT32_MIN, INT32_MAX));
    /*@ assert -DRIVE_MAX <= identifier.drive <= DRIVE_MAX; */
    pvid_strong_gap_q31(&identifier);
}

void main(void)
{
    any_configuration();
    any_tick();
}
