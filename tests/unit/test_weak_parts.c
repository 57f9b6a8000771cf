/* The parts of the weak form one by one: front end, double integrals, projection, products by pattern. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solve/pattern_f32.h"
#include "pvid/pvid.h"
#include "weak/finish_f32.h"
#include "weak/front_f32.h"
#include "weak/schedule.h"
#include "weak_table.h"
#include "weak/window_f32.h"

static void assert_close(double value, double expected, double tolerance)
{
    assert_true(((value - expected) <= tolerance) && ((expected - value) <= tolerance));
}

/* ---- front end ---- */

static void the_front_end_keeps_its_schedule_and_reproduces_a_parabola(void **state)
{
    (void)state;
    static pvid_weak_front_f32 front;
    pvid_weak_front_init_f32(&front, &table_design, 1000.0f, 0.5f);
    assert_int_equal(pvid_weak_job_ticks(&front.job), 2); /* two pairs of taps, one a tick */
    int outputs = 0;
    for (int i = 0; i < 200; i++) {
        float phi = -1.0f;
        float u = -1.0f;
        const double t = 1.0e-3 * i;
        const float y = (float)(40.0 * t * t);
        if (pvid_weak_front_step_f32(&front, 0.25f, y, &phi, &u)) {
            /* blocks of five samples end at ticks 4, 12, .. and are worked off in two */
            assert_int_equal((i - 5) % TABLE_DECIMATION, 0);
            assert_true(phi >= 0.25f && phi <= 0.25f); /* a constant, exactly */
            /* y'' = 80, u = 80 / 0.5; y up to 1.6 is rounded to 1e-7, times rate^2 / l1 and weights of 2 */
            assert_close((double)u, 160.0, 1.0);
            outputs++;
        } else {
            assert_true(phi <= -1.0f && u <= -1.0f);
        }
    }
    assert_int_equal(outputs, 25);
}

/* ---- a window ---- */

static uint32_t generator = 1u;

static float noise(void)
{
    generator = (generator * 1664525u) + 1013904223u;
    return ((float)(generator >> 8) / 8388608.0f) - 1.0f;
}

static const pvid_weak_curvature_f32 no_bend;

static void double_integrals_of_polynomials_are_exact_but_for_rounding(void **state)
{
    (void)state;
    pvid_weak_window_f32 window;
    memset(&window, 0, sizeof window);
    const float dt = 0.0078125f; /* a power of two: the samples are exact */
    float term[PVID_WEAK_SAMPLE_TERMS];
    for (uint16_t i = 0; i < 128u; i++) {
        window.index = i;
        const double t = (double)dt * i;
        const float phi = (float)t; /* integrates twice to t^3 / 6 */
        const float u = 2.0f;       /* to t^2 */
        pvid_weak_window_terms_f32(&window, 129, dt, phi, u, &no_bend, term);
        if (i == 0u) {
            continue;
        }
        /* the trapezoid rule less dt^2/6 f errs by a constant and a multiple of t only, and these the
         * projection removes: by -dt^2/6 for f = 1, by -dt^2/12 t for f = t */
        const double h2 = (double)dt * (double)dt;
        const double i2_t = (t * t * t / 6.0) - (h2 * t / 12.0);
        assert_close((double)term[PVID_TERM_UIF], -2.0 * i2_t, 1.0e-6);
        assert_close((double)term[PVID_TERM_UIU], 2.0 * ((t * t) - (h2 / 3.0)), 2.0e-6);
        assert_close((double)term[PVID_TERM_UI1], 2.0 * ((t * t / 2.0) - (h2 / 6.0)), 2.0e-7);
        assert_close((double)term[PVID_TERM_UIUF], -4.0 * i2_t, 1.0e-6);
        assert_close((double)term[PVID_TERM_UT], 2.0 * (t - (64.0 * (double)dt)), 1.0e-7);
        assert_close((double)term[PVID_TERM_U], 2.0, 0.0);
        assert_close((double)term[PVID_TERM_F], -t, 0.0);
    }
}

/* Against sums over one sample after the other, in the same order: every bit, whatever stood there before. */
static void two_samples_at_a_time_are_one_after_the_other(void **state)
{
    (void)state;
    static const uint8_t factor[PVID_WEAK_TERMS] = {1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 2}; /* chi'', chi, chi'''' */
    static const uint8_t of[PVID_WEAK_TERMS] = {0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 6};
    pvid_weak_window_f32 window;
    float term[2][PVID_WEAK_SAMPLE_TERMS];
    float sums[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    float expected[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    memset(&window, 0, sizeof window);
    memset(sums, 0xFF, sizeof sums); /* NaN */
    memset(expected, 0, sizeof expected);
    for (uint16_t i = 0; i < table_design.window - 1u; i++) {
        const float phi = (i == 0u) ? 1.0e30f : noise(); /* what has no weight must not matter */
        float *now = term[i % 2u];
        window.index = i;
        pvid_weak_window_terms_f32(&window, table_design.window, 0.008f, phi, (i == 0u) ? 1.0e30f : noise(), &no_bend,
                                   now);
        pvid_weak_window_add_f32(&window, &table_design, (const float (*)[PVID_WEAK_SAMPLE_TERMS])term, 0, 2, sums);
        pvid_weak_window_add_f32(&window, &table_design, (const float (*)[PVID_WEAK_SAMPLE_TERMS])term, 2,
                                 TABLE_FUNCTIONS, sums);
        const float *chi = &table_design.chi[3u * TABLE_FUNCTIONS * i];
        for (size_t k = 0; (i > 0u) && (k < TABLE_FUNCTIONS); k++) {
            for (size_t j = 0; j < PVID_WEAK_TERMS; j++) {
                const float alone = (j == (size_t)PVID_TERM_Y) ? phi : 1.0f;
                const float x = (j >= (size_t)PVID_TERM_CHI_1) ? alone : now[of[j]];
                expected[k][j] += chi[(factor[j] * TABLE_FUNCTIONS) + k] * x;
            }
        }
    }
    assert_memory_equal(sums, expected, sizeof sums);
}

static void the_drive_of_a_window_is_the_variance_of_u(void **state)
{
    (void)state;
    pvid_weak_window_f32 window;
    memset(&window, 0, sizeof window);
    float term[PVID_WEAK_SAMPLE_TERMS];
    for (int pass = 0; pass < 2; pass++) { /* the second begins afresh */
        for (uint16_t i = 0; i < 100u; i++) {
            window.index = i;
            const float u = 3.0f + (((i % 2u) == 0u) ? 0.5f : -0.5f);
            pvid_weak_window_terms_f32(&window, 101, 0.008f, 0.0f, u, &no_bend, term);
        }
        assert_close((double)pvid_weak_window_drive_f32(&window, 101), 0.25, 1.0e-5);
    }
}

static void window_has_mean_deviation_and_curvature(void **state)
{
    (void)state;
    pvid_weak_window_f32 window;
    memset(&window, 0, sizeof window);
    float term[PVID_WEAK_SAMPLE_TERMS];
    for (int pass = 0; pass < 2; pass++) { /* the second begins afresh */
        for (uint16_t i = 0; i < 100u; i++) {
            const pvid_weak_curvature_f32 curvature = {.due = (i % 10u) == 3u, .square = 0.25f};
            window.index = i;
            const float phi = 0.25f + ((i == 40u) ? 0.5f : 0.0f) - ((i == 60u) ? 0.75f : 0.0f);
            pvid_weak_window_terms_f32(&window, 101, 0.008f, phi, 1.0f, &curvature, term);
        }
        assert_close((double)pvid_weak_window_mean_f32(&window, 101), 0.2475, 1.0e-6);
        assert_close((double)pvid_weak_window_max_deviation_f32(&window, 0.0f), 0.75, 0.0);
        assert_close((double)pvid_weak_window_max_deviation_f32(&window, 0.25f), 0.75, 0.0);
        assert_close((double)pvid_weak_window_max_deviation_f32(&window, 0.75f), 1.25, 0.0);
        assert_close((double)pvid_weak_window_curvature_f32(&window), 0.25, 1.0e-7);
    }
    memset(&window, 0, sizeof window);
    assert_close((double)pvid_weak_window_curvature_f32(&window), 0.0, 0.0);
}

/* ---- a complete window ---- */

static pvid_estimator_f32 estimator_at_nominal(void)
{
    pvid_estimator_config_f32 config = pvid_estimator_defaults_f32;
    pvid_estimator_f32 estimator;
    config.model = &pvid_kapitza_weak_f32;
    for (int i = 0; i < 4; i++) {
        config.start[i] = (i < 3) ? (float)table_nominal[i] : 0.0f;
        config.start_sd[i] = 1.0f;
        config.lower[i] = (i < 3) ? 0.1f : -1.0f;
        config.upper[i] = 100.0f;
    }
    config.row_sd = 1.0f;
    config.update_rate_hz = 1.6f;
    assert_int_equal(pvid_estimator_init_f32(&estimator, &config), PVID_OK);
    return estimator;
}

#define COLUMNS_OF_ROW 9 /* N1..N8, Y */

/* Works off all but the rows and the solves; copies the whitened columns just before the projection. */
static void work_off(pvid_weak_finish_f32 *finish, const pvid_weak_design_f32 *design, pvid_estimator_f32 *estimator,
                     float sums[][PVID_WEAK_TERMS], float whitened[][PVID_WEAK_TERMS])
{
    pvid_reason reason;
    pvid_weak_finish_init_f32(finish);
    assert_false(pvid_weak_finish_is_busy_f32(finish));
    pvid_trust_f32 trust;
    assert_int_equal(pvid_trust_init_f32(&trust, &pvid_trust_defaults_f32, estimator), PVID_OK);
    pvid_weak_finish_begin_f32(finish, estimator, NULL, 1.0f);
    for (int i = 0; i < (7 * TABLE_FUNCTIONS) + 1; i++) {
        pvid_weak_finish_step_f32(finish, design, 3, sums, estimator, &trust, &reason);
    }
    memcpy(whitened, sums, TABLE_FUNCTIONS * sizeof sums[0]);
    for (int i = 0; i < 6; i++) {
        pvid_weak_finish_step_f32(finish, design, 3, sums, estimator, &trust, &reason);
    }
}

static void rows_are_orthogonal_to_what_is_unknown_of_a_window(void **state)
{
    (void)state;
    static pvid_weak_finish_f32 finish;
    static float sums[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    static float whitened[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    pvid_estimator_f32 estimator = estimator_at_nominal();
    for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
        for (size_t i = 0; i < PVID_WEAK_TERMS; i++) {
            sums[k][i] = noise();
        }
    }
    work_off(&finish, &table_design, &estimator, sums, whitened);
    assert_true(finish.whiten.whitened);
    for (size_t column = 0; column < COLUMNS_OF_ROW; column++) {
        for (size_t unknown = 9; unknown <= 10; unknown++) { /* a and b */
            double product = 0.0;
            for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
                product += (double)sums[k][column] * (double)whitened[k][unknown];
            }
            assert_close(product, 0.0, 2.0e-6); /* six products of order 1 */
        }
    }
    /* at its nominal p a design is white already */
    for (size_t row = 0; row < TABLE_FUNCTIONS; row++) {
        for (size_t i = 0; i <= row; i++) {
            assert_close((double)finish.whiten.factor[((row * (row + 1u)) / 2u) + i], (i == row) ? 1.0 : 0.0, 2.0e-6);
        }
    }
}

static void noise_trace_equals_noise_information(void **state)
{
    (void)state;
    static pvid_weak_finish_f32 finish;
    static float sums[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    static float whitened[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    pvid_estimator_f32 estimator = estimator_at_nominal();
    work_off(&finish, &table_design, &estimator, sums, whitened);
    /* R0 = 1 at the nominal p: the traces are those of the Gram tables, over K */
    const double part[3] = {1.0, 0.5, 1.0};
    for (size_t i = 0; i < 3u; i++) {
        double trace = 0.0;
        for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
            trace += (double)table_gram[((3u + i) * TABLE_PAIRS) + ((k * (k + 1u)) / 2u) + k];
        }
        const double expected = part[i] * trace / TABLE_FUNCTIONS;
        assert_close((double)finish.whiten.trace[i], expected, 2.0e-5 * ((expected < 0.0) ? -expected : expected));
    }
}

static void without_drive_nothing_is_removed(void **state)
{
    (void)state;
    static pvid_weak_finish_f32 finish;
    static float sums[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    static float whitened[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    pvid_estimator_f32 estimator = estimator_at_nominal();
    memset(sums, 0, sizeof sums);
    for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
        sums[k][PVID_TERM_F] = noise();
        sums[k][PVID_TERM_Y] = noise();
    }
    work_off(&finish, &table_design, &estimator, sums, whitened);
    assert_memory_equal(sums, whitened, sizeof sums);
}

static void a_gram_matrix_that_cannot_be_factored_leaves_the_designs_whitening(void **state)
{
    (void)state;
    static float broken[6 * TABLE_PAIRS]; /* zero */
    pvid_weak_design_f32 design = table_design;
    design.gram = broken;
    static pvid_weak_finish_f32 finish;
    static float sums[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    static float whitened[TABLE_FUNCTIONS][PVID_WEAK_TERMS];
    float y[TABLE_FUNCTIONS];
    pvid_estimator_f32 estimator = estimator_at_nominal();
    for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
        for (size_t i = 0; i < PVID_WEAK_TERMS; i++) {
            sums[k][i] = noise();
        }
        y[k] = sums[k][PVID_TERM_Y];
    }
    work_off(&finish, &design, &estimator, sums, whitened);
    assert_false(finish.whiten.whitened);
    for (size_t k = 0; k < TABLE_FUNCTIONS; k++) {
        assert_true((whitened[k][8] >= y[k]) && (whitened[k][8] <= y[k]));
    }
}

/* ---- products by pattern ---- */

static void products_by_pattern_are_those_of_whole_matrices(void **state)
{
    (void)state;
    const pvid_model_f32 *models[2] = {&pvid_kapitza_weak_f32, &pvid_kapitza_weak_zeroed_f32};
    for (int which = 0; which < 2; which++) {
        const pvid_model_f32 *model = models[which];
        const size_t n = model->n_theta;
        const float p[4] = {2.0f, 3.0f, 5.0f, 7.0f};
        float c[16];
        float packed[36];
        float x[8];
        double m[8][8];
        double dense[8][4] = {{0.0}};
        model->jacobian(p, c);
        for (size_t k = 0; k < model->n_c; k++) {
            dense[model->c_row[k]][model->c_column[k]] = (double)c[k];
        }
        size_t at = 0;
        for (size_t i = 0; i < n; i++) {
            x[i] = (float)(int)(10.0f * noise());
            for (size_t j = i; j < n; j++) { /* integers: every sum is exact */
                packed[at] = (float)(int)(10.0f * noise());
                m[i][j] = m[j][i] = (double)packed[at];
                at++;
            }
        }
        float force[4];
        const pvid_block whole = {0, model->n_theta, 0};
        pvid_pattern_transpose_times_f32(model, c, &whole, x, force);
        for (size_t a = 0; a < model->n_p; a++) {
            const size_t start = pvid_pattern_start_f32(model, a);
            const size_t end = pvid_pattern_end_f32(model, start);
            float column[PVID_MAX_THETA] = {0.0f};
            float row[PVID_MAX_P];
            pvid_pattern_add_columns_f32(model, c, start, start + 1u, packed, column);
            pvid_pattern_add_columns_f32(model, c, start + 1u, end, packed, column);
            pvid_pattern_project_row_f32(model, c, start, column, row);
            double dot = 0.0;
            for (size_t i = 0; i < n; i++) {
                double sum = 0.0;
                for (size_t j = 0; j < n; j++) {
                    sum += m[i][j] * dense[j][a];
                }
                assert_close((double)column[i], sum, 0.0);
                dot += dense[i][a] * (double)x[i];
            }
            assert_close((double)force[a], dot, 0.0);
            for (size_t b = a; b < model->n_p; b++) {
                double sum = 0.0;
                for (size_t i = 0; i < n; i++) {
                    sum += dense[i][b] * (double)column[i];
                }
                assert_close((double)row[b], sum, 0.0);
            }
        }
        for (size_t i = 0; i < n; i++) {
            double sum = 0.0;
            for (size_t j = 0; j < n; j++) {
                sum += m[i][j] * (double)x[j];
            }
            assert_close((double)pvid_pattern_times_f32(n, packed, i, x), sum, 0.0);
        }
    }
}

static void the_jacobians_are_the_derivatives_of_theta(void **state)
{
    (void)state;
    const pvid_model_f32 *models[2] = {&pvid_kapitza_weak_f32, &pvid_kapitza_weak_zeroed_f32};
    for (int which = 0; which < 2; which++) {
        const pvid_model_f32 *model = models[which];
        const float p[4] = {4.0f, 3.0f, 2.0f, 0.5f};
        float c[16];
        model->jacobian(p, c);
        for (size_t k = 0; k < model->n_c; k++) {
            float ahead[4];
            float behind[4];
            float theta_ahead[8];
            float theta_behind[8];
            memcpy(ahead, p, sizeof p);
            memcpy(behind, p, sizeof p);
            ahead[model->c_column[k]] += 0.25f; /* theta is at most quadratic in each p: differences are exact */
            behind[model->c_column[k]] -= 0.25f;
            model->theta(ahead, theta_ahead);
            model->theta(behind, theta_behind);
            const size_t row = model->c_row[k];
            assert_close((double)c[k], ((double)theta_ahead[row] - (double)theta_behind[row]) / 0.5, 1.0e-5);
        }
    }
}

/* ---- the solve in stages ---- */

static void feed_row(pvid_estimator_f32 *estimator)
{
    float n[8];
    float y = 0.01f * noise();
    for (int i = 0; i < 8; i++) {
        n[i] = noise();
        y += n[i] * estimator->theta[i];
    }
    assert_int_equal(pvid_estimator_add_f32(estimator, n, y), PVID_ACCUMULATED);
}

static void a_solve_in_stages_has_the_bits_of_one_go(void **state)
{
    (void)state;
    pvid_estimator_f32 whole = estimator_at_nominal();
    pvid_estimator_f32 staged = whole;
    static pvid_estimator_solve_f32 solve;
    for (int group = 0; group < 70; group++) { /* past a fold */
        const uint32_t seed = generator;
        for (int i = 0; i < 6; i++) {
            feed_row(&whole);
        }
        generator = seed;
        for (int i = 0; i < 6; i++) {
            feed_row(&staged);
        }
        for (int step = 0; step < 3; step++) {
            const bool first = step == 0;
            const pvid_reason expected = first ? pvid_estimator_update_f32(&whole) : pvid_estimator_iterate_f32(&whole);
            const pvid_estimator_f32 before = staged;
            int stages = 1;
            pvid_estimator_begin_f32(&staged, &solve, first);
            while (!pvid_estimator_advance_f32(&staged, &solve)) {
                stages++;
                if (stages < 16) { /* nothing is to be seen before the commit */
                    assert_memory_equal(staged.p, before.p, sizeof staged.p);
                    assert_memory_equal(&staged.information, &before.information, sizeof staged.information);
                }
            }
            assert_int_equal(solve.reason, expected);
            assert_int_equal(stages, pvid_estimator_stages_f32(&staged, first));
            assert_memory_equal(&staged, &whole, sizeof staged);
        }
    }
    assert_int_equal(whole.counters.updates, 210);
}

static void a_row_counts_for_its_weight(void **state)
{
    (void)state;
    pvid_estimator_f32 estimator = estimator_at_nominal();
    estimator.information.row_weight = 0.75f;
    for (int i = 0; i < 8; i++) {
        feed_row(&estimator);
    }
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&estimator.information, sums);
    assert_close((double)sums[45], 6.0, 0.0);
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
        cmocka_unit_test(the_front_end_keeps_its_schedule_and_reproduces_a_parabola),
        cmocka_unit_test(double_integrals_of_polynomials_are_exact_but_for_rounding),
        cmocka_unit_test(two_samples_at_a_time_are_one_after_the_other),
        cmocka_unit_test(the_drive_of_a_window_is_the_variance_of_u),
        cmocka_unit_test(window_has_mean_deviation_and_curvature),
        cmocka_unit_test(rows_are_orthogonal_to_what_is_unknown_of_a_window),
        cmocka_unit_test(noise_trace_equals_noise_information),
        cmocka_unit_test(without_drive_nothing_is_removed),
        cmocka_unit_test(a_gram_matrix_that_cannot_be_factored_leaves_the_designs_whitening),
        cmocka_unit_test(products_by_pattern_are_those_of_whole_matrices),
        cmocka_unit_test(the_jacobians_are_the_derivatives_of_theta),
        cmocka_unit_test(a_solve_in_stages_has_the_bits_of_one_go),
        cmocka_unit_test(a_row_counts_for_its_weight),
    };
    return cmocka_run_group_tests(tests, prepare, NULL);
}
