/* Forgetting along a drift, on sums written by hand. The library of the tests has none (config.h), so the module is
 * compiled here with room for two. */
#include "test.h"

#undef PVID_MAX_DRIFTS
#define PVID_MAX_DRIFTS 2

#include "solve/drift_f32.c"

static const uint8_t row[] = {0, 1, 2};
static const uint8_t column[] = {0, 1, 1};
static const uint8_t ends[] = {2, 3};

static void jacobian(const float p[], float c[])
{
    (void)p;
    c[0] = 1.0f;
    c[1] = 2.0f;
    c[2] = 1.0f;
}

static void drifts(const float p[], float d[])
{
    (void)p;
    const float both[4] = {1.0f, 0.5f, 0.0f, 0.0f};
    memcpy(d, both, sizeof both);
}

/* theta = (p0, 2 p1 | p1) in two kinds of rows; the drift of theta is (1, 1 | 0.5), the second drift is none. */
static const pvid_model_f32 model = {.n_theta = 3,
                                     .n_p = 2,
                                     .n_kinds = 2,
                                     .n_moments = 4,
                                     .n_c = 3,
                                     .kind_end = ends,
                                     .c_row = row,
                                     .c_column = column,
                                     .jacobian = jacobian,
                                     .n_drifts = 2,
                                     .drifts = drifts};

static void test_only_what_is_known_along_the_drift_grows_old(void **state)
{
    static pvid_estimator_f32 self; /* all zeros */
    self.model = &model;
    self.settings.drift_keep = 0.75f;
    self.information.n_moments = 4;
    self.information.n_theta = 3;
    const float high[9] = {3.0f, 1.0f, 2.0f, 0.0f, 4.0f, 3.0f, 1.0f, 50.0f, 10.0f};
    memcpy(self.information.high, high, sizeof high);
    pvid_drift_forget_f32(&self);
    /* M D = (4, 3), D M D = 7, D b = 7: a quarter of (16 12; 12 9)/7, of (4, 3) and of 7 is lost; the second kind knows
     * nothing, and its b stays */
    const float lost[9] = {4.0f / 7.0f, 3.0f / 7.0f, 2.25f / 7.0f, 0.0f, 1.0f, 0.75f, 0.0f, 1.75f, 0.0f};
    for (size_t i = 0; i < 9u; i++) {
        assert_true(fabsf(self.information.low[i] + lost[i]) < 1.0e-6f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_only_what_is_known_along_the_drift_grows_old)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
