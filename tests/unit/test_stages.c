/* The stages that a window's work takes are those that init counts with: the last one ends it, not one before, and
 * none is left when the next window comes. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solve/state_f32.h"
#include "first_order.h"
#include "plant.h"
#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "full_angle_f32.h"
#include "weak/finish_f32.h"
#include "weak/finish_q31.h"
#include "weak_table.h"
#include "weak_table_q31.h"
#include "weak/window_f32.h"
#include "weak/window_q31.h"

static pvid_weak_f32 identifier;
static pvid_weak_angle_f32 angle;
static pvid_weak_config_f32 config;

static int start_again(void **state)
{
    (void)state;
    make_table();
    const float start[4] = {30.0f, 9.0f, 5.5f, 0.0f};
    config = table_config(start);
    config.passes = 2;
    return 0;
}

/* Steps until a window is complete `windows` times, and counts what its work takes, on the identifier itself. */
static uint32_t stages_of_a_window(int windows)
{
    plant_state plant = released_plant();
    assert_int_equal(pvid_weak_init_f32(&identifier, &config), PVID_OK);
    uint32_t stages = 0;
    for (int begun = 0; begun < windows;) {
        double phi;
        double y;
        plant_step(&plant, &phi, &y);
        (void)pvid_weak_step_f32(&identifier, (float)phi, (float)y);
        if (!pvid_weak_finish_is_busy_f32(&identifier.finish)) {
            continue;
        }
        begun++;
        stages = identifier.stages_per_tick; /* of the tick that completed it */
        pvid_reason reason = PVID_ACCUMULATED;
        while (pvid_weak_finish_is_busy_f32(&identifier.finish)) {
            stages++;
            pvid_weak_finish_step_f32(&identifier.finish, config.design, identifier.iterations,
                                      identifier.sums[identifier.finish.buffer], &identifier.estimator,
                                      &identifier.trust, &reason);
        }
    }
    return stages;
}

static void a_window_takes_the_stages_that_init_counts_with(void **state)
{
    (void)state;
    for (uint8_t iterations = 1; iterations <= 3; iterations++) {
        config.iterations = iterations;
        const uint32_t stages = stages_of_a_window(6);
        assert_int_equal(stages, pvid_weak_finish_stages_f32(config.design, iterations, &identifier.estimator, NULL));
    }
    config.full_angle = true;
    config.angle = &angle;
    const uint32_t stages = stages_of_a_window(16);
    assert_true(angle.on);
    assert_int_equal(stages, pvid_weak_finish_stages_f32(config.design, 3, &identifier.estimator, &angle));
}

static void assessment_takes_the_stated_number_of_stages(void **state)
{
    (void)state;
    static pvid_fourier_f32 weak;
    const pvid_fourier_design_f32 design = design_of(&mechanism);
    const pvid_fourier_config_f32 settings = config_of(&design);
    assert_int_equal(pvid_fourier_init_f32(&weak, &settings), PVID_OK);
    first_order rig = {.generator = 1u};
    for (int i = 0; i < 10 * HOP; i++) {
        float sample[2];
        next_sample(&rig, sample);
        (void)pvid_fourier_step_f32(&weak, sample);
    }
    static pvid_estimator_solve_f32 solve;
    pvid_estimate_f32 estimate;
    pvid_estimator_begin_assessment_f32(&weak.estimator, &solve, &estimate);
    uint32_t stages = 1;
    while (!pvid_estimator_assess_advance_f32(&weak.estimator, &solve)) {
        stages++;
    }
    assert_int_equal(stages, pvid_estimator_assessment_stages_f32(&weak.estimator));
    assert_true(pvid_estimator_assess_advance_f32(&weak.estimator, &solve)); /* nothing is left to do */
}

static void the_fixed_point_window_takes_the_stages_that_init_counts_with(void **state)
{
    (void)state;
    static pvid_weak_q31 fixed;
    for (uint8_t iterations = 1; iterations <= 3; iterations++) {
        pvid_weak_config_q31 settings = weak_unit;
        settings.iterations = iterations;
        assert_int_equal(pvid_weak_init_q31(&fixed, &settings), PVID_OK);
        plant_state plant = released_plant();
        uint32_t stages = 0;
        for (int begun = 0; begun < 4;) {
            double phi;
            double y;
            plant_step(&plant, &phi, &y);
            (void)pvid_weak_step_q31(&fixed, (int32_t)floor((phi / 3.834951969714103e-4) + 0.5),
                                     (int32_t)floor((y / 5.0e-6) + 0.5));
            if (!pvid_weak_finish_is_busy_q31(&fixed.finish)) {
                continue;
            }
            begun++;
            stages = fixed.stages_per_tick; /* of the tick that completed it */
            pvid_reason reason = PVID_ACCUMULATED;
            while (pvid_weak_finish_is_busy_q31(&fixed.finish)) {
                stages++;
                pvid_weak_finish_step_q31(&fixed.finish, fixed.design, iterations, fixed.sums[fixed.finish.buffer],
                                          &fixed.estimator, &fixed.trust, &reason);
            }
        }
        assert_int_equal(stages, pvid_weak_finish_stages_q31(fixed.design->functions, iterations, &fixed.estimator));
    }
}

/* The curvature of a window: a mean of what fell into it, be it one; none is no curvature. */
static void one_second_difference_is_a_mean(void **state)
{
    (void)state;
    pvid_weak_window_f32 window = {.curvature_square_sum = 6.0f};
    pvid_weak_window_q31 other = {.curvature_square_sum = 6 << 20};
    const float means[4] = {0.0f, 6.0f, 3.0f, 2.0f};
    for (uint16_t curvatures = 0; curvatures < 4u; curvatures++) {
        window.curvatures = curvatures;
        other.curvatures = curvatures;
        assert_true(pvid_weak_window_curvature_f32(&window) == means[curvatures]);
        const pvid_scaled_q31 mean = pvid_weak_window_curvature_q31(&other);
        assert_true(fabs((ldexp((double)mean.m, mean.e) / 1048576.0) - (double)means[curvatures]) < 1.0e-6);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_window_takes_the_stages_that_init_counts_with, start_again),
        cmocka_unit_test(assessment_takes_the_stated_number_of_stages),
        cmocka_unit_test_setup(the_fixed_point_window_takes_the_stages_that_init_counts_with, start_again),
        cmocka_unit_test(one_second_difference_is_a_mean),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
