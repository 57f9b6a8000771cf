/* The refinement: motion and columns against double arithmetic, rows and their solution, what init refuses. */
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "number/sincos_f32.h"
#include "pvid/pvid.h"
#include "refine/refine_pass_f32.h"
#include "refine/refine_solve_f32.h"

#define N PVID_REFINE_PARAMETERS
#define STEPS 240u /* of 8 ms */
#define FINE 32u   /* of the reference in each */
#define STEP_S 0.008

static const double truth[N] = {31.7, 8.875, 5.625, 0.05, 0.01, 0.002, 0.01};
static const double start[4] = {0.2, 0.4, -0.5, 0.3};

/* ---- the equations in double, with a pivot that is known at all times ---- */

static double input_at(double t)
{
    return (4.0 * sin(7.0 * t)) + (6.0 * sin((14.0 * t) + 1.0));
}

static void accelerations(const double r[], const double x[], double t, double out[4])
{
    const double l = (r[1] - r[2]) - 1.0;
    const double lam = l / r[2];
    const double sig = 1.0 / l;
    const double g = r[0] + input_at(t + r[5]);
    const double s = sin(x[1] - x[0]);
    const double c = cos(x[1] - x[0]);
    const double vr = x[3] - x[2];
    const double b1 = (lam * s * x[3] * x[3]) - (g * sin(x[0])) - (r[3] * x[2]) + (r[4] * vr);
    const double b2 = (-s * x[2] * x[2]) - (g * sin(x[1])) - ((r[4] / lam) * vr);
    const double det = sig + (s * s);
    out[0] = x[2];
    out[1] = x[3];
    out[2] = (((1.0 + sig) * b1) - (c * b2)) / det;
    out[3] = ((b2 - (c * b1)) / det) / lam;
}

/* The state after `steps` steps. */
static void integrate(const double r[], const double from[], uint32_t steps, double x[4])
{
    const double h = STEP_S / FINE;
    memcpy(x, from, 4u * sizeof x[0]);
    for (uint32_t i = 0; i < (steps * FINE); i++) {
        const double t = (double)i * h;
        double k[4][4];
        double at[4];
        accelerations(r, x, t, k[0]);
        for (int s = 1; s < 4; s++) {
            const double part = (s == 3) ? h : (0.5 * h);
            for (int j = 0; j < 4; j++) {
                at[j] = x[j] + (part * k[s - 1][j]);
            }
            accelerations(r, at, t + part, k[s]);
        }
        for (int j = 0; j < 4; j++) {
            x[j] += (h / 6.0) * (k[0][j] + (2.0 * (k[1][j] + k[2][j])) + k[3][j]);
        }
    }
}

/* ---- a pass over what the equations give ---- */

static float measured[STEPS + 3u];

static void measure(void)
{
    double x[4];
    for (uint32_t i = 0; i < (STEPS + 3u); i++) {
        integrate(truth, start, i, x);
        measured[i] = (float)((x[1] - x[0]) + truth[6]);
    }
}

static void to_floats(const double from[], float to[], size_t n)
{
    for (size_t i = 0; i < n; i++) {
        to[i] = (float)from[i];
    }
}

static void run_pass(pvid_refine_pass_f32 *pass, const double r[], const double from[])
{
    const float weight[PVID_REFINE_OUTPUTS] = {1.0f};
    float linear[N];
    float state[4];
    to_floats(r, linear, N);
    to_floats(from, state, 4);
    pvid_refine_pass_begin_f32(pass, linear, state, (float)STEP_S, 1.0e3f);
    while (!pvid_refine_pass_ends_f32(pass, STEPS / PVID_REFINE_SUB)) {
        pvid_refine_signals_f32 signals;
        uint32_t first = 0;
        memset(&signals, 0, sizeof signals);
        const uint32_t steps = pvid_refine_pass_needs_f32(pass, &first);
        if (steps > 0u) {
            for (uint32_t k = 0; k < (steps + (2u * PVID_REFINE_REACH)); k++) {
                signals.u[k][0] = (float)input_at(((double)(first + k) - (double)PVID_REFINE_REACH) * STEP_S);
            }
            memcpy(signals.z, &measured[first], steps * sizeof signals.z[0]);
        }
        pvid_refine_pass_job_f32(pass, linear, weight, &signals);
    }
}

static pvid_refine_pass_f32 pass;

static void test_the_motion_is_that_of_the_equations(void **state)
{
    (void)state;
    double x[4];
    run_pass(&pass, truth, start);
    integrate(truth, start, STEPS, x);
    for (int i = 0; i < 4; i++) {
        /* 2 s of the fast mode: 1e-6 of its phase, and the parabola's error of the skew */
        assert_true(fabs((double)pass.state[i] - x[i]) < ((i < 2) ? 3.0e-5 : 3.0e-4));
    }
    assert_int_equal(pass.used, STEPS / PVID_REFINE_SUB);
}

static void test_columns_are_derivatives_of_the_motion(void **state)
{
    (void)state;
    run_pass(&pass, truth, start);
    for (size_t j = 0; j < PVID_REFINE_COLUMNS; j++) {
        double r[2][N];
        double from[2][4];
        double x[2][4];
        double width = 2.0e-4;
        for (int side = 0; side < 2; side++) {
            const double part = (side == 0) ? (-0.5 * width) : (0.5 * width);
            memcpy(r[side], truth, sizeof truth);
            memcpy(from[side], start, sizeof start);
            const double l = (truth[1] - truth[2]) - 1.0;
            const double lam = (l / truth[2]) * ((j == 5u) ? (1.0 + part) : 1.0);
            const double sig = (1.0 / l) * ((j == 6u) ? (1.0 + part) : 1.0);
            r[side][0] *= (j == 4u) ? (1.0 + part) : 1.0; /* columns of the motion: log w, log lam, log sig */
            r[side][2] = (1.0 / sig) / lam;
            r[side][1] = (1.0 / sig) + r[side][2] + 1.0;
            if (j >= 7u) {
                r[side][j - 4u] += part;
            } else if (j < 4u) {
                from[side][j] += part;
            }
            integrate(r[side], from[side], STEPS, x[side]);
        }
        double size = 0.0;
        double error = 0.0;
        for (int i = 0; i < 4; i++) {
            const double wanted = (x[1][i] - x[0][i]) / width;
            const double found = (double)pass.column[j][i];
            size = fmax(size, fabs(wanted));
            error = fmax(error, fabs(found - wanted));
        }
        assert_true(error < (0.05 * size)); /* leapfrog over 32 ms */
    }
}

/* Gauss-Newton from a start and parameters that are off. */
static void test_passes_and_solutions_find_the_truth(void **state)
{
    (void)state;
    static const double off[N] = {1.03, 0.98, 1.02, 0.0, 0.0, 0.0, 0.0};
    static const float prior_sd[N] = {0.15f, 0.15f, 0.15f, 0.1f, 0.05f, 0.005f, 0.1f};
    static pvid_refine_solve_f32 solve;
    double r[N];
    double from[4] = {0.0, 0.0, 0.0, 0.0};
    float past[N];
    float triangle[PVID_REFINE_TRIANGLE];
    for (size_t i = 0; i < N; i++) {
        r[i] = truth[i] * off[i];
    }
    to_floats(r, past, N);
    pvid_refine_prior_f32(prior_sd, 1.0e-5f, triangle);
    for (int k = 0; k < 10; k++) {
        float linear[N];
        float moved[N];
        run_pass(&pass, r, from);
        to_floats(r, linear, N);
        pvid_refine_solve_begin_f32(&solve);
        pvid_refine_solution found = PVID_REFINE_SOLVING;
        while (found == PVID_REFINE_SOLVING) {
            found = pvid_refine_solve_job_f32(&solve, &pass, triangle, past, linear, prior_sd, 2.0f);
        }
        assert_int_equal(found, PVID_REFINE_SOLVED);
        pvid_refine_move_f32(linear, solve.step, moved);
        for (size_t i = 0; i < N; i++) {
            r[i] = (double)moved[i];
        }
        for (size_t i = 0; i < 4u; i++) {
            from[i] += (double)solve.shift[i];
        }
    }
    for (size_t i = 0; i < 3u; i++) {
        assert_true(fabs((r[i] / truth[i]) - 1.0) < 1.0e-3);
    }
    assert_true(fabs(r[3] - truth[3]) < 2.0e-3);
    assert_true(fabs(r[5] - truth[5]) < 2.0e-5);
    assert_true(fabs(r[6] - truth[6]) < 1.0e-4);
    assert_true(solve.size < 1.0e-3f);
}

static void test_a_row_beyond_the_gate_or_without_residual_is_left_out(void **state)
{
    (void)state;
    run_pass(&pass, truth, start);
    const uint16_t all = pass.used;
    measured[50] += 1.0e5f;
    measured[101] = pvid_from_bits_f32(0x7FC00000u);
    run_pass(&pass, truth, start);
    assert_int_equal(pass.used, all - 2u);
    assert_true(pass.sum[PVID_REFINE_SUMS - 1] < 1.0e-6f);
    measure();
}

static void test_sine_and_cosine(void **state)
{
    (void)state;
    for (int i = -4000; i <= 4000; i++) {
        const float x = (float)i * 0.005f;
        float s = 0.0f;
        float c = 0.0f;
        pvid_sincos_f32(x, &s, &c);
        assert_true(fabs((double)s - sin((double)x)) < 6.0e-7);
        assert_true(fabs((double)c - cos((double)x)) < 6.0e-7);
    }
}

/* ---- init ---- */

static const float second[PVID_REFINE_HALF + 1] = {-2.0f, 1.0f};
static const pvid_refine_signal_f32 signals[2] = {{1, 2, PVID_SIGNAL_SAMPLED, 3.3f, 100.0f},
                                                  {0, 0, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};

static pvid_refine_config_f32 good(void)
{
    const pvid_refine_config_f32 config = {
        .sample_rate_hz = 1000.0f,
        .ratio = 8,
        .second = second,
        .signal = signals,
        .block = 84,
        .first_block = 22,
        .passes = 2,
        .most_passes = 8,
        .sd = {1.0e-4f},
        .prior_sd = {0.15f, 0.15f, 0.15f, 0.1f, 0.05f, 0.005f, 0.1f},
        .state_limit = {3.5f, 3.5f, 60.0f, 60.0f},
        .gate = 8.0f,
        .chi_max = 3.0f,
        .clash_max = 25.0f,
        .step_max = 0.02f,
        .step_limit = 2.0f,
        .se_max = 0.05f,
        .distance = 0.03f,
    };
    return config;
}

static pvid_refine_f32 refinement;

static void refuses(const pvid_refine_config_f32 *config, pvid_status status)
{
    const float sample[2] = {0.0f, 0.0f};
    assert_int_equal(pvid_refine_init_f32(&refinement, config), status);
    assert_int_equal(pvid_refine_step_f32(&refinement, sample, NULL), PVID_NOT_READY);
    assert_null(pvid_refine_latest_f32(&refinement));
}

#define REFUSES(field, value, status)                                                                                  \
    {                                                                                                                  \
        pvid_refine_config_f32 bad = good();                                                                           \
        bad.field = (value);                                                                                           \
        refuses(&bad, (status));                                                                                       \
    }

static void test_init_refuses(void **state)
{
    (void)state;
    const float nan = pvid_from_bits_f32(0x7FC00000u);
    static const pvid_refine_signal_f32 derived_output[2] = {{1, 2, PVID_SIGNAL_SAMPLED, 3.3f, 100.0f},
                                                             {0, 2, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};
    static const pvid_refine_signal_f32 no_range[2] = {{1, 2, PVID_SIGNAL_SAMPLED, 3.3f, 0.0f},
                                                       {0, 0, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};
    REFUSES(sample_rate_hz, nan, PVID_BAD_SAMPLE_RATE);
    REFUSES(ratio, 0, PVID_BAD_DECIMATION);
    REFUSES(second, NULL, PVID_BAD_DESIGN);
    REFUSES(signal, NULL, PVID_BAD_DESIGN);
    REFUSES(signal, derived_output, PVID_BAD_DESIGN);
    REFUSES(signal, no_range, PVID_BAD_ANGLE_LIMIT);
    REFUSES(block, (PVID_REFINE_RING / 6) + 1, PVID_BAD_WINDOW);
    REFUSES(first_block, 85, PVID_BAD_WINDOW);
    REFUSES(passes, 0, PVID_BAD_ITERATIONS);
    REFUSES(most_passes, 1, PVID_BAD_ITERATIONS);
    REFUSES(sd[0], 0.0f, PVID_BAD_ROW_SD);
    REFUSES(prior_sd[6], nan, PVID_BAD_START_SD);
    REFUSES(gain_sd[0], nan, PVID_BAD_START_SD);
    REFUSES(state_limit[3], 0.0f, PVID_BAD_BOUNDS);
    REFUSES(forgetting_s, -1.0f, PVID_BAD_FORGETTING);
    REFUSES(gate, nan, PVID_BAD_GATE_SIGMAS);
    REFUSES(chi_max, 0.5f, PVID_BAD_MISFIT_MAX);
    REFUSES(clash_max, nan, PVID_BAD_MISFIT_MAX);
    REFUSES(step_max, 0.0f, PVID_BAD_STEP_LIMIT);
    REFUSES(step_limit, nan, PVID_BAD_STEP_LIMIT);
    REFUSES(se_max, 0.0f, PVID_BAD_SE_MAX);
    REFUSES(distance, -1.0f, PVID_BAD_START_SD);
    refuses(NULL, PVID_BAD_POINTER);
    const pvid_refine_config_f32 config = good();
    assert_int_equal(pvid_refine_init_f32(NULL, &config), PVID_BAD_POINTER);
    assert_int_equal(pvid_refine_init_f32(&refinement, &config), PVID_OK);
}

static void test_it_waits_for_the_weak_form(void **state)
{
    (void)state;
    const pvid_refine_config_f32 config = good();
    const float sample[2] = {0.1f, 0.0f};
    pvid_refine_estimate_f32 estimate;
    uint32_t number = 7;
    assert_int_equal(pvid_refine_init_f32(&refinement, &config), PVID_OK);
    for (int i = 0; i < 3000; i++) {
        assert_int_equal(pvid_refine_step_f32(&refinement, sample, NULL), PVID_WARMING_UP);
    }
    assert_true(pvid_refine_read_f32(&refinement, &estimate, &number));
    assert_int_equal(number, 0);
    pvid_refine_freeze_f32(&refinement, true);
    assert_int_equal(pvid_refine_step_f32(&refinement, sample, NULL), PVID_HELD_FROZEN);
}

static int prepare(void **state)
{
    (void)state;
    measure();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_motion_is_that_of_the_equations),
        cmocka_unit_test(test_columns_are_derivatives_of_the_motion),
        cmocka_unit_test(test_passes_and_solutions_find_the_truth),
        cmocka_unit_test(test_a_row_beyond_the_gate_or_without_residual_is_left_out),
        cmocka_unit_test(test_sine_and_cosine),
        cmocka_unit_test(test_init_refuses),
        cmocka_unit_test(test_it_waits_for_the_weak_form),
    };
    return cmocka_run_group_tests(tests, prepare, NULL);
}
