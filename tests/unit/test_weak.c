/* The weak form of a small mechanism: jets, sums, rows and estimates against double arithmetic from the definitions;
 * what init refuses; gaps, freezing, samples beyond their range. */
#include "test.h"

#include <stdlib.h>

#include "first_order.h"
#include "weak/columns_f32.h"
#include "weak/weak_finish_f32.h"
#include "weak/weak_front_f32.h"
#include "weak/sums_f32.h"
#include "weak/white_f32.h"
#include "pvid/pvid.h"
#include "pvid/snapshot_refine.h"
#include "solve/products_f32.h"
#include "solve/state_f32.h"

static pvid_weak_f32 self;
static pvid_weak_design_f32 design;
static pvid_weak_config_f32 config;

static void init(void)
{
    assert_int_equal(pvid_weak_init_f32(&self, &config), PVID_OK);
}

/* An identifier of the mechanism, whose design and settings a test may change before it calls init again. */
static void start(void)
{
    design = design_of(&mechanism);
    config = config_of(&design);
    init();
}

/* ---- estimates ---- */

static void parameters_are_found_within_their_errors(void **state)
{
    start();
    first_order rig = {.generator = 1u};
    uint32_t updates = 0;
    for (int tick = 0; tick < 12000; tick++) {
        float sample[2];
        next_sample(&rig, sample);
        const pvid_reason reason = pvid_weak_step_f32(&self, sample);
        if ((reason == PVID_UPDATED) || (reason == PVID_MISFIT)) {
            updates++;
        }
    }
    pvid_estimate_f32 read;
    uint32_t number = 0;
    assert_true(pvid_weak_read_f32(&self, &read, &number));
    assert_int_equal(number, updates);
    assert_true(updates > 200u);
    const pvid_estimate_f32 *estimate = pvid_weak_estimate_f32(&self);
    assert_memory_equal(estimate, &read, sizeof read);
    for (int i = 0; i < 4; i++) {
        assert_true(estimate->se[i] < 0.01f);
        assert_true(fabs((double)estimate->p[i] - truth[i]) < 5.0 * (double)estimate->se[i]);
        /* the standard error squared is the covariance's diagonal */
        assert_float_equal(estimate->covariance[i][i] / (estimate->se[i] * estimate->se[i]), 1.0f, 1e-5);
    }
}

/* A larger standard error than that of the assessment: an unknown input that is no noise of the sensors. */
static void scatter_of_the_windows_widens_the_standard_errors(void **state)
{
    float se[2][4];
    for (int disturbed = 0; disturbed < 2; disturbed++) {
        start();
        first_order rig = {.generator = 5u};
        for (int tick = 0; tick < 6000; tick++) {
            float sample[2];
            next_sample(&rig, sample);
            rig.x += (disturbed != 0) ? (3.0 * (double)noise_of(&rig)) : 0.0;
            (void)pvid_weak_step_f32(&self, sample);
        }
        memcpy(se[disturbed], pvid_weak_estimate_f32(&self)->se, sizeof se[disturbed]);
    }
    for (int i = 0; i < 4; i++) {
        assert_true(se[1][i] > 10.0f * se[0][i]);
    }
}

/* ---- sums ---- */

/* S_h of the last whole window from its definition: `x` are the values of the channels' gains at its 2 HOP steps. */
static void sum_of(const double channel[2 * HOP], int h, double out[2])
{
    out[0] = 0.0;
    out[1] = 0.0;
    for (int k = 0; k < 2 * HOP; k++) {
        const double turn = PI * (double)h * (double)k / (double)HOP;
        out[0] += channel[k] * cos(turn);
        out[1] += channel[k] * sin(turn);
    }
}

/* Integrals of x from the window's start by a rule of its own: fine trapezoids of the cubic through the steps. */
static void sums_are_those_of_the_definition(void **state)
{
    start();
    /* the integrand is the second sample: here a sine, whose integrals are known */
    const double w = 11.0;
    int tick = 0;
    while (self.finish.stage == PVID_WEAK_IDLE) {
        const double t = (double)tick / RATE;
        const float sample[2] = {(float)(1.5 + cos(5.0 * t)), (float)sin(w * t)};
        (void)pvid_weak_step_f32(&self, sample);
        tick++;
        assert_true(tick < 4 * HOP);
    }
    const double first = 0.0;
    double channel[CHANNELS][2 * HOP];
    for (int k = 0; k < 2 * HOP; k++) {
        const double t = first + ((double)k / RATE);
        const double u = 1.5 + cos(5.0 * t);
        const double since = (double)k / RATE;
        const double once = (cos(w * first) - cos(w * t)) / w;
        const double twice = ((since * cos(w * first)) / w) - ((sin(w * t) - sin(w * first)) / (w * w));
        channel[U][k] = u;
        channel[U_I1][k] = u * once;
        channel[U_T][k] = u * since;
        channel[U_I2][k] = u * twice;
        channel[X][k] = sin(w * t);
        channel[SIGN][k] = 1.0;
    }
    for (int c = 0; c < ONE; c++) {
        double size = 0.0;
        for (int k = 0; k < 2 * HOP; k++) {
            size += fabs(channel[c][k]);
        }
        for (int h = 0; h <= HIGHEST; h++) {
            double sum[2];
            sum_of(channel[c], h, sum);
            assert_true(fabs((double)pvid_weak_window_f32(&self)[h][c][0] - sum[0]) < 3e-6 * size);
            assert_true(fabs((double)pvid_weak_window_f32(&self)[h][c][1] - sum[1]) < 3e-6 * size);
        }
    }
}

/* ---- rows ---- */

/* sin^n(pi t/T) {1, cos, sin}(2 pi f (t/T - 1/2)) and its derivative at step k. */
static void function_of(int place, int k, double out[2])
{
    const double length = 2.0 * (double)HOP / RATE;
    const double s = (double)k / (2.0 * (double)HOP);
    const double f = (double)((place + 1) / 2);
    const double bell = pow(sin(PI * s), (double)POWER);
    const double slope = (double)POWER * pow(sin(PI * s), (double)POWER - 1.0) * cos(PI * s) * PI / length;
    const double turn = 2.0 * PI * f * (s - 0.5);
    const double rate = 2.0 * PI * f / length;
    if ((place == 0) || ((place % 2) != 0)) {
        out[0] = bell * cos(turn);
        out[1] = (slope * cos(turn)) - (bell * rate * sin(turn));
    } else {
        out[0] = bell * sin(turn);
        out[1] = (slope * sin(turn)) + (bell * rate * cos(turn));
    }
}

/* x <- R^-1 x by Gauss-Jordan, for some columns. */
static void solve(double r[FUNCTIONS][FUNCTIONS], double x[5][FUNCTIONS])
{
    for (int i = 0; i < FUNCTIONS; i++) {
        const double pivot = r[i][i];
        for (int j = 0; j < FUNCTIONS; j++) {
            r[i][j] /= pivot;
        }
        for (int c = 0; c < 5; c++) {
            x[c][i] /= pivot;
        }
        for (int k = 0; k < FUNCTIONS; k++) {
            const double factor = (k == i) ? 0.0 : r[k][i];
            for (int j = 0; j < FUNCTIONS; j++) {
                r[k][j] -= factor * r[i][j];
            }
            for (int c = 0; c < 5; c++) {
                x[c][k] -= factor * x[c][i];
            }
        }
    }
}

/* The moments of the white rows are N^T R^-1 N of the test functions, R = T D T^T the covariance of sensor noise. */
/* Of a white row: theta's columns, then Y, in whose place is e at the start of p. */
static double row_entry(int column, size_t row)
{
    double entry = (double)self.finish.work.rows.of_kind.column[column][row];
    for (int j = 0; (column == 4) && (j < 4); j++) {
        entry += (double)self.estimator.theta[j] * (double)self.finish.work.rows.of_kind.column[j][row];
    }
    return entry;
}

static void rows_have_the_moments_of_generalised_least_squares(void **state)
{
    start();
    config.gate.sigmas = 0.0f;
    first_order rig = {.generator = 9u};
    static float given[4 * HOP][2];
    int ticks = 0;
    while (self.finish.stage == PVID_WEAK_IDLE) {
        assert_true(ticks < 4 * HOP);
        next_sample(&rig, given[ticks]);
        (void)pvid_weak_step_f32(&self, given[ticks]);
        ticks++;
    }
    while (self.estimator.counters.rows < FUNCTIONS) { /* all rows of the first window, and no stage behind them */
        pvid_weak_finish_run_f32(&self, 1);
    }
    double psi[5][2 * HOP]; /* what the functions, or for the last column their derivatives, multiply */
    for (int k = 0; k < 2 * HOP; k++) {
        const double u = (double)given[k][0];
        const double g =
            0.5 * ((double)given[k + 1][0] - (double)given[(k > 0) ? (k - 1) : 0][0]) * ((k > 0) ? 1.0 : 2.0);
        const double sign = 2.0 * u / fabs(g);
        psi[0][k] = u;
        psi[1][k] = -(double)given[k][1];
        psi[2][k] = 1.0;
        psi[3][k] = (sign > 1.0) ? 1.0 : ((sign < -1.0) ? -1.0 : sign);
        psi[4][k] = (double)given[k][1];
    }
    double n[5][FUNCTIONS] = {{0.0}};
    double r[FUNCTIONS][FUNCTIONS] = {{0.0}};
    const double b = 3.0; /* of the start, at which the first window is made white */
    for (int k = 0; k < 2 * HOP; k++) {
        double chi[FUNCTIONS][2];
        for (int i = 0; i < FUNCTIONS; i++) {
            function_of(i, k, chi[i]);
            for (int c = 0; c < 4; c++) {
                n[c][i] += chi[i][0] * psi[c][k];
            }
            n[4][i] -= chi[i][1] * psi[4][k];
        }
        for (int i = 0; i < FUNCTIONS; i++) {
            for (int j = 0; j < FUNCTIONS; j++) {
                r[i][j] += SD * SD * ((chi[i][1] * chi[j][1]) + (b * b * chi[i][0] * chi[j][0]));
            }
        }
    }
    double x[5][FUNCTIONS];
    memcpy(x, n, sizeof x);
    solve(r, x);
    const size_t rows = FUNCTIONS;
    for (int a = 0; a < 5; a++) {
        for (int c = 0; c < 5; c++) {
            double expected = 0.0;
            double found = 0.0;
            double sizes[2] = {0.0, 0.0};
            for (int i = 0; i < FUNCTIONS; i++) {
                expected += n[a][i] * x[c][i];
                sizes[0] += n[a][i] * x[a][i];
                sizes[1] += n[c][i] * x[c][i];
            }
            for (size_t i = 0; i < rows; i++) {
                found += row_entry(a, i) * row_entry(c, i);
            }
            assert_true(fabs(found - expected) < 2e-4 * sqrt(sizes[0] * sizes[1]));
        }
    }
    /* the noise that they are made white against has the variance 1 in them */
    assert_float_equal(pvid_weak_white_sensors_f32(&self.finish.white, &design), 1.0f, 1e-4);
}

/* ---- front end ---- */

static const pvid_weak_signal derived[3] = {{0, PVID_SIGNAL_HELD}, {0, PVID_SIGNAL_JUMP}, {1, PVID_SIGNAL_SAMPLED}};
static const pvid_weak_jet derived_jets[4] = {{0, 0}, {1, 0}, {2, 0}, {2, 1}};
static const float smooth[3] = {0.3f, 0.2f, -0.1f};
static const float slope[5] = {10.0f, 8.0f, 5.0f, -3.0f, 1.0f};
static const pvid_weak_filter_f32 derived_filters[4] = {{0, NULL}, {0, NULL}, {3, smooth}, {5, slope}};

/* Samples that have no pattern. */
static double sample_at(int tick, int place)
{
    const uint32_t mixed = ((uint32_t)(tick + 100) * 2654435761u) ^ ((uint32_t)(place + 1) * 40503u);
    return ((double)((mixed >> 7) % 20011u) / 10000.0) - 1.0;
}

/* A signal of `derived` at a tick. */
static double signal_at(int tick, int place)
{
    if (place == 0) {
        const double inner = 13.0 * (sample_at(tick - 1, 0) + sample_at(tick, 0));
        return (inner - sample_at(tick - 2, 0) - sample_at(tick + 1, 0)) / 24.0;
    }
    return (place == 1) ? ((sample_at(tick, 0) - sample_at(tick - 1, 0)) / (12.0 * RATE)) : sample_at(tick, 1);
}

/* Its mean about a tick with the weights 1, .., D, .., 1. */
static double mean_at(int tick, int place, int decimation)
{
    double sum = 0.0;
    for (int k = 1 - decimation; k < decimation; k++) {
        sum += (decimation - abs(k)) * signal_at(tick + k, place);
    }
    return sum / (decimation * decimation);
}

static void jets_are_those_of_the_filters_for_every_decimation(void **state)
{
    pvid_weak_model_f32 model = mechanism;
    model.signals = 3;
    model.signal = derived;
    model.jets = 4;
    model.jet = derived_jets;
    design = design_of(&model);
    design.compensator = derived_filters;
    static const uint8_t decimations[6] = {1, 2, 3, 7, 8, 20};
    for (size_t i = 0; i < 6u; i++) {
        const int d = decimations[i];
        design.decimation = decimations[i];
        static pvid_weak_front_f32 front;
        memset(&front, 0, sizeof front);
        pvid_weak_front_init_f32(&front, &design, (float)RATE);
        assert_int_equal(pvid_weak_front_lead_f32(&front), (d == 1) ? 5 : (6 * d));
        int steps = 0;
        for (int tick = 0; tick < 600; tick++) {
            const float sample[2] = {(float)sample_at(tick, 0), (float)sample_at(tick, 1)};
            float jet[4];
            pvid_weak_front_derive_f32(&front, &model, sample);
            front.wait--;
            if ((front.wait > 0u) || !pvid_weak_front_step_f32(&front, &design, jet)) {
                continue;
            }
            const int at = pvid_weak_front_lead_f32(&front) + (steps * d);
            steps++;
            if (at < (6 * d) + 2) {
                continue; /* the samples before the first one are not those of sample_at */
            }
            const double centre = mean_at(at, 2, d);
            double value = centre;
            double rate = 0.0;
            for (int k = 1; k <= 3; k++) {
                const double around = mean_at(at + (k * d), 2, d) + mean_at(at - (k * d), 2, d) - (2.0 * centre);
                value += (double)smooth[k - 1] * around;
            }
            for (int k = 1; k <= 5; k++) {
                rate += (double)slope[k - 1] * (mean_at(at + (k * d), 2, d) - mean_at(at - (k * d), 2, d));
            }
            assert_float_equal(jet[0], mean_at(at, 0, d), 1e-5);
            assert_float_equal(jet[1], mean_at(at, 1, d), 1e-8);
            assert_float_equal(jet[2], value, 1e-5);
            assert_float_equal(jet[3], rate, 1e-4);
        }
        assert_true(steps >= (600 / d) - 12);
    }
}

/* ---- schedule ---- */

/* A window needs no more stages than init has counted, and hardly less, and ends before the next one begins. */
static void stages_are_as_many_as_counted(void **state)
{
    for (int compensation = 0; compensation < 2; compensation++) {
        start();
        config.compensation = compensation != 0;
        init();
        first_order rig = {.generator = 3u};
        while (self.finish.stage == PVID_WEAK_IDLE) {
            float sample[2];
            next_sample(&rig, sample);
            (void)pvid_weak_step_f32(&self, sample);
        }
        uint32_t stages = 0;
        pvid_weak_finish_begin_f32(&self.finish);
        while (self.finish.stage != PVID_WEAK_IDLE) {
            pvid_weak_finish_run_f32(&self, 1);
            stages++;
        }
        /* "at most" counts one stage too many for a column with terms, and one for nuisances */
        const uint32_t most = pvid_weak_finish_stages_f32(&self);
        assert_in_range(most, stages, stages + mechanism.kind[0].thetas + 2u);
    }
}

static void assessment_takes_the_stated_number_of_stages(void **state)
{
    start();
    first_order rig = {.generator = 1u};
    for (int i = 0; i < 10 * HOP; i++) {
        float sample[2];
        next_sample(&rig, sample);
        (void)pvid_weak_step_f32(&self, sample);
    }
    static pvid_estimator_solve_f32 solve;
    pvid_estimate_f32 estimate;
    pvid_estimator_begin_assessment_f32(&self.estimator, &solve, &estimate);
    uint32_t stages = 1;
    while (!pvid_estimator_assess_advance_f32(&self.estimator, &solve)) {
        stages++;
    }
    assert_int_equal(stages, pvid_estimator_assessment_stages_f32(&self.estimator));
    assert_true(pvid_estimator_assess_advance_f32(&self.estimator, &solve)); /* nothing is left to do */
}

static void a_window_that_cannot_be_processed_in_time_is_refused(void **state)
{
    start();
    static pvid_weak_noise_f32 many[2100]; /* eight a stage, twice */
    for (size_t i = 0; i < 2100u; i++) {
        many[i] = noise[i % 2u];
    }
    design.noise = many;
    design.n_noise = 2100;
    /* one block of eight ticks in which the window's work would have to be done, less those for sums */
    design.hop = 16;
    config.iterations = PVID_MAX_ITERATIONS;
    assert_int_equal(pvid_weak_init_f32(&self, &config), PVID_BAD_ITERATIONS);
}

/* Two designs that differ in the decimation alone. Of the slow one only the first sample of a block is not 0, D times
 * that of the other, of few bits: so the block sums are exact, and equal the other's samples. Its first block is lost.
 */
static void estimates_do_not_depend_on_the_slices_of_the_schedule(void **state)
{
    float p[2][4];
    for (int slow = 0; slow < 2; slow++) {
        const int d = (slow != 0) ? 8 : 1;
        start();
        design.decimation = (uint8_t)d;
        config.sample_rate_hz = (float)(d * RATE);
        init();
        first_order rig = {.generator = 7u};
        for (int step = -slow; step < 1500; step++) {
            float sample[2] = {0.0f, 0.0f};
            if (step >= 0) {
                next_sample(&rig, sample);
            }
            for (int tick = 0; tick < d; tick++) {
                const float few[2] = {(tick == 0) ? (float)d * ldexpf(rintf(ldexpf(sample[0], 14)), -14) : 0.0f,
                                      (tick == 0) ? (float)d * ldexpf(rintf(ldexpf(sample[1], 14)), -14) : 0.0f};
                (void)pvid_weak_step_f32(&self, few);
            }
        }
        for (int tick = 0; tick < 2000; tick++) { /* what is in processing ends; no window is complete */
            if (self.finish.stage != PVID_WEAK_IDLE) {
                pvid_weak_finish_run_f32(&self, 1);
            }
        }
        memcpy(p[slow], self.estimator.p, sizeof p[slow]);
        assert_true(self.estimator.counters.updates > 10u);
    }
    assert_memory_equal(p[0], p[1], sizeof p[0]);
}

/* ---- gaps, freezing, limits ---- */

static uint32_t run(first_order *rig, int ticks, uint32_t reasons[16])
{
    memset(reasons, 0, 16u * sizeof reasons[0]);
    for (int tick = 0; tick < ticks; tick++) {
        float sample[2];
        next_sample(rig, sample);
        reasons[pvid_weak_step_f32(&self, sample)]++;
    }
    return reasons[PVID_UPDATED] + reasons[PVID_MISFIT] + reasons[PVID_HELD_UNCERTAIN];
}

static void a_gap_restarts_the_windows_and_keeps_the_sums(void **state)
{
    uint32_t reasons[16];
    start();
    first_order rig = {.generator = 2u};
    assert_true(run(&rig, 30 * HOP, reasons) > 20u);
    const float run_before = self.history.run[0];
    const uint32_t rows = self.estimator.counters.rows;
    pvid_weak_gap_f32(&self);
    (void)run(&rig, 2 * HOP, reasons);
    assert_int_equal(reasons[PVID_WARMING_UP], (2 * HOP) - reasons[PVID_UPDATED] - reasons[PVID_MISFIT]);
    assert_true(self.estimator.counters.rows - rows <= FUNCTIONS); /* the window that was in processing */
    assert_true(fabs((double)(self.history.run[0] - run_before)) < 2.0);
    assert_true(run(&rig, 10 * HOP, reasons) >= 8u);
    assert_true(self.trust.published);
}

static void a_sample_that_is_not_finite_is_rejected_and_restarts(void **state)
{
    uint32_t reasons[16];
    start();
    first_order rig = {.generator = 4u};
    (void)run(&rig, 20 * HOP, reasons);
    const float bad[3] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++) {
        const float sample[2] = {0.0f, bad[i]};
        assert_int_equal(pvid_weak_step_f32(&self, sample), PVID_REJECTED_NOT_FINITE);
        const float other[2] = {bad[i], 0.0f};
        assert_int_equal(pvid_weak_step_f32(&self, other), PVID_REJECTED_NOT_FINITE);
    }
    assert_int_equal(self.estimator.counters.rejected_not_finite, 6);
    (void)run(&rig, HOP, reasons);
    assert_true(reasons[PVID_WARMING_UP] > 0u);
    assert_true(run(&rig, 10 * HOP, reasons) >= 7u);
    for (int i = 0; i < 4; i++) {
        assert_true(isfinite(self.estimator.p[i]));
    }
}

static void a_frozen_identifier_drops_windows_and_resumes(void **state)
{
    uint32_t reasons[16];
    start();
    first_order rig = {.generator = 6u};
    (void)run(&rig, 20 * HOP, reasons);
    pvid_weak_freeze_f32(&self, true);
    (void)run(&rig, 2 * HOP, reasons);
    const uint32_t rows = self.estimator.counters.rows;
    (void)run(&rig, 5 * HOP, reasons);
    assert_int_equal(reasons[PVID_HELD_FROZEN], 5);
    assert_int_equal(self.estimator.counters.rows, rows);
    assert_true(self.finish.no_predecessor); /* the next window has no neighbour */
    pvid_weak_freeze_f32(&self, false);
    assert_true(run(&rig, 5 * HOP, reasons) >= 4u);
}

static void windows_beyond_a_range_or_without_motion_are_dropped(void **state)
{
    uint32_t reasons[16];
    const float range[2] = {10.0f, 10.0f};
    const float least[2] = {0.1f, 0.0f};
    start();
    config.range = range;
    config.drive_min = least;
    init();
    first_order rig = {.generator = 9u};
    (void)run(&rig, 10 * HOP, reasons);
    assert_int_equal(reasons[PVID_HELD_OUT_OF_RANGE], 0);
    const uint32_t held = self.estimator.counters.held_not_excited;
    assert_in_range(held, 0, 1); /* by the solve of the first window, not by its range */
    const float beyond[2] = {0.0f, -10.5f};
    (void)pvid_weak_step_f32(&self, beyond);
    (void)run(&rig, 4 * HOP, reasons);
    assert_in_range(reasons[PVID_HELD_OUT_OF_RANGE], 2, 3); /* those that contain it, and the seam */
    assert_int_equal(reasons[PVID_HELD_OUT_OF_RANGE], self.estimator.counters.held_out_of_range);
    memset(reasons, 0, sizeof reasons);
    for (int tick = 0; tick < 4 * HOP; tick++) {
        const float still[2] = {(tick % 2 == 0) ? 5.09f : 5.0f, 0.0f};
        reasons[pvid_weak_step_f32(&self, still)]++;
    }
    assert_in_range(reasons[PVID_HELD_NOT_EXCITED], 2, 3);
    assert_int_equal(reasons[PVID_HELD_NOT_EXCITED], self.estimator.counters.held_not_excited - held);
}

/* A sensor that stands still from one tick on, then moves: windows with one such half are dropped too. */
static void a_half_without_motion_drops_both_windows_that_it_is_in(void **state)
{
    const float least[2] = {0.0f, 0.1f};
    start();
    config.drive_min = least;
    init();
    first_order rig = {.generator = 9u};
    uint32_t reasons[16];
    (void)run(&rig, 10 * HOP, reasons);
    while (self.sums.index != 0u) { /* to the end of a half */
        (void)run(&rig, 1, reasons);
    }
    const uint32_t held = self.estimator.counters.held_not_excited;
    const float stuck[2] = {1.0f, 1.0f};
    while (self.sums.index + 1u < HOP) {
        (void)pvid_weak_step_f32(&self, stuck);
    }
    (void)pvid_weak_step_f32(&self, stuck);
    assert_true(self.limits.still[self.sums.half ^ 1u]);
    (void)run(&rig, 4 * HOP, reasons);
    assert_int_equal(self.estimator.counters.held_not_excited - held, 2);
}

/* Steps at which a sign is in doubt: up to a twentieth of a half, 2 of 48, are those of a reversal. */
static void a_half_with_a_sign_in_doubt_for_long_drops_both_windows_that_it_is_in(void **state)
{
    const float doubt[1] = {0.125f};
    uint32_t all = 0u; /* rows of all windows */
    for (uint32_t steps = 0u; steps <= 3u; steps++) {
        start();
        design.sign_doubt = doubt;
        config.estimator.noise_margin = 0.0f; /* so fast a motion excites little: no solve is to be held for that */
        config.estimator.kappa_min = 0.0f;
        config.trust.kappa_min = 0.0f;
        init();
        uint32_t dropped = 0u;
        for (uint32_t tick = 0u; tick < (10u * HOP); tick++) {
            const bool doubtful = (tick >= ((5u * HOP) + 8u)) && (tick < ((5u * HOP) + 8u + steps));
            const float sign = ((tick % 2u) == 0u) ? 1.0f : -1.0f;
            const float sample[2] = {sign * (doubtful ? 0.125f : 0.126f), 0.0f};
            dropped += (self.limits.doubt[0] || self.limits.doubt[1]) ? 1u : 0u;
            (void)pvid_weak_step_f32(&self, sample);
        }
        assert_int_equal(dropped, (steps > (HOP / PVID_WEAK_DOUBT)) ? (2u * HOP) : 0u);
        all = (steps == 0u) ? self.estimator.counters.rows : all;
        assert_true((self.estimator.counters.rows < all) == (steps > (HOP / PVID_WEAK_DOUBT)));
    }
}

static void outliers_are_rejected_by_the_gate(void **state)
{
    uint32_t reasons[16];
    start();
    config.gate.sigmas = 4.0f;
    init();
    first_order rig = {.generator = 10u};
    (void)run(&rig, 40 * HOP, reasons);
    float p[4];
    memcpy(p, self.estimator.p, sizeof p);
    const float spike[2] = {0.0f, 5.0f};
    (void)pvid_weak_step_f32(&self, spike);
    (void)run(&rig, (3 * HOP) - 20, reasons);
    assert_true(reasons[PVID_REJECTED_OUTLIER] >= 1u);
    assert_int_equal(self.estimator.counters.rejected_outlier, reasons[PVID_REJECTED_OUTLIER]);
    for (int i = 0; i < 4; i++) {
        assert_float_equal(self.estimator.p[i], p[i], 0.02);
    }
}

/* The sensor shows 0.6 times as much from one tick on, as with another a, c and d. The gate rejects, then opens: the
 * estimate is withdrawn, and p starts at the trusted one, until the new one is known. */
static void a_changed_mechanism_withdraws_until_it_is_known_anew(void **state)
{
    uint32_t reasons[16];
    start();
    config.gate.sigmas = 4.0f;
    config.gate.patience_s = (float)(10.0 * HOP / RATE);
    init();
    first_order rig = {.generator = 12u};
    (void)run(&rig, 40 * HOP, reasons);
    assert_int_equal(self.trust.estimate.standing.state, PVID_STANDING_VALID);
    bool opened = false;
    bool doubted = false;
    for (int tick = 0; tick < 80 * HOP; tick++) {
        float sample[2];
        next_sample(&rig, sample);
        sample[1] *= 0.6f;
        (void)pvid_weak_step_f32(&self, sample);
        const pvid_standing *standing = &self.trust.estimate.standing;
        doubted = doubted || (standing->causes == PVID_DOUBT_REJECTS);
        if (!opened && (standing->state == PVID_STANDING_WITHDRAWN)) {
            opened = true;
            assert_int_equal(standing->causes, PVID_DOUBT_CHANGED);
            assert_memory_equal(self.estimator.p, self.trust.trusted, sizeof self.trust.trusted);
            assert_float_equal(self.estimator.p[0], truth[0], 0.1);
            assert_true(self.estimator.information.high[0] + self.estimator.information.low[0] < 1.0e-30f);
        }
    }
    assert_true(doubted && opened);
    assert_int_equal(self.trust.estimate.standing.state, PVID_STANDING_VALID);
    assert_float_equal(self.trust.estimate.p[0], 0.6 * truth[0], 0.1);
}

/* ---- init ---- */

/* The tables of model and design: test_weak_valid.c; all numbers of the configuration: tests/core/test_bad_config.py.
 */
static void init_names_what_is_out_of_range(void **state)
{
#define REFUSES(what, status)                                                                                          \
    do {                                                                                                               \
        start();                                                                                                       \
        what;                                                                                                          \
        assert_int_equal(pvid_weak_init_f32(&self, &config), status);                                                  \
        assert_null(self.design);                                                                                      \
    } while (0)
    static const float negative[1] = {-1.0f};
    static const float zero_range[2] = {1.0f, 0.0f};
    static const float not_a_number[2] = {NAN, 0.0f};
    REFUSES(config.design = NULL, PVID_BAD_DESIGN);
    REFUSES(design.model = NULL, PVID_BAD_MODEL);
    REFUSES(design.functions = 3, PVID_BAD_FUNCTIONS);
    REFUSES(config.sample_rate_hz = NAN, PVID_BAD_SAMPLE_RATE);
    REFUSES(config.range = zero_range, PVID_BAD_RANGE);
    REFUSES(config.drive_min = not_a_number, PVID_BAD_DRIVE_MIN);
    REFUSES(config.trust.shared = not_a_number, PVID_BAD_SHARED);
    REFUSES(design.sign_doubt = negative, PVID_BAD_DESIGN);
}

static void without_a_second_stage_there_is_no_snapshot_of_one(void **state)
{
    static uint8_t image[PVID_SNAPSHOT_REFINE_F32];
    start();
    assert_int_equal(pvid_snapshot_save_refine_f32(&self, &config, 1, image, sizeof image), 0);
    assert_int_equal(pvid_snapshot_restore_refine_f32(&self, &config, image, sizeof image), PVID_SNAPSHOT_NOT_READY);
}

/* ---- nuisances ---- */

static void a_nuisance_that_those_before_it_explain_is_skipped(void **state)
{
    const float first[4] = {1.0f, 2.0f, 2.0f, 0.0f};
    float second[4] = {2.0f, 4.0f, 4.0001f, 0.0f};
    const float whole = pvid_product_f32(second, second, 4);
    float inverse = 0.0f;
    assert_true(pvid_weak_columns_keep_f32(4, first, pvid_product_f32(first, first, 4), &inverse));
    assert_float_equal(inverse, 1.0f / 9.0f, 1e-7);
    pvid_weak_columns_project_f32(4, first, inverse, second);
    assert_false(pvid_weak_columns_keep_f32(4, second, whole, &inverse));
    assert_float_equal(inverse, 0.0f, 0.0);
    float column[4] = {3.0f, 1.0f, -1.0f, 2.0f};
    pvid_weak_columns_project_f32(4, first, 1.0f / 9.0f, column);
    assert_float_equal((column[0] + (2.0f * column[1])) + (2.0f * column[2]), 0.0f, 1e-5);
    const float nothing[4] = {0.0f};
    assert_false(pvid_weak_columns_keep_f32(4, nothing, 0.0f, &inverse));
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(parameters_are_found_within_their_errors),
    cmocka_unit_test(scatter_of_the_windows_widens_the_standard_errors),
    cmocka_unit_test(sums_are_those_of_the_definition),
    cmocka_unit_test(rows_have_the_moments_of_generalised_least_squares),
    cmocka_unit_test(jets_are_those_of_the_filters_for_every_decimation),
    cmocka_unit_test(stages_are_as_many_as_counted),
    cmocka_unit_test(assessment_takes_the_stated_number_of_stages),
    cmocka_unit_test(a_window_that_cannot_be_processed_in_time_is_refused),
    cmocka_unit_test(estimates_do_not_depend_on_the_slices_of_the_schedule),
    cmocka_unit_test(a_gap_restarts_the_windows_and_keeps_the_sums),
    cmocka_unit_test(a_sample_that_is_not_finite_is_rejected_and_restarts),
    cmocka_unit_test(a_frozen_identifier_drops_windows_and_resumes),
    cmocka_unit_test(windows_beyond_a_range_or_without_motion_are_dropped),
    cmocka_unit_test(a_half_without_motion_drops_both_windows_that_it_is_in),
    cmocka_unit_test(a_half_with_a_sign_in_doubt_for_long_drops_both_windows_that_it_is_in),
    cmocka_unit_test(outliers_are_rejected_by_the_gate),
    cmocka_unit_test(a_changed_mechanism_withdraws_until_it_is_known_anew),
    cmocka_unit_test(init_names_what_is_out_of_range),
    cmocka_unit_test(without_a_second_stage_there_is_no_snapshot_of_one),
    cmocka_unit_test(a_nuisance_that_those_before_it_explain_is_skipped),
};
RUN(tests)
