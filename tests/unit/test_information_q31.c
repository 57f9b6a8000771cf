/* The sums of the fixed-point core: exact, fading when it is time to, and never beyond their limit. */
#include "test.h"

#include "solve/information_q31.h"

#define N 3
#define SUMS (6 + 3 + 2)
#define WEIGHT (SUMS - 1)

static const pvid_model_q31 model = {.n_theta = N};
static const pvid_block whole = {0, N, 0};
static pvid_information_q31 information;
static int64_t fresh[PVID_MAX_THETA_Q31];

static void start(uint32_t groups)
{
    memset(fresh, 0, sizeof fresh);
    pvid_information_init_q31(&information, &model, groups, 1u << 15);
}

static void end_group(void)
{
    for (size_t part = 0; part < PVID_INFORMATION_END_PARTS; part++) {
        pvid_information_end_group_q31(&information, &model, part, fresh);
    }
}

static void sums_are_exact(void **state)
{
    start(0);
    const int32_t rows[2][N] = {{3, -5, PVID_ROW_LIMIT_Q31}, {-7, 11, 13}};
    const int32_t errors[2] = {-17, PVID_ROW_LIMIT_Q31};
    int64_t expected[SUMS] = {0};
    for (int k = 0; k < 2; k++) {
        pvid_information_add_q31(&information, &whole, rows[k], errors[k], fresh);
        size_t at = 0;
        for (int i = 0; i < N; i++) {
            for (int j = i; j < N; j++) {
                expected[at++] += (int64_t)rows[k][i] * rows[k][j];
            }
        }
        for (int i = 0; i < N; i++) {
            expected[at++] += (int64_t)rows[k][i] * errors[k];
        }
        expected[at++] += (int64_t)errors[k] * errors[k];
        expected[at] += 1 << 15;
        assert_memory_equal(information.sums, expected, sizeof expected);
        assert_memory_equal(fresh, &expected[6], N * sizeof(int64_t));
    }
    assert_int_equal(information.n_sums, SUMS);
    assert_int_equal(information.exponent, 0);
}

/* Forgetting acts every sixteenth of its time constant, every group where that is short, every 64 at most. */
static void the_past_fades_by_exp(void **state)
{
    static const uint32_t groups[] = {4, 5, 16, 31, 32, 33, 100, 1000, 1023, 1024, 5000, 1u << 20, 1u << 24};
    static const uint16_t blocks[] = {1, 1, 1, 1, 2, 2, 6, 62, 63, 64, 64, 64, 64};
    for (size_t k = 0; k < sizeof groups / sizeof groups[0]; k++) {
        start(groups[k]);
        assert_int_equal(information.block, blocks[k]);
        const double exact = 2147483648.0 * exp(-(double)blocks[k] / (double)groups[k]);
        assert_true(fabs((double)information.retention - exact) < 8.0); /* twelve roundings of the series */
        const int32_t row[N] = {1 << 20, 0, 0};
        pvid_information_add_q31(&information, &whole, row, 1 << 10, fresh);
        const pvid_information_q31 before = information;
        for (uint16_t group = 1; group < blocks[k]; group++) {
            end_group();
            assert_memory_equal(before.sums, information.sums, sizeof before.sums);
        }
        end_group();
        for (size_t i = 0; i < SUMS; i++) { /* every sum, and the weight */
            const double faded = (double)before.sums[i] * ((double)information.retention / 2147483648.0);
            assert_true(fabs((double)information.sums[i] - faded) <= 0.5 + 1.0e-3);
        }
        assert_int_equal(information.age, 0);
    }
    start(0);
    const int32_t row[N] = {1, 2, 3};
    pvid_information_add_q31(&information, &whole, row, 4, fresh);
    const pvid_information_q31 kept = information;
    for (int group = 0; group < 1000; group++) {
        end_group();
    }
    assert_memory_equal(kept.sums, information.sums, sizeof kept.sums);
}

/* Rows as large as they may be: the sums are quartered before they leave their limit, and rows are halved from then
 * on; when the sums have faded they come back to where they were. */
static void sums_keep_below_their_limit(void **state)
{
    start(64);
    const int32_t row[N] = {PVID_ROW_LIMIT_Q31, -PVID_ROW_LIMIT_Q31, PVID_ROW_LIMIT_Q31 - 1};
    for (int group = 0; group < 200; group++) {
        pvid_information_add_q31(&information, &whole, row, PVID_ROW_LIMIT_Q31, fresh);
        end_group();
        if (group == 49) { /* in the same unit */
            assert_int_equal(information.exponent, 1);
            assert_true(fabs((double)fresh[0] - (12.5 * 72057594037927936.0)) < 50.0);
            assert_true(fabs((double)fresh[1] + (double)fresh[0]) <= 50.0);
        }
        for (size_t i = 0; i < (size_t)WEIGHT; i++) {
            assert_true((information.sums[i] <= PVID_SUM_LIMIT) && (information.sums[i] >= -PVID_SUM_LIMIT));
        }
    }
    /* 64 rows of 2^56 are 2^62: beyond 2^60 */
    assert_int_equal(information.exponent, 1);
    const double scale = 4.0;
    const double moment = (double)information.sums[0] * scale;
    const double weight = (double)information.sums[WEIGHT] / 32768.0;
    assert_true(fabs((moment / 72057594037927936.0) - weight) < 1.0e-6 * weight);
    assert_int_equal(information.sums[1], -information.sums[0]);
    assert_int_equal(information.sums[6], information.sums[0]);
    assert_int_equal(information.sums[9], information.sums[0]);
    /* those since the last solve do not fade, and end at the limit */
    assert_int_equal(fresh[0], 2 * PVID_SUM_LIMIT);
    assert_int_equal(fresh[1], -2 * PVID_SUM_LIMIT);
    /* nothing more comes in: 2^54 is where they are multiplied again */
    int64_t last = information.sums[0];
    while (information.exponent > 0u) {
        last = information.sums[0];
        assert_true(last >= ((int64_t)1 << 54));
        memset(fresh, 0, sizeof fresh);
        end_group();
    }
    assert_true(fabs(((double)information.sums[0] / (double)last) -
                     (4.0 * (double)information.retention / 2147483648.0)) < 1.0e-6);
    for (int group = 0; group < 2000; group++) { /* and no further than to where they began */
        end_group();
    }
    assert_int_equal(information.exponent, 0);
}

static void any_sum_of_squares_may_be_the_largest(void **state)
{
    for (int which = 0; which < N + 1; which++) {
        start(0);
        int32_t row[N] = {1, 1, 1};
        if (which < N) {
            row[which] = PVID_ROW_LIMIT_Q31;
        }
        for (int k = 0; k < 16; k++) {
            pvid_information_add_q31(&information, &whole, row, (which == N) ? PVID_ROW_LIMIT_Q31 : 1, fresh);
        }
        end_group();
        assert_int_equal(information.exponent, 0); /* 2^60: at the limit */
        const pvid_information_q31 before = information;
        pvid_information_add_q31(&information, &whole, row, (which == N) ? PVID_ROW_LIMIT_Q31 : 1, fresh);
        end_group();
        assert_int_equal(information.exponent, 1);
        const size_t diagonal[N + 1] = {0, 3, 5, 9};
        const int64_t quarter = information.sums[diagonal[which]];
        assert_int_equal(quarter, (before.sums[diagonal[which]] / 4) + ((int64_t)1 << 54));
        assert_int_equal(information.sums[WEIGHT], 17 << 15);
        assert_int_equal(information.sums[diagonal[(which + 1) % 3]], 4); /* 17/4 */
    }
}

/* Rows of many kinds add to the residual sum only: it stops at 3 2^60, from which the end of a group divides it. */
static void residuals_of_many_rows_stop_at_their_limit(void **state)
{
    start(0);
    const int32_t row[N] = {0, 0, 0};
    const int64_t largest = (int64_t)3 << 60;
    for (int k = 0; k < 100; k++) {
        pvid_information_add_q31(&information, &whole, row, PVID_ROW_LIMIT_Q31, fresh);
        const int64_t exact = (int64_t)(k + 1) << 56;
        assert_int_equal(information.sums[9], (exact < largest) ? exact : largest);
    }
    end_group();
    assert_int_equal(information.exponent, 1);
    assert_int_equal(information.sums[9], largest / 4);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(residuals_of_many_rows_stop_at_their_limit),
    cmocka_unit_test(sums_are_exact),
    cmocka_unit_test(the_past_fades_by_exp),
    cmocka_unit_test(sums_keep_below_their_limit),
    cmocka_unit_test(any_sum_of_squares_may_be_the_largest),
};
RUN(tests)
