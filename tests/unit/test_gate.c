/* The outlier gate: what it learns, what it keeps out, and that it does not stay shut. */
#include "test.h"

#include "pvid/gate.h"

#define FLOOR 0.25f

static pvid_gate_f32 gate;

static void start(float sigmas, float patience_s, float memory)
{
    const pvid_gate_config_f32 config = {.sigmas = sigmas, .patience_s = patience_s};
    assert_int_equal(pvid_gate_init_f32(&gate, &config, 100.0f, memory, FLOOR), PVID_OK);
}

static void disabled_gate_accepts_everything(void **state)
{
    start(0.0f, 0.0f, 4.0f);
    for (int i = 0; i < 20; i++) {
        assert_true(pvid_gate_passes_f32(&gate, (i % 2 == 0) ? 1.0f : 1.0e20f));
    }
    assert_true(gate.judged == 0.0f);
}

static void gate_scale_is_the_mean_square(void **state)
{
    start(3.0f, 0.0f, 4.0f);
    const float squares[4] = {100.0f, 4.0f, 8.0f, 8.0f};
    const float means[4] = {100.0f, 52.0f, 52.0f - (44.0f / 3.0f), 30.0f};
    for (int i = 0; i < 4; i++) {
        assert_true(pvid_gate_passes_f32(&gate, squares[i])); /* whatever it is */
        assert_true(fabsf(gate.scale - means[i]) < 1.0e-4f);
    }
    assert_true(gate.judged == 4.0f);
    /* the scale is 30: up to 270 passes, and takes a fourth of the way; beyond is kept out and changes nothing */
    assert_false(pvid_gate_passes_f32(&gate, 271.0f));
    assert_true(fabsf(gate.scale - 30.0f) < 1.0e-4f);
    assert_true(pvid_gate_passes_f32(&gate, 9.0f * gate.scale));
    assert_true(fabsf(gate.scale - (30.0f + (240.0f / 4.0f))) < 1.0e-3f);
    assert_true(gate.judged == 4.0f);
}

static void gate_passes_nan(void **state)
{
    start(3.0f, 0.0f, 1.0f);
    assert_true(pvid_gate_passes_f32(&gate, 1.0f));
    assert_true(pvid_gate_passes_f32(&gate, NAN));
    assert_true(pvid_gate_passes_f32(&gate, INFINITY));
    assert_true(gate.scale == 1.0f);
    assert_false(pvid_gate_passes_f32(&gate, 3.0e38f));
}

static void the_scale_stays_between_its_floor_and_its_ceiling(void **state)
{
    start(3.0f, 0.0f, 2.0f);
    for (int i = 0; i < 50; i++) {
        assert_true(pvid_gate_passes_f32(&gate, 0.0f));
        assert_true(gate.scale >= FLOOR);
    }
    assert_true(gate.scale == FLOOR);
    assert_true(pvid_gate_passes_f32(&gate, 9.0f * FLOOR));
    start(1.0e3f, 0.0f, 1.0f);
    for (int i = 0; i < 20; i++) {
        (void)pvid_gate_passes_f32(&gate, 3.0e38f);
        assert_true(gate.scale <= 1.0e30f);
    }
    assert_true(gate.scale == 1.0e30f);
}

/* Nothing but outliers: within the time of patience the scale grows by 1e4. */
static void uninformative_count_is_reset(void **state)
{
    start(3.0f, 2.0f, 1.0f); /* 200 residuals */
    assert_true(pvid_gate_passes_f32(&gate, 1.0f));
    int kept_out = 0;
    while (!pvid_gate_passes_f32(&gate, 9.0e4f)) {
        kept_out++;
        assert_true(kept_out < 1000);
    }
    /* ln 1e4 / ln(1 + ln 1e4 / 200) */
    assert_in_range(kept_out, 204, 206);
    start(3.0f, 0.0f, 1.0f); /* for ever */
    assert_true(pvid_gate_passes_f32(&gate, 1.0f));
    for (int i = 0; i < 5000; i++) {
        assert_false(pvid_gate_passes_f32(&gate, 9.0e4f));
    }
    /* no faster than by 1e3 a residual, however short the patience */
    start(3.0f, 1.0e-30f, 1.0f);
    assert_true(gate.widening == 1001.0f);
    start(3.0f, 1.0f, 0.0f);
    assert_true(gate.memory == 1.0f);
}

/* What passes only because outliers have widened the scale is a change; what was usual before them is none. */
static void opening_gate_reports_a_change(void **state)
{
    start(3.0f, 2.0f, 4.0f);
    for (int i = 0; i < 8; i++) {
        assert_int_equal(pvid_gate_judge_f32(&gate, 1.0f), PVID_GATE_ACCEPTS);
    }
    for (int i = 0; i < 50; i++) {
        assert_int_equal(pvid_gate_judge_f32(&gate, 9.0e4f), PVID_GATE_REJECTS);
    }
    assert_true(gate.scale > 5.0f);
    assert_int_equal(pvid_gate_judge_f32(&gate, 8.9f), PVID_GATE_ACCEPTS); /* within 9 times the usual */
    int kept_out = 0;
    pvid_gate_verdict verdict = pvid_gate_judge_f32(&gate, 9.0e4f);
    for (; (verdict == PVID_GATE_REJECTS) && (kept_out < 1000); kept_out++) {
        verdict = pvid_gate_judge_f32(&gate, 9.0e4f);
    }
    assert_int_equal(verdict, PVID_GATE_OPENS);
    assert_in_range(kept_out, 100, 206);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(pvid_gate_judge_f32(&gate, 9.0e4f), PVID_GATE_ACCEPTS); /* the usual now */
    }
}

/* Not a number changes nothing, and a disabled gate reports nothing. */
static void nan_and_a_disabled_gate_report_no_change(void **state)
{
    start(3.0f, 2.0f, 1.0f);
    (void)pvid_gate_judge_f32(&gate, 1.0f);
    assert_int_equal(pvid_gate_judge_f32(&gate, 9.0e4f), PVID_GATE_REJECTS);
    const pvid_gate_f32 before = gate;
    assert_int_equal(pvid_gate_judge_f32(&gate, NAN), PVID_GATE_ACCEPTS);
    assert_int_equal(pvid_gate_judge_f32(&gate, INFINITY), PVID_GATE_ACCEPTS);
    assert_memory_equal(&gate, &before, sizeof gate);
    start(0.0f, 2.0f, 1.0f);
    for (int i = 0; i < 20; i++) {
        assert_int_equal(pvid_gate_judge_f32(&gate, (i % 2 == 0) ? 1.0f : 1.0e20f), PVID_GATE_ACCEPTS);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(disabled_gate_accepts_everything),
        cmocka_unit_test(gate_scale_is_the_mean_square),
        cmocka_unit_test(gate_passes_nan),
        cmocka_unit_test(the_scale_stays_between_its_floor_and_its_ceiling),
        cmocka_unit_test(uninformative_count_is_reset),
        cmocka_unit_test(opening_gate_reports_a_change),
        cmocka_unit_test(nan_and_a_disabled_gate_report_no_change),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
