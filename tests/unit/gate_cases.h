/* What the gate does alike in either core: included by the tests of each, which define the functions declared here. */
#ifndef GATE_CASES_H
#define GATE_CASES_H

/* A gate whose scale remembers `memory` residuals and is 1 at least; patience in residuals, 0: for ever. */
static void make(unsigned int sigmas, unsigned int patience, unsigned int memory);

static pvid_gate_verdict judge(double square);
static bool passes(double square);
static double scale(void);

/* How many of them pass. */
static unsigned int feed(double square, unsigned int times)
{
    unsigned int passed = 0;
    for (unsigned int i = 0; i < times; i++) {
        passed += passes(square) ? 1u : 0u;
    }
    return passed;
}

static void disabled_gate_accepts_everything_and_keeps_its_scale(void **state)
{
    make(0, 300, 10);
    const double before = scale();
    assert_int_equal(feed(1.0, 100), 100);
    assert_int_equal(feed(4.0e18, 100), 100);
    for (int i = 0; i < 20; i++) {
        assert_int_equal(judge((i % 2 == 0) ? 1.0 : 4.0e18), PVID_GATE_ACCEPTS);
    }
    assert_true((scale() == before) && (gate.judged == 0));
}

static void whatever_comes_first_is_the_usual(void **state)
{
    make(4, 0, 10);
    assert_int_equal(feed(1.0e9, 10), 10);
    assert_int_equal(gate.judged, 10);
    assert_int_equal(feed(1.0e9, 10), 10);
    assert_int_equal(gate.judged, 10);
}

static void the_mean_of_the_first_is_exact(void **state)
{
    make(4, 0, 10);
    assert_true(passes(100.0) && (scale() == 100.0)); /* in place of the floor, with which it starts */
    assert_true(passes(300.0) && (scale() == 200.0));
    assert_true(passes(800.0) && (scale() == 400.0));
}

static void the_limit_is_sigmas_squared_times_the_scale(void **state)
{
    make(4, 0, 10);
    assert_int_equal(feed(100.0, 40), 40);
    assert_int_equal(feed(1601.0, 100), 0); /* is kept out and changes nothing */
    assert_true(scale() == 100.0);
    assert_int_equal(feed(1600.0, 1), 1);
    assert_true(scale() == 250.0); /* 100 + (1600 - 100) / 10 */
}

static void the_scale_is_never_below_its_floor(void **state)
{
    make(4, 0, 10);
    assert_int_equal(feed(0.0, 1000), 1000);
    assert_true(scale() == 1.0);
    assert_int_equal(feed(17.0, 1), 0);
    assert_int_equal(feed(16.0, 1), 1);
}

/* Nothing but outliers: within the time of patience the scale grows by 1e4. */
static void a_change_is_accepted_after_the_patience(void **state)
{
    make(4, 300, 10);
    assert_int_equal(feed(1.0, 100), 100);
    unsigned int refused = 0;
    while (!passes(1.0e4) && (refused < 1000u)) {
        refused++;
    }
    /* the scale needs 1e4 / 16: 300 ln(625) / ln(1e4) = 209.7 outliers, and a factor 1 + x for exp(x): 1.5 % more */
    assert_in_range(refused, 209, 214);
}

static void without_patience_the_scale_never_widens(void **state)
{
    make(4, 0, 10);
    assert_int_equal(feed(1.0, 100), 100);
    assert_int_equal(feed(1.0e4, 100000), 0);
}

static void the_memory_is_at_least_one(void **state)
{
    make(2, 0, 0);
    assert_int_equal(feed(100.0, 1), 1);
    assert_int_equal(feed(401.0, 1), 0);
}

/* What passes only because outliers have widened the scale is a change; what was usual before them is none. */
static void an_opening_gate_reports_a_change(void **state)
{
    make(4, 300, 10);
    for (int i = 0; i < 100; i++) {
        assert_int_equal(judge(100.0), PVID_GATE_ACCEPTS);
    }
    for (int i = 0; i < 100; i++) {
        assert_int_equal(judge(1.0e6), PVID_GATE_REJECTS);
    }
    assert_true(scale() > 1000.0);
    assert_int_equal(judge(1600.0), PVID_GATE_ACCEPTS); /* 16 times the usual */
    int kept_out = 0;
    pvid_gate_verdict verdict = judge(1.0e6);
    for (; (verdict == PVID_GATE_REJECTS) && (kept_out < 1000); kept_out++) {
        verdict = judge(1.0e6);
    }
    assert_int_equal(verdict, PVID_GATE_OPENS);
    assert_in_range(kept_out, 100, 214);
    assert_int_equal(judge(1.0e6), PVID_GATE_ACCEPTS); /* the usual now */
}

#define GATE_CASES                                                                                                     \
    cmocka_unit_test(disabled_gate_accepts_everything_and_keeps_its_scale),                                            \
        cmocka_unit_test(whatever_comes_first_is_the_usual), cmocka_unit_test(the_mean_of_the_first_is_exact),         \
        cmocka_unit_test(the_limit_is_sigmas_squared_times_the_scale),                                                 \
        cmocka_unit_test(the_scale_is_never_below_its_floor),                                                          \
        cmocka_unit_test(a_change_is_accepted_after_the_patience),                                                     \
        cmocka_unit_test(without_patience_the_scale_never_widens), cmocka_unit_test(the_memory_is_at_least_one),       \
        cmocka_unit_test(an_opening_gate_reports_a_change)

#endif
