/* Rows of several kinds: M by blocks, against dense arithmetic in double; what init and add refuse. That their
 * parameters are those of least squares: tests/core/test_kinds.py. */
#include "test.h"

#include "identity_q31.h"
#include "solve/information_f32.h"
#include "solve/pattern_f32.h"
#include "pvid/pvid.h"
#include "pvid/scaled_q31.h"

/* Three kinds with 2, 1 and 3 theta; p[1] occurs in all of them. theta = p0, p1, p1 p2, p1, p2, p0 p1. */
#define N_THETA 6
#define N_P 3
#define N_C 8
#define N_KINDS 3
#define MOMENTS (3 + 1 + 6)

static const uint8_t kind_end[N_KINDS] = {2, 3, 6};
static const uint8_t c_row[N_C] = {0, 5, 1, 2, 3, 5, 2, 4};
static const uint8_t c_column[N_C] = {0, 0, 1, 1, 1, 1, 2, 2};

static void theta_of(const float p[], float theta[])
{
    theta[0] = p[0];
    theta[1] = p[1];
    theta[2] = p[1] * p[2];
    theta[3] = p[1];
    theta[4] = p[2];
    theta[5] = p[0] * p[1];
}

static void jacobian_of(const float p[], float c[])
{
    const float values[N_C] = {1.0f, p[1], 1.0f, p[2], 1.0f, p[0], p[1], 1.0f};
    memcpy(c, values, sizeof values);
}

static pvid_model_f32 model = {
    .n_theta = N_THETA,
    .n_p = N_P,
    .n_kinds = N_KINDS,
    .n_moments = MOMENTS,
    .n_c = N_C,
    .positive = 7u,
    .kind_end = kind_end,
    .c_row = c_row,
    .c_column = c_column,
    .theta = theta_of,
    .jacobian = jacobian_of,
};

static uint32_t generator = 1u;

/* An integer of -9..9: products and sums of a few are exact. */
static float integer(void)
{
    generator = (generator * 1664525u) + 1013904223u;
    return (float)((int)((generator >> 8) % 19u) - 9);
}

static pvid_block block_of(size_t i)
{
    pvid_block block;
    pvid_information_block_f32(&model, i, &block);
    return block;
}

static size_t kind_of(size_t i)
{
    return (i < 2u) ? 0u : ((i < 3u) ? 1u : 2u);
}

static void blocks_lie_behind_each_other(void **state)
{
    const size_t first[N_KINDS] = {0, 2, 3};
    const size_t n[N_KINDS] = {2, 1, 3};
    const size_t moment[N_KINDS] = {0, 3, 4};
    for (size_t i = 0; i < N_THETA; i++) {
        const pvid_block block = block_of(i);
        assert_int_equal(block.first, first[kind_of(i)]);
        assert_int_equal(block.n, n[kind_of(i)]);
        assert_int_equal(block.moment, moment[kind_of(i)]);
    }
    for (size_t kind = 0; kind < N_KINDS; kind++) {
        const pvid_block block = block_of(pvid_kind_first(kind_end, kind));
        assert_int_equal(block.first, first[kind]);
        assert_int_equal(block.n, n[kind]);
        assert_int_equal(block.moment, moment[kind]);
    }
    for (uint8_t kinds = 0; kinds < 2u; kinds++) { /* one kind without a list */
        const pvid_model_f32 one = {.n_theta = N_THETA, .n_kinds = kinds};
        pvid_block whole;
        pvid_information_block_f32(&one, pvid_kind_first(NULL, 0), &whole);
        assert_int_equal(whole.first, 0);
        assert_int_equal(whole.n, N_THETA);
        assert_int_equal(whole.moment, 0);
    }
}

/* M of some rows of integers by the estimator's sums, and dense in double. */
static void the_first_kind_begins_at_the_first_theta(void **state)
{
    static const uint8_t ends[2] = {1, 4};
    assert_int_equal(pvid_kind_first(ends, 0), 0);
    assert_int_equal(pvid_kind_first(ends, 1), 1);
}

static void rows_go_to_the_block_of_their_kind(void **state)
{
    pvid_information_f32 information;
    pvid_information_init_f32(&information, &model, 0.0f);
    information.row_weight = 0.5f;
    double m[N_THETA][N_THETA] = {{0.0}};
    double b[N_THETA] = {0.0};
    double yy = 0.0;
    for (int row = 0; row < 30; row++) {
        const uint8_t kind = (uint8_t)(row % N_KINDS);
        const pvid_block block = block_of(pvid_kind_first(kind_end, kind));
        float n[3];
        const float y = integer();
        yy += (double)y * (double)y;
        for (size_t i = 0; i < block.n; i++) {
            n[i] = integer();
        }
        for (size_t i = 0; i < block.n; i++) {
            b[block.first + i] += (double)n[i] * (double)y;
            for (size_t j = 0; j < block.n; j++) {
                m[block.first + i][block.first + j] += (double)n[i] * (double)n[j];
            }
        }
        pvid_information_add_block_f32(&information, &model, &block, n, y);
        pvid_information_end_group_f32(&information);
    }
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&information, sums);
    size_t at = 0;
    for (size_t i = 0; i < N_THETA; i++) {
        for (size_t j = i; j < N_THETA; j++) {
            if (kind_of(i) == kind_of(j)) {
                assert_true((double)sums[at] == m[i][j]);
                at++;
            }
        }
        assert_true((double)sums[MOMENTS + i] == b[i]);
    }
    assert_int_equal(at, MOMENTS);
    assert_true((double)sums[MOMENTS + N_THETA] == yy);
    assert_true((double)sums[MOMENTS + N_THETA + 1] == 15.0);
}

static void products_with_blocks_equal_dense_products(void **state)
{
    const float p[N_P] = {2.0f, 3.0f, 5.0f};
    float c[N_C];
    float packed[MOMENTS];
    float x[N_THETA];
    double m[N_THETA][N_THETA] = {{0.0}};
    double dense[N_THETA][N_P] = {{0.0}};
    jacobian_of(p, c);
    for (size_t k = 0; k < N_C; k++) {
        dense[c_row[k]][c_column[k]] = (double)c[k];
    }
    size_t at = 0;
    for (size_t i = 0; i < N_THETA; i++) {
        x[i] = integer();
        for (size_t j = i; j < N_THETA; j++) {
            if (kind_of(i) == kind_of(j)) {
                packed[at] = integer();
                m[i][j] = m[j][i] = (double)packed[at];
                at++;
            }
        }
    }
    size_t end = 0;
    for (size_t a = 0; a < N_P; a++) {
        const size_t start = end;
        assert_int_equal(model.c_column[start], a);
        end = pvid_pattern_end_f32(&model, start);
        float column[N_THETA] = {0.0f};
        float row[PVID_MAX_P];
        for (size_t k = start; k < end; k++) {
            pvid_pattern_add_column_f32(&model, model.c_row[k], c[k], packed, column);
        }
        pvid_pattern_project_row_f32(&model, c, start, column, row);
        for (size_t i = 0; i < N_THETA; i++) {
            double sum = 0.0;
            for (size_t j = 0; j < N_THETA; j++) {
                sum += m[i][j] * dense[j][a];
            }
            assert_true((double)column[i] == sum);
        }
        for (size_t b = a; b < N_P; b++) {
            double sum = 0.0;
            for (size_t i = 0; i < N_THETA; i++) {
                sum += dense[i][b] * (double)column[i];
            }
            assert_true((double)row[b] == sum);
        }
    }
    for (size_t kind = 0; kind < N_KINDS; kind++) {
        const pvid_block block = block_of(pvid_kind_first(kind_end, kind));
        float gradient[N_P];
        pvid_pattern_transpose_times_f32(&model, c, &block, &x[block.first], gradient);
        for (size_t a = 0; a < N_P; a++) {
            double sum = 0.0;
            for (size_t i = block.first; i < block.first + block.n; i++) {
                sum += dense[i][a] * (double)x[i];
            }
            assert_true((double)gradient[a] == sum);
        }
    }
}

static pvid_estimator_config_f32 config(void)
{
    pvid_estimator_config_f32 fresh = pvid_estimator_defaults_f32;
    fresh.model = &model;
    fresh.row_sd = 0.1f;
    fresh.update_rate_hz = 100.0f;
    for (size_t a = 0; a < N_P; a++) {
        fresh.start[a] = 1.5f;
        fresh.start_sd[a] = 1.0f;
        fresh.lower[a] = 0.1f;
        fresh.upper[a] = 10.0f;
    }
    return fresh;
}

static pvid_status init_with(size_t n_kinds, const uint8_t *ends, size_t n_moments)
{
    const pvid_model_f32 kept = model;
    const pvid_estimator_config_f32 fresh = config();
    pvid_estimator_f32 estimator;
    model.n_kinds = (uint8_t)n_kinds;
    model.kind_end = ends;
    model.n_moments = (uint16_t)n_moments;
    const pvid_status status = pvid_estimator_init_f32(&estimator, &fresh);
    model = kept;
    return status;
}

static void kinds_divide_theta_or_are_refused(void **state)
{
    static const uint8_t every[6] = {1, 2, 3, 4, 5, 6};
    static const uint8_t early[2] = {2, 5};
    static const uint8_t late[2] = {2, 7};
    static const uint8_t empty[3] = {3, 3, 6};
    static const uint8_t none[2] = {0, 6};
    static const uint8_t back[2] = {6, 3};
    static const uint8_t falling[3] = {4, 2, 6};
    assert_int_equal(init_with(3, kind_end, 10), PVID_OK);
    assert_int_equal(init_with(6, every, 6), PVID_OK);
    assert_int_equal(init_with(0, NULL, 21), PVID_OK);
    assert_int_equal(init_with(1, NULL, 21), PVID_OK);
    assert_int_equal(init_with(3, kind_end, 9), PVID_BAD_MODEL);
    assert_int_equal(init_with(3, kind_end, 21), PVID_BAD_MODEL);
    assert_int_equal(init_with(2, NULL, 21), PVID_BAD_MODEL);
    assert_int_equal(init_with(2, early, 3 + 6), PVID_BAD_MODEL);
    assert_int_equal(init_with(2, late, 3 + 15), PVID_BAD_MODEL);
    assert_int_equal(init_with(3, empty, 6 + 6), PVID_BAD_MODEL);
    assert_int_equal(init_with(2, none, 21), PVID_BAD_MODEL);
    assert_int_equal(init_with(3, falling, 10 + 10), PVID_BAD_MODEL);
    assert_int_equal(init_with(2, back, 21), PVID_BAD_MODEL);
}

/* b, behind the moments in the sums. */
static float b_of(const pvid_estimator_f32 *estimator, size_t i)
{
    return estimator->information.high[MOMENTS + i] + estimator->information.low[MOMENTS + i];
}

static void a_vector_is_added_to_b_or_refused(void **state)
{
    const float fits[N_THETA] = {1.0f, -2.0f, 3.0f, -4.0f, 5.0f, -1.0e28f};
    for (int law = 0; law < 2; law++) {
        pvid_estimator_config_f32 fresh = config();
        fresh.feedback_hz = (law == 0) ? 0.0f : 50.0f;
        pvid_estimator_f32 estimator;
        assert_int_equal(pvid_estimator_init_f32(&estimator, &fresh), PVID_OK);
        assert_int_equal(pvid_estimator_add_to_b_f32(&estimator, fits), PVID_ACCUMULATED);
        for (size_t i = 0; i < N_THETA; i++) {
            assert_true(b_of(&estimator, i) == fits[i]);
        }
        /* C^T g at p = 1.5: the step of a law with gamma < 1 takes it like N e of a row */
        assert_true(estimator.innovation[1] ==
                    ((law == 0) ? 0.0f : ((-2.0f + (1.5f * 3.0f)) - 4.0f) + (1.5f * -1.0e28f)));
        const pvid_estimator_f32 before = estimator;
        float large[N_THETA] = {0.0f};
        large[3] = 1.1e28f;
        assert_int_equal(pvid_estimator_add_to_b_f32(&estimator, large), PVID_REJECTED_SATURATED);
        large[5] = large[3] * 1.0e38f;
        assert_int_equal(pvid_estimator_add_to_b_f32(&estimator, large), PVID_REJECTED_NOT_FINITE);
        assert_int_equal(pvid_estimator_add_kind_f32(&estimator, N_KINDS, fits, 1.0f), PVID_NOT_READY);
        assert_memory_equal(&estimator.information, &before.information, sizeof before.information);
        assert_memory_equal(estimator.innovation, before.innovation, sizeof before.innovation);
        assert_int_equal(estimator.counters.rejected_saturated, 1);
        assert_int_equal(estimator.counters.rejected_not_finite, 1);
    }
}

/* ---- fixed point: the same model with numbers of any size ---- */

static const pvid_scaled_q31 one = {1 << 29, -29};

static void numbers_theta(const pvid_scaled_q31 p[], pvid_scaled_q31 theta[])
{
    theta[0] = p[0];
    theta[1] = p[1];
    theta[2] = pvid_scaled_times_q31(p[1], p[2]);
    theta[3] = p[1];
    theta[4] = p[2];
    theta[5] = pvid_scaled_times_q31(p[0], p[1]);
}

static void numbers_jacobian(const pvid_scaled_q31 p[], pvid_scaled_q31 c[])
{
    const pvid_scaled_q31 values[N_C] = {one, p[1], one, p[2], one, p[0], p[1], one};
    memcpy(c, values, sizeof values);
}

static pvid_scaled_model_q31 numbers = {numbers_theta, numbers_jacobian, &pvid_read_scaled_q31};
static pvid_model_q31 fixed = {
    .n_theta = N_THETA,
    .n_p = N_P,
    .n_kinds = N_KINDS,
    .n_c = N_C,
    .positive = 7u,
    .kind_end = kind_end,
    .c_row = c_row,
    .c_column = c_column,
    .scaled = &numbers,
};

static pvid_estimator_config_q31 fixed_config(void)
{
    pvid_estimator_config_q31 fresh = usual_config_q31(&fixed);
    fresh.y_bits = 10;
    for (size_t a = 0; a < N_P; a++) {
        fresh.start[a] = 3 << 23; /* 1.5 */
        fresh.start_sd[a] = 1 << 24;
        fresh.lower[a] = 1 << 20;
        fresh.upper[a] = 10 << 24;
        fresh.p_bits[a] = 24;
    }
    return fresh;
}

static void a_fixed_point_vector_is_added_to_b_or_refused(void **state)
{
    for (int law = 0; law < 2; law++) {
        pvid_estimator_config_q31 fresh = fixed_config();
        fresh.gain = (law == 0) ? (1 << 30) : (1 << 28);
        pvid_estimator_q31 estimator;
        assert_int_equal(pvid_estimator_init_q31(&estimator, &fresh), PVID_OK);
        estimator.information.exponent = 1; /* b in units of 4 */
        pvid_scaled_q31 g[N_THETA] = {{0, 0}, {-(1 << 30), -20}, {1 << 30, 30}};
        assert_int_equal(pvid_estimator_add_to_b_q31(&estimator, g), PVID_ACCUMULATED);
        const int64_t *b = &estimator.information.sums[MOMENTS];
        assert_int_equal(b[0], 0);
        assert_int_equal(b[1], -256);
        assert_int_equal(b[2], (int64_t)1 << 58);
        assert_int_equal(estimator.fresh[1], -256);
        const pvid_estimator_q31 before = estimator;
        g[2].e = 34;
        const int32_t fits[N_THETA] = {1};
        assert_int_equal(pvid_estimator_add_to_b_q31(&estimator, g), PVID_REJECTED_SATURATED);
        assert_int_equal(pvid_estimator_add_kind_q31(&estimator, N_KINDS, fits, 1), PVID_NOT_READY);
        assert_memory_equal(&estimator.information, &before.information, sizeof before.information);
        assert_int_equal(estimator.counters.rejected_saturated, 1);
    }
}

static pvid_status init_fixed(void)
{
    const pvid_estimator_config_q31 fresh = fixed_config();
    pvid_estimator_q31 estimator;
    return pvid_estimator_init_q31(&estimator, &fresh);
}

static void a_fixed_point_model_is_whole_or_refused(void **state)
{
    static const uint8_t early[3] = {2, 3, 5};
    const pvid_model_q31 kept = fixed;
    const pvid_scaled_model_q31 kept_numbers = numbers;
    assert_int_equal(init_fixed(), PVID_OK);
    numbers.theta = NULL;
    assert_int_equal(init_fixed(), PVID_BAD_MODEL);
    numbers = kept_numbers;
    numbers.jacobian = NULL;
    assert_int_equal(init_fixed(), PVID_BAD_MODEL);
    numbers = kept_numbers;
    numbers.adapter = NULL;
    assert_int_equal(init_fixed(), PVID_BAD_MODEL);
    numbers = kept_numbers;
    fixed.scaled = NULL; /* and no functions of integers */
    assert_int_equal(init_fixed(), PVID_BAD_MODEL);
    fixed = kept;
    fixed.kind_end = early;
    assert_int_equal(init_fixed(), PVID_BAD_MODEL);
    fixed.kind_end = NULL;
    assert_int_equal(init_fixed(), PVID_BAD_MODEL);
    fixed = kept;
}

/* theta_bits: 40 bits of theta at the start, or of what start_sd changes it by. */
static void formats_of_theta_follow_the_start(void **state)
{
    pvid_estimator_config_q31 fresh = fixed_config();
    pvid_estimator_q31 estimator;
    assert_int_equal(pvid_estimator_init_q31(&estimator, &fresh), PVID_OK);
    assert_int_equal(estimator.theta_bits[0], 39); /* 1.5: one bit before the point */
    assert_int_equal(estimator.theta_bits[2], 38); /* 2.25 */
    assert_true(estimator.theta[0] == ((int64_t)3 << 38));
    fresh.start_sd[0] = 10 << 24;
    assert_int_equal(pvid_estimator_init_q31(&estimator, &fresh), PVID_OK);
    assert_int_equal(estimator.theta_bits[0], 36);
    pvid_estimator_place_q31(&estimator, 0, (int64_t)9 << 24);
    assert_true(estimator.theta[0] == ((int64_t)9 << 36));
    fresh.start[0] = 8 << 24; /* larger than what a standard deviation changes it by */
    fresh.start_sd[0] = 1 << 20;
    assert_int_equal(pvid_estimator_init_q31(&estimator, &fresh), PVID_OK);
    assert_int_equal(estimator.theta_bits[0], 36);
    assert_int_equal(estimator.c_exponent[0], 10 - 24); /* y_bits less p_bits: a number has its own exponent */
}

static void diagonals_are_where_the_packed_rows_begin(void **state)
{
    for (size_t n = 1; n <= 12u; n++) {
        size_t place = 0;
        for (size_t i = 0; i < n; i++) {
            assert_int_equal(pvid_pattern_diagonal_f32(n, i), place);
            place += n - i;
        }
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(blocks_lie_behind_each_other),
    cmocka_unit_test(the_first_kind_begins_at_the_first_theta),
    cmocka_unit_test(rows_go_to_the_block_of_their_kind),
    cmocka_unit_test(products_with_blocks_equal_dense_products),
    cmocka_unit_test(kinds_divide_theta_or_are_refused),
    cmocka_unit_test(a_vector_is_added_to_b_or_refused),
    cmocka_unit_test(a_fixed_point_vector_is_added_to_b_or_refused),
    cmocka_unit_test(a_fixed_point_model_is_whole_or_refused),
    cmocka_unit_test(formats_of_theta_follow_the_start),
    cmocka_unit_test(diagonals_are_where_the_packed_rows_begin),
};
RUN(tests)
