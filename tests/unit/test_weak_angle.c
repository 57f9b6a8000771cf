/* What the linear rows lack: off it changes nothing, on it is what the exact equations say. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pvid/pvid.h"
#include "full_angle_f32.h"
#include "weak_table.h"

static pvid_weak_angle_f32 angle;
static float columns[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
static const float theta[PVID_KAPITZA_WEAK_THETA];
static const float pendulum[6] = {31.6666667f, 8.875f, 5.625f, 0.0f, 0.0f, 0.0f};

static pvid_weak_config_f32 config_of(bool friction)
{
    const pvid_weak_config_f32 config = {
        .sample_rate_hz = (float)TABLE_RATE,
        .l1 = 0.3f,
        .design = &table_design,
        .angle = &angle,
        .full_angle = true,
        .friction = friction,
        .passes = 3,
        .zero_unknown = true,
        .iterations = 3,
    };
    return config;
}

/* A window of still samples at `phi`. */
static void fill(float phi)
{
    for (int i = 0; i < 2 * TABLE_WINDOW; i++) {
        pvid_weak_angle_add_sample_f32(&angle, phi, 0.0f);
    }
    for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
        for (size_t i = 0; i < PVID_WEAK_TERMS; i++) {
            columns[k][i] = (i == PVID_WEAK_COLUMN_Y) ? 0.0f : (float)(1u + (((k * 7u) + (i * 5u)) % 11u));
        }
    }
}

static uint32_t work_off(const float p[])
{
    uint32_t stages = 1;
    pvid_weak_angle_begin_f32(&angle, p);
    while (!pvid_weak_angle_step_f32(&angle, &table_design, theta, columns)) {
        stages++;
        assert_true(stages < 10000u);
    }
    return stages;
}

static void off_it_changes_nothing_but_the_columns_of_friction(void **state)
{
    (void)state;
    const pvid_weak_config_f32 config = config_of(true);
    pvid_weak_angle_init_f32(&angle, &config);
    fill(0.1f);
    float before[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    memcpy(before, columns, sizeof before);
    assert_int_equal(work_off(pendulum), pvid_weak_angle_stages_f32(&angle, &table_design));
    for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
        assert_memory_equal(columns[k], before[k], PVID_WEAK_COLUMN_C1 * sizeof(float));
        assert_true(columns[k][PVID_WEAK_COLUMN_C1] >= 0.0f && columns[k][PVID_WEAK_COLUMN_C1] <= 0.0f);
        assert_true(columns[k][PVID_WEAK_COLUMN_C2] >= 0.0f && columns[k][PVID_WEAK_COLUMN_C2] <= 0.0f);
    }
}

static void on_it_changes_y_alone(void **state)
{
    (void)state;
    pvid_weak_config_f32 config = config_of(false);
    config.passes = 1; /* the passes converge for a window that a pendulum made, and this is none */
    pvid_weak_angle_init_f32(&angle, &config);
    angle.on = true;
    fill(0.01f);
    float before[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    memcpy(before, columns, sizeof before);
    (void)work_off(pendulum);
    bool changed = false;
    for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
        assert_memory_equal(columns[k], before[k], PVID_WEAK_COLUMN_Y * sizeof(float));
        changed = changed || (memcmp(&columns[k][8], &before[k][8], sizeof(float)) != 0);
    }
    assert_true(changed);
}

static void unphysical_or_nan_p_is_not_corrected(void **state)
{
    (void)state;
    const pvid_weak_config_f32 config = config_of(true);
    const float thin[6] = {30.0f, 6.0f, 4.99f, 0.0f, 0.0f, 0.0f}; /* L2 = 0.01 */
    for (int i = 0; i < 2; i++) {
        pvid_weak_angle_init_f32(&angle, &config);
        angle.on = true;
        fill((i == 0) ? 0.1f : 1.0e18f);
        float before[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
        memcpy(before, columns, sizeof before);
        (void)work_off((i == 0) ? thin : pendulum);
        for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
            assert_memory_equal(columns[k], before[k], PVID_WEAK_COLUMN_C1 * sizeof(float));
        }
    }
}

static void correction_waits_for_a_converged_estimate(void **state)
{
    (void)state;
    const pvid_weak_config_f32 config = config_of(false);
    pvid_weak_angle_init_f32(&angle, &config);
    fill(0.1f);
    (void)work_off(pendulum);
    const float moved[6] = {31.6666667f * 1.03f, 8.875f, 5.625f, 0.0f, 0.0f, 0.0f};
    assert_false(pvid_weak_angle_switch_f32(&angle, pendulum, 0.01f, 3)); /* too few windows */
    assert_false(pvid_weak_angle_switch_f32(&angle, moved, 0.01f, 4));    /* still on its way */
    assert_false(pvid_weak_angle_switch_f32(&angle, pendulum, 0.06f, 4)); /* too wide */
    assert_false(pvid_weak_angle_switch_f32(&angle, pendulum, NAN, 4));
    assert_false(angle.on);
    assert_true(pvid_weak_angle_switch_f32(&angle, pendulum, 0.01f, 4));
    assert_true(angle.on);
    assert_false(pvid_weak_angle_switch_f32(&angle, pendulum, 0.01f, 5)); /* it was before */
    assert_false(pvid_weak_angle_switch_f32(&angle, moved, 0.19f, 100));
    assert_true(angle.on);
    assert_false(pvid_weak_angle_switch_f32(&angle, pendulum, 0.21f, 100)); /* lost */
    assert_false(angle.on);
}

static int prepare(void **state)
{
    (void)state;
    make_table();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(off_it_changes_nothing_but_the_columns_of_friction),
        cmocka_unit_test(on_it_changes_y_alone),
        cmocka_unit_test(unphysical_or_nan_p_is_not_corrected),
        cmocka_unit_test(correction_waits_for_a_converged_estimate),
    };
    return cmocka_run_group_tests(tests, prepare, NULL);
}
