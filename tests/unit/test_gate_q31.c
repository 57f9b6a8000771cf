/* The outlier gate in integers: what passes, what the usual size is, patience, what makes no gate. */
#include "test.h"

#include "pvid/pvid_q31.h"
#include "number/scaled_q31.h"

static pvid_gate_q31 gate;

static pvid_scaled_q31 number(int64_t x)
{
    return pvid_scaled_of_q31(x, 0);
}

/* A gate of `sigmas` whose scale remembers ten residuals and is 1 at least. */
static void make(uint32_t sigmas, uint32_t patience)
{
    const pvid_gate_config_q31 config = {sigmas << 16, patience};
    assert_int_equal(pvid_gate_init_q31(&gate, &config, 10, number(1)), PVID_OK);
}

/* How many of them pass. */
static uint32_t feed(int64_t square, uint32_t times)
{
    uint32_t passed = 0;
    for (uint32_t i = 0; i < times; i++) {
        passed += pvid_gate_passes_q31(&gate, number(square)) ? 1u : 0u;
    }
    return passed;
}

static void test_disabled_gate_passes_everything_and_keeps_scale(void **state)
{
    make(0, 0);
    const pvid_gate_q31 before = gate;
    assert_int_equal(feed(1, 100), 100);
    assert_int_equal(feed(INT64_MAX / 2, 100), 100);
    assert_memory_equal(&gate, &before, sizeof gate);
}

static void test_disabled_until_warmed_up(void **state)
{
    make(4, 0);
    assert_int_equal(feed(1000000000, 10), 10);
    assert_int_equal(gate.judged, 10);
    assert_int_equal(feed(1000000000, 10), 10);
    assert_int_equal(gate.judged, 10);
}

static void test_the_mean_of_the_first_is_exact(void **state)
{
    make(4, 0);
    assert_int_equal(feed(100, 1), 1); /* in place of the floor, with which it starts */
    assert_int_equal(pvid_scaled_fixed_q31(gate.scale, 0), 100);
    assert_int_equal(feed(300, 1), 1);
    assert_int_equal(pvid_scaled_fixed_q31(gate.scale, 0), 200);
    assert_int_equal(feed(800, 1), 1);
    assert_int_equal(pvid_scaled_fixed_q31(gate.scale, 0), 400);
}

static void test_limit_is_sigmas_squared_times_the_scale(void **state)
{
    make(4, 0);
    assert_int_equal(feed(100, 40), 40);
    assert_int_equal(feed(1601, 100), 0);
    assert_int_equal(pvid_scaled_fixed_q31(gate.scale, 0), 100);
    assert_int_equal(feed(1600, 1), 1);
    assert_int_equal(pvid_scaled_fixed_q31(gate.scale, 0), 250); /* 100 + (1600 - 100) / 10 */
}

static void test_scale_is_never_below_its_floor(void **state)
{
    make(4, 0);
    assert_int_equal(feed(0, 1000), 1000);
    assert_int_equal(gate.scale.m, number(1).m);
    assert_int_equal(gate.scale.e, number(1).e);
    assert_int_equal(feed(17, 1), 0);
    assert_int_equal(feed(16, 1), 1);
}

static void test_change_is_accepted_after_the_patience(void **state)
{
    make(4, 300);
    assert_int_equal(feed(1, 100), 100);
    uint32_t refused = 0;
    while ((feed(10000, 1) == 0u) && (refused < 1000u)) {
        refused++;
    }
    /* the scale needs 1e4 / 16: 300 ln(625) / ln(1e4) = 209.7 outliers, and a factor 1 + x for exp(x): 1.5 % more */
    assert_in_range(refused, 209, 214);
}

static void test_without_patience_the_scale_never_widens(void **state)
{
    make(4, 0);
    assert_int_equal(feed(1, 100), 100);
    assert_int_equal(feed(10000, 100000), 0);
}

static void test_the_longest_patience_still_widens_it(void **state)
{
    make(2, (uint32_t)1 << 30);
    assert_int_equal(feed(1, 10), 10);
    assert_int_equal(feed(10000, 1000), 0);
    assert_true(pvid_scaled_fixed_q31(gate.scale, 40) > ((int64_t)1 << 40));
    assert_true(pvid_scaled_fixed_q31(gate.scale, 10) < (1025));
}

static void test_the_scale_has_an_end(void **state)
{
    make(2, 1);
    assert_int_equal(feed(1, 10), 10);
    const pvid_scaled_q31 huge = {1 << 29, 170};
    for (uint32_t i = 0; i < 1000u; i++) {
        assert_false(pvid_gate_passes_q31(&gate, huge));
        assert_true(gate.scale.e <= 71);
    }
    assert_int_equal(gate.scale.e, 71);
    assert_int_equal(gate.scale.m, 1 << 29);
}

static void test_memory_is_at_least_one(void **state)
{
    const pvid_gate_config_q31 config = {2u << 16, 0};
    assert_int_equal(pvid_gate_init_q31(&gate, &config, 0, number(1)), PVID_OK);
    assert_int_equal(feed(100, 1), 1);
    assert_int_equal(feed(401, 1), 0);
}

static pvid_gate_verdict judge(int64_t square)
{
    return pvid_gate_judge_q31(&gate, number(square));
}

/* What passes only because outliers have widened the scale is a change; what was usual before them is none. */
static void test_opening_gate_reports_a_change(void **state)
{
    make(4, 300);
    for (int i = 0; i < 100; i++) {
        assert_int_equal(judge(100), PVID_GATE_ACCEPTS);
    }
    for (int i = 0; i < 100; i++) {
        assert_int_equal(judge(1000000), PVID_GATE_REJECTS);
    }
    assert_true(pvid_scaled_fixed_q31(gate.scale, 0) > 1000);
    assert_int_equal(judge(1600), PVID_GATE_ACCEPTS); /* 16 times the usual */
    int kept_out = 0;
    pvid_gate_verdict verdict = judge(1000000);
    for (; (verdict == PVID_GATE_REJECTS) && (kept_out < 1000); kept_out++) {
        verdict = judge(1000000);
    }
    assert_int_equal(verdict, PVID_GATE_OPENS);
    assert_in_range(kept_out, 100, 214);
    assert_int_equal(judge(1000000), PVID_GATE_ACCEPTS); /* the usual now */
    make(0, 300);
    for (int i = 0; i < 20; i++) {
        assert_int_equal(judge((i % 2 == 0) ? 1 : INT64_MAX / 2), PVID_GATE_ACCEPTS);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_disabled_gate_passes_everything_and_keeps_scale),
        cmocka_unit_test(test_disabled_until_warmed_up),
        cmocka_unit_test(test_the_mean_of_the_first_is_exact),
        cmocka_unit_test(test_limit_is_sigmas_squared_times_the_scale),
        cmocka_unit_test(test_scale_is_never_below_its_floor),
        cmocka_unit_test(test_change_is_accepted_after_the_patience),
        cmocka_unit_test(test_without_patience_the_scale_never_widens),
        cmocka_unit_test(test_the_longest_patience_still_widens_it),
        cmocka_unit_test(test_the_scale_has_an_end),
        cmocka_unit_test(test_memory_is_at_least_one),
        cmocka_unit_test(test_opening_gate_reports_a_change),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
