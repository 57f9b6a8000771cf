/* The sums must neither stall nor drift nor forget at the wrong rate. */
#include "test.h"

#include "pvid/pvid.h"

static void no_theta(const float p[], float theta[])
{
    theta[0] = p[0];
    theta[1] = p[0];
}

static void no_jacobian(const float p[], float c[])
{
    (void)p;
    c[0] = 1.0f;
    c[1] = 1.0f;
}

static const uint8_t row[2] = {0, 1};
static const uint8_t column[2] = {0, 0};

/* Two entries of theta: sums are M11, M12, M22, B1, B2, yy, weight. */
static const pvid_model_f32 pair = {
    .n_theta = 2,
    .n_p = 1,
    .n_moments = 3,
    .n_c = 2,
    .c_row = row,
    .c_column = column,
    .theta = no_theta,
    .jacobian = no_jacobian,
};

static void add_rows(pvid_information_f32 *self, uint32_t rows, const float n[2], float y)
{
    float sums[PVID_MAX_SUMS];
    for (uint32_t i = 0; i < rows; i++) {
        pvid_information_add_f32(self, &pair, n, y, sums);
        pvid_information_end_group_f32(self);
    }
}

static void ten_million_equal_rows_neither_stall_nor_drift(void **state)
{
    pvid_information_f32 information;
    pvid_information_init_f32(&information, &pair, 0.0f);
    const float n[2] = {0.1f, 3.0f};
    const uint32_t rows = 10000000u / ONE_IN;
    float plain = 0.0f;
    for (uint32_t i = 0; i < rows; i++) {
        plain += n[0] * n[0];
    }
    add_rows(&information, rows, n, 0.7f);
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&information, sums);
    const float terms[6] = {n[0] * n[0], n[0] * n[1], n[1] * n[1], n[0] * 0.7f, n[1] * 0.7f, 0.7f * 0.7f};
    for (int i = 0; i < 6; i++) {
        const double exact = (double)terms[i] * rows;
        /* The k-th addition into `low` errs by at most 2^-24 of k terms, so a block of 64 by 2^-24 (64 65)/2 terms,
         * 2^-19 of itself; equal terms repeat the same error, the folds add none, and it does not grow with time */
        assert_true(((double)sums[i] - exact) < exact * 0x1p-19);
        assert_true(((double)sums[i] - exact) > -exact * 0x1p-19);
    }
    assert_true((double)sums[6] == (double)rows);
    const double exact = (double)terms[0] * rows;
    const double off = fabs((double)plain - exact);
    assert_true((off > exact * 0.01) || (ONE_IN > 1u)); /* a plain sum drifts: else nothing was tested */
}

static void small_terms_after_large_ones_are_kept(void **state)
{
    pvid_information_f32 information;
    pvid_information_init_f32(&information, &pair, 0.0f);
    const float large[2] = {4096.0f, 0.0f}; /* squares to 2^24: the next 1 falls off a plain sum */
    const float small[2] = {1.0f, 0.0f};
    add_rows(&information, 64, large, 0.0f);
    add_rows(&information, 64 * 1000, small, 0.0f);
    float sums[PVID_MAX_SUMS];
    pvid_information_read_f32(&information, sums);
    const double exact = (64.0 * 16777216.0) + 64000.0;
    /* the value read is one rounding of high + low: half an ulp at 2^30 is 32 */
    assert_true(((double)sums[0] - exact) <= 64.0);
    assert_true(((double)sums[0] - exact) >= -64.0);
}

static void weight_settles_at_the_time_constant(void **state)
{
    const float constants[4] = {10.0f, 100.0f, 1000.0f, 10000.0f};
    for (int i = 0; i < 4; i++) {
        pvid_information_f32 information;
        pvid_information_init_f32(&information, &pair, constants[i]);
        const float n[2] = {1.0f, 1.0f};
        add_rows(&information, (uint32_t)(20.0f * constants[i]), n, 0.0f);
        float sums[PVID_MAX_SUMS];
        pvid_information_read_f32(&information, sums);
        /* Just after a fold the weight is block r/(1 - r), r = exp(-block/tau): tau - block/2 to first
         * order, and up to a block more before the next fold; block is at most tau/16 (1 below 32) */
        const double tau = (double)constants[i];
        const double block = (double)information.block;
        assert_true((double)sums[6] > tau - block);
        assert_true((double)sums[6] < tau + block);
    }
}

static void reading_changes_nothing_and_adding_reports_what_reading_does(void **state)
{
    pvid_information_f32 information;
    pvid_information_init_f32(&information, &pair, 50.0f);
    const float n[2] = {0.3f, -1.7f};
    float added[PVID_MAX_SUMS];
    float before[PVID_MAX_SUMS];
    float after[PVID_MAX_SUMS];
    for (int i = 0; i < 1000; i++) {
        pvid_information_add_f32(&information, &pair, n, 0.2f, added);
        pvid_information_read_f32(&information, before);
        pvid_information_read_f32(&information, after);
        assert_memory_equal(added, before, 7 * sizeof(float));
        assert_memory_equal(before, after, 7 * sizeof(float));
        pvid_information_end_group_f32(&information);
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(ten_million_equal_rows_neither_stall_nor_drift),
    cmocka_unit_test(small_terms_after_large_ones_are_kept),
    cmocka_unit_test(weight_settles_at_the_time_constant),
    cmocka_unit_test(reading_changes_nothing_and_adding_reports_what_reading_does),
};
RUN(tests)
