/* The outlier gate in integers: what passes, what the usual size is, patience, what makes no gate. */
#include "test.h"

#include "pvid/pvid_q31.h"
#include "number/scaled_q31.h"

static pvid_gate_q31 gate;

#include "gate_cases.h"

static pvid_scaled_q31 number(double x)
{
    return pvid_scaled_of_q31((int64_t)x, 0);
}

static void make(unsigned int sigmas, unsigned int patience, unsigned int memory)
{
    const pvid_gate_config_q31 config = {(uint32_t)sigmas << 16, patience};
    assert_int_equal(pvid_gate_init_q31(&gate, &config, memory, number(1.0)), PVID_OK);
}

static pvid_gate_verdict judge(double square)
{
    return pvid_gate_judge_q31(&gate, number(square));
}

static bool passes(double square)
{
    return pvid_gate_passes_q31(&gate, number(square));
}

static double scale(void)
{
    return (double)pvid_scaled_fixed_q31(gate.scale, 0);
}

static void the_longest_patience_still_widens_it(void **state)
{
    make(2, 1u << 30, 10);
    assert_int_equal(feed(1.0, 10), 10);
    assert_int_equal(feed(1.0e4, 1000), 0);
    assert_true(pvid_scaled_fixed_q31(gate.scale, 40) > ((int64_t)1 << 40));
    assert_true(pvid_scaled_fixed_q31(gate.scale, 10) < (1025));
}

static void the_scale_has_an_end(void **state)
{
    make(2, 1, 10);
    assert_int_equal(feed(1.0, 10), 10);
    const pvid_scaled_q31 huge = {1 << 29, 170};
    for (uint32_t i = 0; i < 1000u; i++) {
        assert_false(pvid_gate_passes_q31(&gate, huge));
        assert_true(gate.scale.e <= 71);
    }
    assert_int_equal(gate.scale.e, 71);
    assert_int_equal(gate.scale.m, 1 << 29);
}

static const struct CMUnitTest tests[] = {
    GATE_CASES,
    cmocka_unit_test(the_longest_patience_still_widens_it),
    cmocka_unit_test(the_scale_has_an_end),
};
RUN(tests)
