/* The outlier gate: what it learns, what it keeps out, and that it does not stay shut. */
#include "test.h"

#include "pvid/gate.h"

static pvid_gate_f32 gate;

#include "gate_cases.h"

static void make(unsigned int sigmas, unsigned int patience, unsigned int memory)
{
    const pvid_gate_config_f32 config = {.sigmas = (float)sigmas, .patience_s = (float)patience / 100.0f};
    assert_int_equal(pvid_gate_init_f32(&gate, &config, 100.0f, (float)memory, 1.0f), PVID_OK);
}

static pvid_gate_verdict judge(double square)
{
    return pvid_gate_judge_f32(&gate, (float)square);
}

static bool passes(double square)
{
    return pvid_gate_passes_f32(&gate, (float)square);
}

static double scale(void)
{
    return (double)gate.scale;
}

/* Not a number changes nothing and is no change. */
static void no_number_passes_and_changes_nothing(void **state)
{
    make(3, 200, 1);
    assert_int_equal(judge(1.0), PVID_GATE_ACCEPTS);
    assert_int_equal(judge(9.0e4), PVID_GATE_REJECTS);
    const pvid_gate_f32 before = gate;
    assert_int_equal(judge((double)NAN), PVID_GATE_ACCEPTS);
    assert_int_equal(judge((double)INFINITY), PVID_GATE_ACCEPTS);
    assert_true(passes((double)NAN) && passes((double)INFINITY));
    assert_memory_equal(&gate, &before, sizeof gate);
    assert_false(passes(3.0e38));
}

static void the_scale_has_an_end(void **state)
{
    make(1000, 0, 1);
    for (int i = 0; i < 20; i++) {
        (void)passes(3.0e38);
        assert_true(gate.scale <= 1.0e30f);
    }
    assert_true(gate.scale == 1.0e30f);
}

/* No faster than by 1e3 a residual. */
static void the_shortest_patience_has_an_end(void **state)
{
    const pvid_gate_config_f32 config = {.sigmas = 3.0f, .patience_s = 1.0e-30f};
    assert_int_equal(pvid_gate_init_f32(&gate, &config, 100.0f, 1.0f, 1.0f), PVID_OK);
    assert_true(gate.widening == 1001.0f);
}

static const struct CMUnitTest tests[] = {
    GATE_CASES,
    cmocka_unit_test(no_number_passes_and_changes_nothing),
    cmocka_unit_test(the_scale_has_an_end),
    cmocka_unit_test(the_shortest_patience_has_an_end),
};
RUN(tests)
