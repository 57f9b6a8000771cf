/* The refinement: motion and columns against double arithmetic, rows and their solution, what init refuses, growth of
 * its blocks, rounding of its signals, ticks at which the weak form is busy. */
#include "test.h"

#include <stdlib.h>

#include "persist/fingerprint_refine_f32.h"
#include "pvid/fnv_refine.h"
#include "refine/refine_judge_f32.h"
#include "number/sincos_f32.h"
#include "pvid/pvid.h"
#include "refine/refine_front_f32.h"
#include "refine/refine_pass_f32.h"
#include "refine/refine_solve_f32.h"
#include "refine_model_f32.h"

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
    const double g = r[0] + input_at(t);
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

/* A step of Runge-Kutta from t on. */
static void advance(const double r[], double t, double h, double x[4])
{
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

/* The state after `steps` steps. */
static void integrate(const double r[], const double from[], uint32_t steps, double x[4])
{
    const double h = STEP_S / FINE;
    memcpy(x, from, 4u * sizeof x[0]);
    for (uint32_t i = 0; i < (steps * FINE); i++) {
        advance(r, (double)i * h, h, x);
    }
}

/* What the encoder shows at t, of the state at t: the sensors are late by the skew. */
static double shown(const double x[], double t)
{
    double late[4];
    memcpy(late, x, sizeof late);
    advance(truth, t, truth[5], late);
    return (late[1] - late[0]) + truth[6];
}

/* ---- a pass over what the equations give ---- */

static float measured[STEPS + 3u];

static void measure(void)
{
    double x[4];
    for (uint32_t i = 0; i < (STEPS + 3u); i++) {
        integrate(truth, start, i, x);
        measured[i] = (float)shown(x, (double)i * STEP_S);
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
    const pvid_refine_steps_f32 steps = {.h = (float)STEP_S};
    pvid_refine_pass_begin_f32(pass, linear, state, &steps, 1.0e3f);
    while (!pvid_refine_pass_ends_f32(pass, STEPS / PVID_REFINE_SUB)) {
        uint32_t step = 0;
        (void)pvid_refine_pass_needs_f32(pass, &step);
        const pvid_refine_signals_f32 signals = {{(float)input_at((double)step * STEP_S)}, {measured[step]}};
        pvid_refine_pass_job_f32(pass, linear, weight, &signals);
    }
}

static pvid_refine_pass_f32 pass;

static void test_the_motion_is_that_of_the_equations(void **state)
{
    double x[4];
    run_pass(&pass, truth, start);
    integrate(truth, start, STEPS, x);
    for (int i = 0; i < 4; i++) {
        /* 2 s of the fast mode: float32, the first steps, the polynomial of the skew */
        assert_true(fabs((double)pass.state[i] - x[i]) < ((i < 2) ? 5.0e-6 : 3.0e-5));
    }
    assert_int_equal(pass.used, STEPS / PVID_REFINE_SUB);
}

static void test_columns_are_derivatives_of_the_motion(void **state)
{
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
        solve.dropped = (k < 2) ? 0u : solve.dropped; /* as at the beginning of a pass */
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
    run_pass(&pass, truth, start);
    const uint16_t all = pass.used;
    measured[50] += 1.0e5f;
    measured[101] = pvid_from_bits_f32(0x7FC00000u);
    run_pass(&pass, truth, start);
    assert_int_equal(pass.used, all - 2u);
    assert_true(pass.sums.sum[PVID_REFINE_SUMS - 1] < 1.0e-6f);
    measure();
}

static void test_sine_and_cosine(void **state)
{
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
        .jobs = 3,
        .rests = 1,
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
    assert_int_equal(pvid_refine_init_f32(&refinement, config, 2, NULL), status);
    assert_int_equal(pvid_refine_step_f32(&refinement, sample, NULL, false), PVID_NOT_READY);
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
    const float nan = pvid_from_bits_f32(0x7FC00000u);
    static const pvid_refine_signal_f32 derived_output[2] = {{1, 2, PVID_SIGNAL_SAMPLED, 3.3f, 100.0f},
                                                             {0, 2, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};
    static const pvid_refine_signal_f32 no_range[2] = {{1, 2, PVID_SIGNAL_SAMPLED, 3.3f, 0.0f},
                                                       {0, 0, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};
    static const pvid_refine_signal_f32 integral[2] = {{1, -1, PVID_SIGNAL_SAMPLED, 3.3f, 100.0f},
                                                       {0, 0, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};
    static const pvid_refine_signal_f32 integral_of_held[2] = {{1, -1, PVID_SIGNAL_HELD, 3.3f, 100.0f},
                                                               {0, 0, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};
    static const pvid_refine_signal_f32 integrated_output[2] = {{1, 2, PVID_SIGNAL_SAMPLED, 3.3f, 100.0f},
                                                                {0, -1, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};
    static const pvid_refine_signal_f32 held_output[2] = {{1, 2, PVID_SIGNAL_SAMPLED, 3.3f, 100.0f},
                                                          {0, 0, PVID_SIGNAL_HELD, 1.0f, 1.0f}};
    static const pvid_refine_signal_f32 no_source[2] = {{1, 0, PVID_SIGNAL_JUMP, 3.3f, 100.0f},
                                                        {0, 0, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};
    static const pvid_refine_signal_f32 huge[2] = {{1, 2, PVID_SIGNAL_SAMPLED, 2.0e9f, 100.0f},
                                                   {0, 0, PVID_SIGNAL_SAMPLED, 1.0f, 1.0f}};
    static const float no_weights[17] = {2.0e12f};
    REFUSES(signal, integral, PVID_BAD_DESIGN); /* the pendulum has none */
    REFUSES(signal, integral_of_held, PVID_BAD_DESIGN);
    REFUSES(signal, integrated_output, PVID_BAD_DESIGN);
    REFUSES(signal, held_output, PVID_BAD_DESIGN);
    REFUSES(signal, no_source, PVID_BAD_DESIGN);
    REFUSES(signal, huge, PVID_BAD_DESIGN);
    REFUSES(second, no_weights, PVID_BAD_DESIGN);
    REFUSES(first_block, 7, PVID_BAD_WINDOW);
    REFUSES(most_passes, 17, PVID_BAD_ITERATIONS);
    REFUSES(sample_rate_hz, nan, PVID_BAD_SAMPLE_RATE);
    REFUSES(ratio, 0, PVID_BAD_DECIMATION);
    REFUSES(second, NULL, PVID_BAD_DESIGN);
    REFUSES(signal, NULL, PVID_BAD_DESIGN);
    REFUSES(signal, derived_output, PVID_BAD_DESIGN);
    REFUSES(signal, no_range, PVID_BAD_RANGE);
    REFUSES(block, (PVID_REFINE_RING / 6) + 1, PVID_BAD_WINDOW);
    REFUSES(first_block, 85, PVID_BAD_WINDOW);
    REFUSES(passes, 0, PVID_BAD_ITERATIONS);
    REFUSES(most_passes, 1, PVID_BAD_ITERATIONS);
    REFUSES(jobs, 0, PVID_BAD_ITERATIONS);
    REFUSES(jobs, 129, PVID_BAD_ITERATIONS);
    REFUSES(sd[0], 0.0f, PVID_BAD_ROW_SD);
    REFUSES(prior_sd[6], nan, PVID_BAD_START_SD);
    REFUSES(state_limit[3], 0.0f, PVID_BAD_BOUNDS);
    REFUSES(forgetting_s, -1.0f, PVID_BAD_FORGETTING);
    REFUSES(outlier_gate, nan, PVID_BAD_GATE_SIGMAS);
    REFUSES(outlier_gate, 1.0f, PVID_BAD_GATE_SIGMAS);
    REFUSES(outlier_gate, -4.0f, PVID_BAD_GATE_SIGMAS);
    REFUSES(gate, nan, PVID_BAD_GATE_SIGMAS);
    REFUSES(chi_max, 0.5f, PVID_BAD_MISFIT_MAX);
    REFUSES(clash_max, nan, PVID_BAD_MISFIT_MAX);
    REFUSES(step_max, 0.0f, PVID_BAD_STEP_LIMIT);
    REFUSES(step_limit, nan, PVID_BAD_STEP_LIMIT);
    REFUSES(se_max, 0.0f, PVID_BAD_SE_MAX);
    REFUSES(distance, -1.0f, PVID_BAD_START_SD);
    refuses(NULL, PVID_BAD_POINTER);
    const pvid_refine_config_f32 config = good();
    assert_int_equal(pvid_refine_init_f32(&refinement, &config, 1, NULL), PVID_BAD_DESIGN); /* it needs two */
    assert_int_equal(pvid_refine_init_f32(NULL, &config, 2, NULL), PVID_BAD_POINTER);
    const float shared[10] = {0.01f, 1.0f, 0.5f, 0.0f, 0.02f, 0.0f, -1.0f, 0.0f, 0.0f, 0.3f};
    const float wrong[3][2] = {{0.0f, NAN}, {0.0f, -0.01f}, {1.0f, -1.01f}}; /* place, value */
    for (size_t i = 0; i < 3u; i++) {
        float bad[10];
        memcpy(bad, shared, sizeof bad);
        bad[(size_t)wrong[i][0]] = wrong[i][1];
        assert_int_equal(pvid_refine_init_f32(&refinement, &config, 2, bad), PVID_BAD_SHARED);
    }
    assert_int_equal(pvid_refine_init_f32(&refinement, &config, 2, shared), PVID_OK);
    assert_int_equal(pvid_refine_init_f32(&refinement, &config, 2, NULL), PVID_OK);
}

static void test_before_its_init_it_does_nothing(void **state)
{
    static const pvid_refine_f32 zero;
    static pvid_refine_f32 none;
    const float sample[2] = {0.1f, 0.0f};
    pvid_refine_estimate_f32 estimate;
    pvid_estimate_f32 weak;
    memset(&weak, 0, sizeof weak);
    for (int i = 0; i < 2; i++) {
        pvid_refine_f32 *one = (i == 0) ? &none : NULL;
        assert_int_equal(pvid_refine_step_f32(one, sample, NULL, false), PVID_NOT_READY);
        assert_int_equal(pvid_refine_reason_f32(one), PVID_NOT_READY);
        assert_false(pvid_refine_read_f32(one, &estimate, NULL));
        assert_null(pvid_refine_latest_f32(one));
        pvid_refine_gap_f32(one);
        pvid_refine_freeze_f32(one, true);
        assert_int_equal(pvid_refine_best_f32(one, &weak, &weak), PVID_STAGE_WEAK);
    }
    assert_memory_equal(&none, &zero, sizeof none);
    const pvid_refine_config_f32 config = good();
    assert_int_equal(pvid_refine_init_f32(&none, &config, 2, NULL), PVID_OK);
    assert_int_equal(pvid_refine_step_f32(&none, NULL, NULL, false), PVID_NOT_READY);
    assert_false(pvid_refine_read_f32(&none, NULL, NULL));
    pvid_refine_gap_f32(&none); /* while it waits */
    assert_int_equal(pvid_refine_reason_f32(&none), PVID_WARMING_UP);
}

static void test_the_region_of_the_pendulum_is_that_of_positive_parameters(void **state)
{
    float r[N];
    to_floats(truth, r, N);
    assert_true(pvid_refine_region(r));
    for (int i = 0; i < 3; i++) {
        to_floats(truth, r, N);
        r[i] = -r[i];
        assert_false(pvid_refine_region(r));
    }
    to_floats(truth, r, N);
    r[1] = r[2] + 0.5f; /* d1 - d2 is above 1 */
    assert_false(pvid_refine_region(r));
}

static void test_it_waits_for_the_weak_form(void **state)
{
    const pvid_refine_config_f32 config = good();
    const float sample[2] = {0.1f, 0.0f};
    pvid_refine_estimate_f32 estimate;
    uint32_t number = 7;
    assert_int_equal(pvid_refine_init_f32(&refinement, &config, 2, NULL), PVID_OK);
    for (int i = 0; i < 3000; i++) {
        assert_int_equal(pvid_refine_step_f32(&refinement, sample, NULL, false), PVID_WARMING_UP);
    }
    assert_true(pvid_refine_read_f32(&refinement, &estimate, &number));
    assert_int_equal(number, 0);
    pvid_refine_freeze_f32(&refinement, true);
    assert_int_equal(pvid_refine_step_f32(&refinement, sample, NULL, false), PVID_HELD_FROZEN);
}

/* ---- blocks, of samples at 1 kHz whose input is measured ---- */

#define TICKS 16000u
#define END 4u /* phase of refine_f32.c: a block's passes are done */
#define FIRST_WEAK 1000u

static float samples[TICKS][2];

static void simulate(void)
{
    const double h = 1.0e-3 / 4.0;
    double x[4];
    memcpy(x, start, sizeof x);
    for (uint32_t i = 0; i < (4u * TICKS); i++) {
        if ((i % 4u) == 0u) {
            samples[i / 4u][0] = (float)shown(x, (double)i * h);
            samples[i / 4u][1] = (float)input_at((double)i * h);
        }
        advance(truth, (double)i * h, h, x);
    }
}

static pvid_refine_config_f32 sampled(void)
{
    static const pvid_refine_signal_f32 direct[2] = {{1, 0, PVID_SIGNAL_SAMPLED, 1.0f, 100.0f},
                                                     {0, 0, PVID_SIGNAL_SAMPLED, 1.0f, 2.0f}};
    pvid_refine_config_f32 config = good();
    config.signal = direct;
    return config;
}

/* Off by less than 2 %. */
static pvid_estimate_f32 weak_estimate(void)
{
    pvid_estimate_f32 weak;
    memset(&weak, 0, sizeof weak);
    for (size_t i = 0; i < 3u; i++) {
        weak.p[i] = (float)(truth[i] * ((i == 1u) ? 0.99 : 1.01));
        weak.se[i] = 0.5f;
    }
    weak.se[3] = 0.5f;
    return weak;
}

/* Ticks from `first` on until `done` is true; the weak form's estimate at FIRST_WEAK. Returns the tick behind. */
static uint32_t run_until(bool (*done)(void), uint32_t first)
{
    const pvid_estimate_f32 weak = weak_estimate();
    for (uint32_t i = first; i < TICKS; i++) {
        (void)pvid_refine_step_f32(&refinement, samples[i], (i == FIRST_WEAK) ? &weak : NULL, false);
        if (done()) {
            return i + 1u;
        }
    }
    return TICKS;
}

static bool has_grown(void)
{
    return refinement.length > refinement.config.first_block;
}

static bool has_taken(void)
{
    return refinement.taken > 0u;
}

static bool is_published(void)
{
    return pvid_refine_latest_f32(&refinement) != NULL;
}

/* At the end of the passes of a longer block whose samples were used before. */
static bool is_again_at_its_end(void)
{
    return refinement.again && (refinement.phase == END);
}

static bool has_left_the_end(void)
{
    return refinement.phase != END;
}

static bool is_at_its_end(void)
{
    return refinement.phase == END;
}

static void begin_run(void)
{
    const pvid_refine_config_f32 config = sampled();
    assert_int_equal(pvid_refine_init_f32(&refinement, &config, 2, NULL), PVID_OK);
}

static void is_near_the_truth(void)
{
    for (size_t i = 0; i < 3u; i++) {
        assert_true(fabs(((double)refinement.estimate.r[i] / truth[i]) - 1.0) < 2.0e-3);
    }
}

static void test_a_search_grows_in_its_first_samples(void **state)
{
    begin_run();
    uint32_t tick = run_until(has_grown, 0);
    assert_int_equal(refinement.taken, 0);
    assert_true(refinement.begin < (FIRST_WEAK / 8u)); /* in the samples of the first block */
    tick = run_until(has_taken, tick);
    assert_int_equal(refinement.origin, 0);
    assert_true(refinement.again);
    assert_int_equal(refinement.length, refinement.config.block);
    assert_true(refinement.begin < (FIRST_WEAK / 8u));
    tick = run_until(is_published, tick);
    assert_true(tick < 4000u);
    is_near_the_truth();
}

static void test_a_longer_block_of_used_samples_is_judged_by_its_own_level(void **state)
{
    begin_run();
    const uint32_t tick = run_until(is_again_at_its_end, 0);
    assert_true(tick < TICKS);
    const float density = 0.89f * 1.0e-4f * 1.0e-4f;
    const float rows = (float)(refinement.work.used - PVID_REFINE_UNKNOWNS);
    const pvid_refine_f32 before = refinement;
    const float levels[] = {5.0f, 8.9f, 9.1f}; /* times the level; a block of new samples is refused from 3 on */
    for (int again = 0; again < 2; again++) {
        for (int i = 0; i < 3; i++) {
            refinement = before;
            refinement.again = again != 0;
            refinement.level = 1.5f;
            refinement.solve.clash = 0.0f;
            refinement.solve.residual = 1.5f * levels[i] * density * rows;
            (void)run_until(has_left_the_end, tick);
            const bool taken = (again != 0) && (i < 2);
            assert_int_equal(refinement.taken, taken ? 2 : 1);
            assert_int_equal(refinement.refused, taken ? 0 : 1);
            if (taken) {
                assert_true(fabsf((refinement.level / (1.5f * levels[i])) - 1.0f) < 1.0e-4f);
            } else {
                assert_true(fabsf(refinement.clash - (0.3f * 25.0f * 1.5f)) < 1.0e-4f);
            }
        }
    }
    /* of new samples: the running mean */
    refinement = before;
    refinement.again = false;
    refinement.level = 1.5f;
    refinement.solve.clash = 0.0f;
    refinement.solve.residual = 2.5f * density * rows;
    (void)run_until(has_left_the_end, tick);
    assert_int_equal(refinement.taken, 2);
    assert_true(fabsf(refinement.level - 1.7f) < 1.0e-4f);
}

/* The past then has a sixteenth of its weight: a clash of 1 with it is one of 256 with all of it; the limit is 25. */
static void test_behind_a_refused_longer_block_the_whole_past_is_clashed_with(void **state)
{
    const float variance = 1.0e-4f * 1.0e-4f;
    for (int refused = 0; refused < 2; refused++) {
        begin_run();
        uint32_t tick = run_until(is_again_at_its_end, 0);
        refinement.solve.residual = (refused != 0) ? 1.0f : refinement.solve.residual;
        tick = run_until(has_left_the_end, tick);
        assert_int_equal(refinement.refused, refused);
        tick = run_until(is_at_its_end, tick);
        assert_false(refinement.again);
        refinement.solve.clash = (float)PVID_REFINE_PARAMETERS * variance;
        (void)run_until(has_left_the_end, tick);
        assert_int_equal(refinement.taken, (refused != 0) ? 0 : 2);
    }
}

static void test_a_search_behind_a_lost_track_remembers_the_refusals(void **state)
{
    begin_run();
    uint32_t tick = run_until(is_published, 0);
    assert_true(refinement.clash < 2.0f);
    for (int i = 0; i < 2; i++) {
        tick = run_until(is_at_its_end, tick);
        refinement.solve.residual = 1.0f;
        tick = run_until(has_left_the_end, tick);
    }
    assert_int_equal(refinement.taken, 0);
    const float remembered = refinement.clash; /* of 25: all but the square of what CLASH_GAIN leaves */
    assert_true((remembered > (25.0f * 0.51f)) && (remembered < 13.8f));
    (void)run_until(has_taken, tick);
    assert_true(!(refinement.clash < remembered));
}

/* The past is given up if the square root of the determinant of the information of past and block changes by more than
 * a factor of 2 from the first pass to the last one, or if the ratio is no number. */
static void test_a_past_whose_information_depends_on_the_point_is_given_up(void **state)
{
    const float factors[] = {0.49f, 0.51f, 1.0f, 1.99f, 2.01f, NAN};
    const bool adds[] = {false, true, true, true, false, false};
    begin_run();
    uint32_t tick = run_until(is_published, 0);
    tick = run_until(is_at_its_end, tick);
    const pvid_refine_f32 before = refinement;
    for (size_t i = 0; i < (sizeof adds / sizeof adds[0]); i++) {
        refinement = before;
        size_t place = 0;
        for (size_t k = 0; k < PVID_REFINE_PARAMETERS; k++) {
            refinement.diagonal[k] = refinement.solve.triangle[place];
            place += PVID_REFINE_PARAMETERS - k;
        }
        refinement.diagonal[i % PVID_REFINE_PARAMETERS] /= factors[i];
        const float whole = refinement.solve.triangle[0];
        (void)run_until(has_left_the_end, tick);
        assert_int_equal(refinement.taken, adds[i] ? 2 : 1);
        assert_int_equal(refinement.verdict, adds[i] ? PVID_UPDATED : PVID_HELD_UNCERTAIN);
        assert_true(fabsf((refinement.triangle[0] / whole) - (adds[i] ? 1.0f : (1.0f / 16.0f))) < 1.0e-6f);
        assert_true(fabsf(refinement.kept - (adds[i] ? 1.0f : (1.0f / 16.0f))) < 1.0e-6f);
    }
}

/* In its first two passes no row is left out: its start is predicted from a first block that may have been short. */
static void test_the_gate_waits_for_the_third_pass_of_a_second_block(void **state)
{
    begin_run();
    uint32_t tick = run_until(has_taken, 0);
    const pvid_refine_f32 before = refinement;
    for (uint8_t taken = 1; taken <= 2u; taken++) {
        refinement = before;
        refinement.taken = taken;
        refinement.again = false;
        refinement.restarted = false;
        bool gated[3] = {false, false, false};
        for (uint32_t i = tick; (i < TICKS) && (refinement.phase != END); i++) {
            (void)pvid_refine_step_f32(&refinement, samples[i], NULL, false);
            if (refinement.pass < 3u) {
                gated[refinement.pass] = refinement.work.gate < 1.0f;
            }
        }
        assert_int_equal(gated[0], taken == 2u);
        assert_int_equal(gated[1], taken == 2u);
    }
}

/* ---- what is published ---- */

/* Steps until a block ends, with an estimate of the weak form at the first tick; *tick: the first one, then the one
 * behind. Returns what the block told. */
static pvid_reason next_block(const pvid_estimate_f32 *weak, uint32_t *tick)
{
    pvid_reason reason = pvid_refine_step_f32(&refinement, samples[*tick], weak, false);
    while ((reason == PVID_ACCUMULATED) && ((*tick + 1u) < TICKS)) {
        (*tick)++;
        reason = pvid_refine_step_f32(&refinement, samples[*tick], NULL, false);
    }
    (*tick)++;
    return reason;
}

/* The number of estimates that another context reads; 0: none stands. */
static uint32_t number_read(void)
{
    pvid_refine_estimate_f32 copy;
    uint32_t number = 77;
    assert_true(pvid_refine_read_f32(&refinement, &copy, &number));
    assert_memory_equal(&copy, &refinement.estimate, sizeof copy);
    return number;
}

static void test_an_estimate_that_disagrees_is_held_and_the_published_one_withdrawn(void **state)
{
    begin_run();
    uint32_t tick = run_until(is_published, 0);
    const uint32_t number = number_read();
    assert_true(number > 0u);
    pvid_estimate_f32 weak = weak_estimate();
    weak.p[2] *= 1.1f;
    weak.se[2] = 0.01f;
    assert_int_equal(next_block(NULL, &tick), PVID_UPDATED); /* of the block before */
    assert_int_equal(next_block(&weak, &tick), PVID_HELD_DISAGREES);
    assert_int_equal(pvid_refine_reason_f32(&refinement), PVID_HELD_DISAGREES);
    assert_true(refinement.taken > 0u); /* it is in the track all the same */
    assert_null(pvid_refine_latest_f32(&refinement));
    assert_int_equal(number_read(), 0);
    weak = weak_estimate();
    assert_int_equal(next_block(&weak, &tick), PVID_UPDATED);
    assert_int_equal(number_read(), number + 1u);
    is_near_the_truth();
}

static void test_the_published_estimate_outlives_one_refused_block_and_not_the_loss_of_the_track(void **state)
{
    begin_run();
    uint32_t tick = run_until(is_published, 0);
    assert_int_equal(next_block(NULL, &tick), PVID_UPDATED);
    for (uint32_t refused = 1; refused <= 2u; refused++) {
        tick = run_until(is_at_its_end, tick);
        refinement.solve.residual = 1.0f;
        assert_int_equal(next_block(NULL, &tick), PVID_HELD_BLOCK);
        assert_int_equal(number_read(), (refused == 1u) ? 1u : 0u);
        assert_true((pvid_refine_latest_f32(&refinement) == NULL) == (refused == 2u));
    }
    (void)run_until(is_published, tick);
    assert_int_equal(number_read(), 2);
    is_near_the_truth();
}

static void test_the_best_estimate_is_the_refined_one_while_it_stands(void **state)
{
    pvid_estimate_f32 best;
    pvid_estimate_f32 weak = weak_estimate();
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        for (size_t j = 0; j < PVID_MAX_P; j++) {
            weak.covariance[i][j] = 0.25f;
        }
    }
    weak.kappa = 0.125f;
    begin_run();
    assert_int_equal(pvid_refine_best_f32(&refinement, &weak, &best), PVID_STAGE_WEAK);
    assert_memory_equal(&best, &weak, sizeof best);
    (void)run_until(is_published, 0);
    assert_int_equal(pvid_refine_best_f32(&refinement, &weak, &best), PVID_STAGE_REFINED);
    static const size_t places[PVID_REFINE_P] = {0, 1, 2, 6}; /* w, d1, d2, c */
    for (size_t i = 0; i < PVID_REFINE_P; i++) {
        assert_memory_equal(&best.p[i], &refinement.estimate.r[places[i]], sizeof best.p[i]);
        assert_memory_equal(&best.se[i], &refinement.estimate.se[places[i]], sizeof best.se[i]);
        assert_true(fabsf((sqrtf(best.covariance[i][i]) / best.se[i]) - 1.0f) <
                    1.0e-6f); /* of p, not of its logarithm */
        for (size_t j = 0; j < PVID_MAX_P; j++) {
            assert_memory_equal(&best.covariance[i][j], &best.covariance[j][i], sizeof best.p[i]);
            assert_true((j < PVID_REFINE_P) || ((best.covariance[i][j] >= 0.0f) && (best.covariance[i][j] <= 0.0f)));
        }
    }
    const float expected = refinement.estimate.covariance[0][6] * refinement.estimate.r[0]; /* c has no logarithm */
    assert_true(fabsf((best.covariance[0][3] / expected) - 1.0f) < 1.0e-6f);
    assert_true((best.kappa >= 0.125f) && (best.kappa <= 0.125f));
    best.kappa = 7.0f;
    assert_int_equal(pvid_refine_best_f32(&refinement, NULL, &best), PVID_STAGE_WEAK);
    assert_true((best.kappa >= 7.0f) && (best.kappa <= 7.0f));
    assert_int_equal(pvid_refine_best_f32(&refinement, &weak, NULL), PVID_STAGE_WEAK);
    assert_int_equal(pvid_refine_best_f32(NULL, &weak, &best), PVID_STAGE_WEAK);
    assert_memory_equal(&best, &weak, sizeof best);
}

static void test_a_gap_ends_a_longer_block_of_used_samples(void **state)
{
    begin_run();
    const uint32_t tick = run_until(has_taken, 0);
    assert_true(refinement.again);
    pvid_refine_gap_f32(&refinement);
    assert_false(refinement.again);
    assert_int_equal(refinement.begin, 0);
    assert_int_equal(refinement.origin, 0);
    assert_null(pvid_refine_latest_f32(&refinement));
    assert_true(run_until(is_published, tick) < TICKS);
    is_near_the_truth();
}

static pvid_refine_entry enter(pvid_refine_front_f32 *front, const pvid_refine_config_f32 *config, const float sample[])
{
    if (!front->referred) {
        pvid_refine_front_refer_f32(front, config, sample);
    }
    const bool ends = pvid_refine_front_add_f32(front, sample);
    return ends ? pvid_refine_front_end_block_f32(front, config, sample) : PVID_REFINE_NOTHING;
}

static void test_rounding_to_counts_leaves_no_bias(void **state)
{
    const pvid_refine_config_f32 config = sampled();
    const float count = 2.0f / 32767.0f;
    static pvid_refine_front_f32 front;
    for (int k = -4; k <= 4; k++) {
        const float sample[2] = {((float)k * 0.11f) * count, 0.0f};
        pvid_refine_front_init_f32(&front, &config);
        int32_t sum = 0;
        for (uint32_t i = 0; i < (8u * 202u); i++) {
            enter(&front, &config, sample);
        }
        for (uint32_t i = 0; i < 200u; i++) {
            sum += front.ring[i][1];
        }
        /* a count's fraction over 200 entries: what is left of one */
        assert_true(fabs((double)sum - (200.0 * 0.11 * k)) < 0.51);
    }
    const float beyond[2] = {3.0f, 0.0f};
    for (uint32_t i = 0; i < (8u * 2u); i++) {
        enter(&front, &config, beyond);
    }
    assert_int_equal(front.ring[front.next - 1u][1], INT16_MIN);
    assert_true((front.rest[1] >= 0.0f) && (front.rest[1] <= 0.0f));
}

/* The front end's ring behind tones with a ripple on both signals. A sample of the mean AT of one signal is off by
 * `error`, and all later samples by `step`; signals are y and phi. Returns false if it ends at an input beyond its
 * range. */
#define ENTRIES 200u
#define AT 150u

static bool run_front(pvid_refine_front_f32 *front, float outlier_gate, size_t signal, float error, float step)
{
    static const float steps_of_8ms[PVID_REFINE_HALF + 1] = {-31250.0f, 15625.0f};
    static pvid_refine_config_f32 config;
    config = good();
    config.second = steps_of_8ms;
    config.outlier_gate = outlier_gate;
    pvid_refine_front_init_f32(front, &config);
    for (uint32_t i = 0; i < (8u * ENTRIES); i++) {
        const double t = 0.001 * (double)i;
        const double ripple = 2.0e-5 * (double)((i * 7919u) % 17u);
        float sample[2] = {(float)((0.1 * sin(11.0 * t)) + ripple), (float)((0.005 * sin(9.0 * t)) + (0.1 * ripple))};
        if (i == ((8u * (AT + 1u)) + 3u)) { /* the first mean has no entry */
            sample[1u - signal] += error;
        }
        if (i >= (8u * (AT + 1u))) {
            sample[1u - signal] += step;
        }
        if (enter(front, &config, sample) == PVID_REFINE_BROKEN) {
            return false;
        }
    }
    return true;
}

/* Of the second derivatives [counts]. */
static int largest_difference(const pvid_refine_front_f32 *front, const pvid_refine_front_f32 *other)
{
    int largest = 0;
    for (uint32_t i = pvid_refine_front_first_f32(front); i < pvid_refine_front_end_f32(front); i++) {
        const int difference = abs(front->ring[i][0] - other->ring[i][0]);
        largest = (difference > largest) ? difference : largest;
    }
    return largest;
}

static void test_a_wild_sample_is_left_out(void **state)
{
    static pvid_refine_front_f32 clean;
    static pvid_refine_front_f32 front;
    run_front(&clean, 4.0f, 0u, 0.0f, 0.0f);
    for (int sign = -1; sign <= 1; sign += 2) {
        run_front(&front, 4.0f, 1u, (float)sign * 0.05f, 0.0f);
        for (uint32_t i = clean.behind; i < pvid_refine_front_end_f32(&clean); i++) {
            const bool beside = (i >= (AT - 1u)) && (i <= (AT + 1u));
            if (beside) {
                assert_int_equal(front.ring[i][1], INT16_MIN);
            } else {
                assert_true(abs(front.ring[i][1] - clean.ring[i][1]) <= 1); /* what rounding passes on is another */
            }
            assert_int_equal(front.ring[i][0], clean.ring[i][0]);
        }
    }
    run_front(&front, 0.0f, 1u, 0.05f, 0.0f);
    assert_int_not_equal(front.ring[AT][1], INT16_MIN);
    /* of 1 cm there remains the ripple's part in the cubic through the neighbours */
    assert_true(run_front(&front, 4.0f, 0u, 0.01f, 0.0f));
    const int gated = largest_difference(&front, &clean);
    assert_true((gated > 0) && ((50 * gated) < INT16_MAX));
    assert_false(run_front(&front, 0.0f, 0u, 0.01f, 0.0f)); /* beyond the range of INT16_MAX */
}

static void test_a_jump_is_no_wild_sample_and_becomes_the_usual(void **state)
{
    static pvid_refine_front_f32 front;
    run_front(&front, 4.0f, 1u, 0.0f, 0.2f);
    for (uint32_t i = 0; i < front.next; i++) {
        assert_int_not_equal(front.ring[i][1], INT16_MIN);
    }
    assert_true((front.usual[1] > 0.5f) && (front.usual[1] < 0.7f)); /* three times the jump */
}

/* ---- ticks ---- */

/* Ticks of 2000 at which the refinement worked, while the weak form is busy at all but every `period`-th one. */
static uint32_t worked(uint32_t period)
{
    const pvid_estimate_f32 weak = weak_estimate();
    uint32_t ticks = 0;
    begin_run();
    for (uint32_t i = 0; i < 2000u; i++) {
        const uint8_t phase = refinement.phase;
        const uint8_t job = refinement.work.job;
        const uint16_t step = refinement.work.step;
        const bool busy = (i % period) != 0u;
        (void)pvid_refine_step_f32(&refinement, samples[i], (i == FIRST_WEAK) ? &weak : NULL, busy);
        ticks +=
            ((phase != refinement.phase) || (job != refinement.work.job) || (step != refinement.work.step)) ? 1u : 0u;
    }
    return ticks;
}

static void test_a_busy_weak_form_does_not_starve_it(void **state)
{
    const uint32_t alone = worked(1u);
    assert_true(alone > 400u);
    for (uint32_t period = 2; period < 10u; period++) {
        assert_true((5u * worked(period)) >= (2u * alone)); /* at worst three ticks of seven: one enters the ring */
    }
}

static void test_it_rests_at_so_many_ticks_in_a_row(void **state)
{
    begin_run();
    refinement.config.rests = 3;
    uint32_t tick = run_until(has_taken, 0);
    while ((refinement.waiting) || (refinement.front.wait < 6u)) {
        (void)pvid_refine_step_f32(&refinement, samples[tick], NULL, false);
        tick++;
    }
    const pvid_refine_f32 before = refinement;
    for (uint32_t i = 0; i < 3u; i++) {
        (void)pvid_refine_step_f32(&refinement, samples[tick + i], NULL, true);
        assert_memory_equal(&refinement.work, &before.work, sizeof before.work);
        assert_int_equal(refinement.phase, before.phase);
    }
    (void)pvid_refine_step_f32(&refinement, samples[tick + 3u], NULL, true);
    assert_true((refinement.phase != before.phase) ||
                (memcmp(&refinement.work, &before.work, sizeof before.work) != 0));
}

static int prepare(void **state)
{
    measure();
    simulate();
    return 0;
}

/* A mean of so many samples droops by (1 - 1/ratio^2)/24 of the second difference of the means; of a held input, whose
 * own steps droop too, by (1 + 1/ratio^2)/24. */
static void test_a_droop_is_that_of_the_samples_of_a_mean(void **state)
{
    static pvid_refine_front_f32 front;
    for (uint16_t ratio = 1; ratio <= 8u; ratio++) {
        pvid_refine_config_f32 config = sampled();
        pvid_refine_signal_f32 signal[PVID_REFINE_SIGNALS];
        memcpy(signal, config.signal, sizeof signal);
        config.signal = signal;
        config.ratio = ratio;
        for (size_t i = 0; i < PVID_REFINE_SIGNALS; i++) {
            signal[i].source = (uint8_t)((i == 0u) ? PVID_SIGNAL_HELD : PVID_SIGNAL_SAMPLED);
        }
        pvid_refine_front_init_f32(&front, &config);
        for (size_t i = 0; i < PVID_REFINE_SIGNALS; i++) {
            const double part = 1.0 / ((double)ratio * ratio);
            assert_true(fabs((double)front.droop[i] - ((1.0 + ((i == 0u) ? part : -part)) / 24.0)) < 1e-8);
        }
    }
}

static float of_p(const pvid_refine_estimate_f32 *estimate, size_t a, size_t b)
{
    return estimate->covariance[pvid_refine_place_of_p[a]][pvid_refine_place_of_p[b]];
}

/* As errors of steps: relative where they are logarithmic. The fourth of p is no logarithm. */
static void test_shared_errors_are_added_by_p_s_places(void **state)
{
    (void)state;
    const float shared[10] = {0.01f, 1.0f, 0.5f, 0.0f, 0.02f, 0.0f, -1.0f, 0.0f, 0.0f, 0.3f};
    const float sd[4] = {0.01f, 0.02f, 0.0f, 0.3f};
    const float own = 1.0e-4f;
    pvid_refine_estimate_f32 estimate;
    float r[N];
    to_floats(truth, r, N);
    pvid_refine_assess_begin_f32(&estimate);
    for (size_t i = 0; i < N; i++) {
        estimate.covariance[i][i] = own;
    }
    pvid_refine_assess_end_f32(&estimate, r, 1.0f, 1.0f);
    const pvid_refine_estimate_f32 before = estimate;
    pvid_refine_add_shared_f32(&estimate, shared);
    for (size_t a = 0; a < 4u; a++) {
        const size_t i = pvid_refine_place_of_p[a];
        const float unit = pvid_refine_is_logarithmic_f32(i) ? r[i] : 1.0f;
        assert_float_equal(estimate.se[i], unit * sqrtf(own + (sd[a] * sd[a])), 1.0e-6f * unit);
    }
    assert_float_equal(of_p(&estimate, 0, 1), 2.0e-4f, 1.0e-9f);
    assert_float_equal(of_p(&estimate, 1, 0), 2.0e-4f, 1.0e-9f);
    assert_float_equal(of_p(&estimate, 1, 3), -6.0e-3f, 1.0e-8f);
    assert_float_equal(of_p(&estimate, 0, 2), 0.0f, 0.0f); /* no error of its own */
    for (size_t i = 0; i < N; i++) {                       /* what the weak form does not have */
        const bool of_both = (i <= 2u) || (i == pvid_refine_place_of_p[3]);
        assert_true(of_both || (estimate.se[i] == before.se[i]));
    }
}

static void test_a_level_below_1_widens_nothing(void **state)
{
    const float level[] = {0.0f, 0.25f, 1.0f, 1.44f, 4.0f};
    const float root[] = {1.0f, 1.0f, 1.0f, 1.2f, 2.0f};
    for (size_t i = 0; i < sizeof level / sizeof level[0]; i++) {
        assert_float_equal(pvid_refine_root_f32(level[i]), root[i], 1e-6);
    }
    assert_true(pvid_refine_within_f32(0.9f, 1.0f) && pvid_refine_within_f32(-0.9f, 1.0f));
    assert_false(pvid_refine_within_f32(1.0f, 1.0f) || pvid_refine_within_f32(-1.0f, 1.0f));
}

/* Parameters, state, level and reason, each of them; all that is no number is one number. */
static void test_every_number_of_a_refinement_counts_in_its_hash(void **state)
{
    static pvid_refine_f32 self;
    memset(&self, 0, sizeof self);
    const uint32_t hash = pvid_fnv_refine_f32(5u, &self, PVID_UPDATED);
    for (size_t i = 0; i < PVID_REFINE_PARAMETERS; i++) {
        self.linear[i] = 1.0f;
        assert_int_not_equal(pvid_fnv_refine_f32(5u, &self, PVID_UPDATED), hash);
        self.linear[i] = 0.0f;
    }
    for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
        self.work.state[i] = 1.0f;
        assert_int_not_equal(pvid_fnv_refine_f32(5u, &self, PVID_UPDATED), hash);
        self.work.state[i] = 0.0f;
    }
    self.level = NAN;
    const uint32_t nowhere = pvid_fnv_refine_f32(5u, &self, PVID_UPDATED);
    self.level = -INFINITY;
    assert_int_equal(pvid_fnv_refine_f32(5u, &self, PVID_UPDATED), nowhere);
    self.level = 1.0f;
    assert_int_not_equal(pvid_fnv_refine_f32(5u, &self, PVID_UPDATED), nowhere);
    self.level = 0.0f;
    assert_int_not_equal(pvid_fnv_refine_f32(5u, &self, PVID_ACCUMULATED), hash);
    assert_int_equal(pvid_fnv_refine_f32(5u, &self, PVID_UPDATED), hash);
}

/* The sizes, then every constant, acceleration and output at one point. */
static void test_the_model_s_fingerprint_is_that_of_its_functions(void **state)
{
    float r[PVID_REFINE_PARAMETERS];
    float m[PVID_REFINE_CONSTANTS];
    float x[PVID_REFINE_STATES];
    float u[PVID_REFINE_ROOM_U] = {0.0f};
    float a[PVID_REFINE_COORDINATES];
    float z[PVID_REFINE_OUTPUTS];
    for (size_t i = 0; i < PVID_REFINE_PARAMETERS; i++) {
        r[i] = 0.375f + (0.140625f * (float)i);
    }
    for (size_t i = 0; i < PVID_REFINE_STATES; i++) {
        x[i] = 0.25f + (0.140625f * (float)i);
    }
    for (size_t i = 0; i < PVID_REFINE_INPUTS; i++) {
        u[i] = 0.75f + (0.140625f * (float)i);
    }
    pvid_refine_constants(r, m);
    pvid_refine_motion(m, x, &x[PVID_REFINE_STATES - PVID_REFINE_COORDINATES], u, a);
    pvid_refine_output(m, r, x, &x[PVID_REFINE_STATES - PVID_REFINE_COORDINATES], u, z);
    const uint32_t sizes[] = {PVID_REFINE_ORDER,  PVID_REFINE_COORDINATES, PVID_REFINE_INPUTS,    PVID_REFINE_OUTPUTS,
                              PVID_REFINE_MOVING, PVID_REFINE_PARAMETERS,  PVID_REFINE_CONSTANTS, PVID_REFINE_SKEW,
                              PVID_REFINE_P,      PVID_REFINE_RUNGE_KUTTA, PVID_REFINE_SIGNS,     PVID_REFINE_WIDTHS,
                              PVID_REFINE_HIDDEN};
    uint32_t expected = 3u;
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        expected = pvid_fnv_word(expected, sizes[i]);
    }
    const float *results[] = {m, a, z};
    const size_t counts[] = {PVID_REFINE_CONSTANTS, PVID_REFINE_COORDINATES, PVID_REFINE_OUTPUTS};
    for (size_t k = 0; k < 3u; k++) {
        for (size_t i = 0; i < counts[k]; i++) {
            uint32_t word;
            memcpy(&word, &results[k][i], sizeof word);
            expected = pvid_fnv_word(expected, (results[k][i] - results[k][i] == 0.0f) ? word : 0x7FC00000u);
        }
    }
    assert_int_equal(pvid_fingerprint_refine_model_f32(3u), expected);
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
        cmocka_unit_test(test_before_its_init_it_does_nothing),
        cmocka_unit_test(test_the_region_of_the_pendulum_is_that_of_positive_parameters),
        cmocka_unit_test(test_it_waits_for_the_weak_form),
        cmocka_unit_test(test_a_search_grows_in_its_first_samples),
        cmocka_unit_test(test_a_longer_block_of_used_samples_is_judged_by_its_own_level),
        cmocka_unit_test(test_behind_a_refused_longer_block_the_whole_past_is_clashed_with),
        cmocka_unit_test(test_a_search_behind_a_lost_track_remembers_the_refusals),
        cmocka_unit_test(test_a_past_whose_information_depends_on_the_point_is_given_up),
        cmocka_unit_test(test_the_gate_waits_for_the_third_pass_of_a_second_block),
        cmocka_unit_test(test_an_estimate_that_disagrees_is_held_and_the_published_one_withdrawn),
        cmocka_unit_test(test_the_published_estimate_outlives_one_refused_block_and_not_the_loss_of_the_track),
        cmocka_unit_test(test_the_best_estimate_is_the_refined_one_while_it_stands),
        cmocka_unit_test(test_a_gap_ends_a_longer_block_of_used_samples),
        cmocka_unit_test(test_rounding_to_counts_leaves_no_bias),
        cmocka_unit_test(test_a_wild_sample_is_left_out),
        cmocka_unit_test(test_a_jump_is_no_wild_sample_and_becomes_the_usual),
        cmocka_unit_test(test_a_busy_weak_form_does_not_starve_it),
        cmocka_unit_test(test_it_rests_at_so_many_ticks_in_a_row),
        cmocka_unit_test(test_a_droop_is_that_of_the_samples_of_a_mean),
        cmocka_unit_test(test_shared_errors_are_added_by_p_s_places),
        cmocka_unit_test(test_a_level_below_1_widens_nothing),
        cmocka_unit_test(test_every_number_of_a_refinement_counts_in_its_hash),
        cmocka_unit_test(test_the_model_s_fingerprint_is_that_of_its_functions),
    };
    return cmocka_run_group_tests(tests, prepare, NULL);
}
