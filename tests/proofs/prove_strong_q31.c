/* The strong form's identifier: any configuration; any tick on top of any state: any bank's derivatives, any estimator,
 * gate and drive. */
#include "prove.h"

#include "contracts.h"
#include "strong_contracts.h"
#include "pvid/strong_q31.h"

/* Its branch by the upper word is shown in integer_q31: the bound of the result is a relation between two words. */
/*@ requires -0x4000000000000000 <= x <= 0x4000000000000000 && shift <= 62 && 29 <= bits <= 30;
    requires \initialized(out) && *out == 0;
    assigns \result, *out \from x, shift, bits;
    ensures \result == 0 || \result == 1;
    ensures \initialized(out) && -0x40000000 <= *out <= 0x3FFFFFFF; */
static bool acceleration(int64_t x, uint32_t shift, uint32_t bits, int32_t *out);

#include "../../firmware/models/kapitza/strong_q31.c"

#define ONE_Q30 ((int32_t)1 << 30)

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
    for (size_t k = 0; k < PVID_ORDERS; k++) {
        row->phi_shift[k] = (int8_t)any_i32(-31, 31);
    }
    row->finer[0] = (int8_t)any_i32(-31, 31);
    row->finer[1] = (int8_t)any_i32(-31, 31);
    row->phi3 = any_i32(1, INT32_MAX);
    row->reference = any_i32(0, PVID_KAPITZA_RATE_LIMIT_Q31);
}

static void any_p(pvid_kapitza_estimator_q31 *estimator)
{
    Frama_C_make_unknown((char *)estimator, sizeof *estimator);
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        estimator->p[a] = any_i32(1, INT32_MAX);
    }
    estimator->reference = any_i32(0, 2 * PVID_KAPITZA_RATE_LIMIT_Q31);
    estimator->bits[0] = (int8_t)any_i32(0, 60);
    estimator->bits[1] = (int8_t)any_i32(0, 60);
    estimator->ready = true;
}

static void any_tick(void)
{
    any_p(&identifier.estimator);
    identifier.differentiator.bank.phi_max = any_i32(1, PVID_COUNTS_LIMIT_Q31);
    identifier.differentiator.bank.y_max = any_i32(1, PVID_COUNTS_LIMIT_Q31);
    identifier.differentiator.length = (uint16_t)any_u32(5, PVID_MAX_WINDOW);
    any_row_format(&identifier.row);
    for (size_t k = 0; k < PVID_Y_ORDERS_Q31; k++) {
        identifier.u_multiplier[k] = any_i32(1, INT32_MAX);
        identifier.u_shift[k] = any_shift();
    }
    identifier.phi_offset = any_i32(INT32_MIN, INT32_MAX);
    identifier.y_offset = any_i32(INT32_MIN, INT32_MAX);
    identifier.drive = any_i64(-DRIVE_MAX, DRIVE_MAX);
    identifier.drive_min = any_i64(0, DRIVE_MAX);
    identifier.drive_forgetting = any_i32(0, INT32_MAX);
    identifier.gate.limit.m = any_i32(0, ONE_Q30);
    identifier.gate.scale.m = any_i32(-ONE_Q30, ONE_Q30);
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
