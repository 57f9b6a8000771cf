/* finish_q31.c: every stage of a window, at every index, for designs with 4 and with all functions and any Gram tables
 * that init accepts; on any state that earlier stages can leave, with window sums as window_q31.c leaves them. The
 * estimator, the gate and the verdict are replaced by their contracts (estimator_contracts.h). */
#include "prove.h"

#include "contracts.h"
#include "estimator_contracts.h"
#include "weak_design.h"

#include "weak/finish_q31.c" /* its stages, by name */

static pvid_weak_finish_q31 finish;
static pvid_estimator_q31 estimator;
static pvid_trust_q31 trust;
static int32_t sums[PVID_MAX_FUNCTIONS][PVID_WEAK_TERMS_Q31];
static int32_t gram[(PVID_WEAK_GRAMS / 2) * PVID_MAX_FUNCTIONS * (PVID_MAX_FUNCTIONS + 1)];

static pvid_scaled_q31 any_scaled(int32_t lowest)
{
    const pvid_scaled_q31 result = {any_i32(lowest, PVID_ONE_Q30), any_i32(-2000, 2000)};
    return result;
}

static void any_estimator(void)
{
    for (size_t i = 0; i < PVID_MAX_THETA_Q31; i++) {
        estimator.theta[i] = any_i64(-((int64_t)1 << 60), (int64_t)1 << 60);
        estimator.theta_bits[i] = (int16_t)any_i32(-1000, 1000);
        estimator.align[i] = (int16_t)any_i32(-1000, 1000);
    }
    estimator.model = any_bool() ? &pvid_kapitza_weak_q31 : &pvid_kapitza_weak_zeroed_q31;
    estimator.settings.row_sd = any_i32(1, INT32_MAX);
    estimator.counters.rejected_outlier = any_u32(0, UINT32_MAX);
}

/* What one stage may leave for another. */
static void any_state(void)
{
    for (size_t i = 0; i < PVID_WEAK_GRAMS; i++) {
        finish.combination[i] = any_i32(-PVID_ONE_Q30 / 2, PVID_ONE_Q30 / 2);
    }
    for (size_t k = 0; k < PVID_MAX_FUNCTIONS; k++) {
        finish.exponent[k] = (int16_t)any_i32(-15, 17);
        finish.inverse[k].m = any_i32(PVID_ONE_Q30 - 1, INT32_MAX);
        finish.inverse[k].k = (uint8_t)any_u32(0, 30);
        finish.inverted[k] = any_i32(-INVERSE_LIMIT, INVERSE_LIMIT);
        finish.direction[k] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
    }
    for (size_t i = 0; i < PVID_WEAK_FACTOR_Q31; i++) {
        finish.factor[i] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
    }
    for (size_t i = 0; i < PVID_NOISE_TRACES_Q31; i++) {
        finish.trace[i] = any_scaled(-PVID_ONE_Q30);
    }
    finish.gram_bits = (int16_t)(2 * any_i32(-2000, 2000));
    finish.inverted_exponent = (int16_t)any_i32(-300, 300);
    finish.length.m = any_i32(0, INT32_MAX);
    finish.length.k = (uint8_t)any_u32(0, 30);
    finish.whitened = any_bool();
    finish.saturated = any_bool();
    finish.rss = any_i64(0, PVID_WIDE);
    finish.size = any_i64(0, PVID_WIDE);
    finish.expected = any_scaled(1);
    finish.fade_factor = any_i32(0, INT32_MAX);
    finish.gate.limit = any_scaled(0);
}

static void any_columns(int32_t limit)
{
    for (size_t k = 0; k < PVID_MAX_FUNCTIONS; k++) {
        for (size_t i = 0; i < PVID_WEAK_TERMS_Q31; i++) {
            sums[k][i] = any_i32(-limit, limit);
        }
    }
}

static void any_sums(void)
{
    for (size_t i = 0; i < PVID_WEAK_TERMS_Q31; i++) {
        for (size_t k = 0; k < PVID_MAX_FUNCTIONS; k++) {
            sums[k][i] = any_i32(-largest_sum[i], largest_sum[i]);
        }
    }
}

static void step(const pvid_weak_design_q31 *design)
{
    pvid_reason reason = PVID_ACCUMULATED;
    pvid_weak_finish_step_q31(&finish, design, 3, sums, &estimator, &trust, &reason);
}

/* One step of a stage at each index. */
static void any_stage(const pvid_weak_design_q31 *design, uint8_t stage, size_t all)
{
    for (size_t index = 0; index < all; index++) {
        finish.stage = stage;
        finish.index = (uint8_t)index;
        finish.iteration = 0;
        step(design);
    }
}

/* A stage that takes some functions at a time, from the first to the last. */
static void whole_stage(const pvid_weak_design_q31 *design, uint8_t stage)
{
    finish.stage = stage;
    finish.index = 0;
    while (finish.stage == stage) {
        step(design);
    }
}

static void any_window(const pvid_weak_design_q31 *design)
{
    const size_t functions = design->functions;
    pvid_weak_finish_begin_q31(&finish, design, &estimator, any_scaled(0));
    for (size_t i = 0; i < PVID_WEAK_GRAMS; i++) {
        /*@ assert -0x20000000 <= finish.combination[i] <= 0x20000000; */
    }
    /*@ assert finish.expected.m >= 1; */
    any_state();
    any_stage(design, STAGE_COMBINE, functions);
    any_sums();
    whole_stage(design, STAGE_ASSEMBLE);
    for (size_t k = 0; k < functions; k++) {
        for (size_t i = 0; i < PVID_WEAK_COLUMNS_Q31; i++) {
            /*@ assert -0x40000000 <= sums[k][i] <= 0x40000000; */
        }
    }
    any_stage(design, STAGE_FACTOR, parts_of_triangle(functions, FACTOR_PARTS));
    any_state();
    any_stage(design, STAGE_TRACE, 1);
    any_state();
    finish.whitened = true;
    any_stage(design, STAGE_TRACE, parts_of_triangle(functions, TRACE_PARTS));
    any_columns(PVID_ONE_Q30);
    any_state();
    any_stage(design, STAGE_WHITEN, parts_of_triangle(functions, WHITEN_PARTS));
    any_columns(COLUMN_LIMIT);
    for (uint8_t stage = STAGE_SQUARE_A; stage < STAGE_NOISE; stage++) {
        any_state();
        whole_stage(design, stage);
    }
    any_state();
    any_stage(design, STAGE_NOISE, 1);
    any_stage(design, STAGE_FADE, PVID_INFORMATION_END_PARTS);
    any_stage(design, STAGE_ADD, functions);
    for (uint8_t stage = STAGE_SOLVE; stage <= STAGE_IDLE; stage++) {
        any_state();
        any_stage(design, stage, 1);
    }
}

void main(void)
{
    for (size_t i = 0; i < sizeof gram / sizeof gram[0]; i++) {
        gram[i] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
    }
    any_estimator();
    pvid_weak_design_q31 design = weak_unit_design;
    design.gram = gram;
    for (size_t i = 0; i < PVID_WEAK_GRAMS; i++) {
        design.gram_bits[i] = (int8_t)any_i32(-128, 127);
    }
    design.functions = 4;
    any_window(&design);
    design.functions = PVID_MAX_FUNCTIONS;
    any_window(&design);
}
