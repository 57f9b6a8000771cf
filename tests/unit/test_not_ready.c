/* Calls before init, after a refused one, and with NULL: defined answers, and nothing is done. */
#include "test.h"

#include "kapitza_plant_q31.h"
#include "first_order.h"
#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "pvid/snapshot_weak_q31.h"

#define TICKS 5000

static const float sample[2] = {0.01f, 0.001f};
static const int32_t reading[2] = {1, 2};

static pvid_weak_f32 weak;
static pvid_weak_design_f32 design;
static pvid_weak_q31 weak_q31;
static uint8_t image[PVID_SNAPSHOT_WEAK_F32 + PVID_SNAPSHOT_WEAK_Q31];

static pvid_weak_config_f32 weak_config(void)
{
    design = design_of(&mechanism);
    return config_of(&design);
}

/* Everything that one may call, on objects that are not ready. */
static void call_all(pvid_weak_f32 *one, pvid_weak_q31 *other)
{
    const pvid_weak_config_f32 config = weak_config();
    for (int i = 0; i < TICKS; i++) {
        assert_int_equal(pvid_weak_step_f32(one, sample), PVID_NOT_READY);
        assert_int_equal(pvid_weak_step_q31(other, reading), PVID_NOT_READY);
    }
    assert_int_equal(pvid_weak_step_block_f32(one, sample, 1), PVID_NOT_READY);
    assert_int_equal(pvid_weak_step_block_q31(other, reading, 1), PVID_NOT_READY);
    pvid_weak_gap_f32(one);
    pvid_weak_gap_q31(other);
    pvid_weak_freeze_f32(one, true);
    assert_false(pvid_weak_rebase_f32(one, 0, 0, 1.0f));
    pvid_weak_freeze_q31(other, true);

    memset(image, 0, sizeof image);
    assert_int_equal(pvid_snapshot_save_weak_f32(one, &config, 1, image, sizeof image), 0);
    assert_int_equal(pvid_snapshot_save_weak_q31(other, &kapitza_config_q31, 1, image, sizeof image), 0);
    assert_int_equal(pvid_snapshot_restore_weak_f32(one, &config, image, sizeof image), PVID_SNAPSHOT_NOT_READY);
    assert_int_equal(pvid_snapshot_restore_weak_q31(other, &kapitza_config_q31, image, sizeof image),
                     PVID_SNAPSHOT_NOT_READY);
    pvid_record_writer writer = {0, 0, 0};
    assert_int_equal(pvid_record_save_weak_f32(one, &writer, 1, image, sizeof image), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_save_weak_q31(other, &writer, 1, image, sizeof image), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_load_weak_f32(one, &config, 1, image, sizeof image), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_load_weak_q31(other, &kapitza_config_q31, 1, image, sizeof image),
                     PVID_RECORD_NOT_READY);
}

static void static_objects_before_init_do_nothing(void **state)
{
    static const pvid_weak_f32 none;
    memset(&weak, 0, sizeof weak);
    memset(&weak_q31, 0, sizeof weak_q31);
    call_all(&weak, &weak_q31);
    assert_memory_equal(&weak, &none, sizeof none);
}

static void null_is_an_answer(void **state)
{
    call_all(NULL, NULL);
    assert_null(pvid_weak_estimate_f32(NULL));
    assert_null(pvid_weak_estimate_q31(NULL));
    assert_null(pvid_weak_candidate_f32(NULL));
    assert_int_equal(pvid_snapshot_choose(NULL, NULL, 1000).newest, -1);
}

static void estimators_before_init_do_nothing(void **state)
{
    static pvid_estimator_f32 estimator;
    static pvid_estimator_q31 estimator_q31;
    const pvid_estimate_f32 none = {.kappa = 0.0f};
    const pvid_estimate_q31 none_q31 = {.kappa = 0};
    pvid_estimate_f32 estimate;
    pvid_estimate_q31 estimate_q31;
    memset(&estimate, 0x5A, sizeof estimate);
    memset(&estimate_q31, 0x5A, sizeof estimate_q31);
    pvid_estimator_assess_f32(&estimator, &estimate);
    pvid_estimator_assess_q31(&estimator_q31, &estimate_q31);
    assert_memory_equal(&estimate, &none, sizeof none);
    assert_memory_equal(&estimate_q31, &none_q31, sizeof none_q31);
    pvid_estimator_assess_f32(&estimator, NULL);
    pvid_estimator_assess_q31(&estimator_q31, NULL);
}

static void a_missing_reading_is_not_ready(void **state)
{
    const pvid_weak_config_f32 config = weak_config();
    assert_int_equal(pvid_weak_init_f32(&weak, &config), PVID_OK);
    assert_int_equal(pvid_weak_init_q31(&weak_q31, &kapitza_config_q31), PVID_OK);
    assert_int_equal(pvid_weak_step_f32(&weak, NULL), PVID_NOT_READY);
    assert_int_equal(pvid_weak_step_q31(&weak_q31, NULL), PVID_NOT_READY);
    assert_int_equal(pvid_weak_step_block_f32(&weak, NULL, 1), PVID_NOT_READY);
    assert_int_equal(pvid_weak_step_block_q31(&weak_q31, NULL, 1), PVID_NOT_READY);
}

static void init_refuses_null(void **state)
{
    const pvid_weak_config_f32 config = weak_config();
    const pvid_fir_bank_f32 five = {.half = 2, .stride = 20, .weights = pvid_five_points_f32};
    assert_int_equal(pvid_weak_init_f32(NULL, &config), PVID_BAD_POINTER);
    assert_int_equal(pvid_weak_init_q31(NULL, &kapitza_config_q31), PVID_BAD_POINTER);
    assert_int_equal(pvid_estimator_init_f32(NULL, &config.estimator), PVID_BAD_POINTER);
    assert_int_equal(pvid_estimator_init_q31(NULL, &kapitza_config_q31.estimator), PVID_BAD_POINTER);
    assert_int_equal(pvid_differentiator_init_f32(NULL, &five, 1.0f), PVID_BAD_POINTER);
    assert_int_equal(pvid_gate_init_f32(NULL, &config.gate, 1.0f, 1.0f, 1.0f), PVID_BAD_POINTER);
    assert_int_equal(pvid_gate_init_q31(NULL, &kapitza_config_q31.gate, 1u, (pvid_scaled_q31){0, 0}), PVID_BAD_POINTER);
    assert_int_equal(pvid_trust_init_f32(NULL, &config.trust, &weak.estimator), PVID_BAD_POINTER);
    assert_int_equal(pvid_trust_init_q31(NULL, &kapitza_config_q31.trust, &weak_q31.estimator), PVID_BAD_POINTER);
    static pvid_estimator_f32 estimator;
    static pvid_estimator_q31 estimator_q31;
    static pvid_differentiator_f32 differentiator;
    static pvid_gate_f32 gate;
    static pvid_gate_q31 gate_q31;
    assert_int_equal(pvid_estimator_init_f32(&estimator, NULL), PVID_BAD_POINTER);
    assert_int_equal(pvid_estimator_init_q31(&estimator_q31, NULL), PVID_BAD_POINTER);
    assert_int_equal(pvid_differentiator_init_f32(&differentiator, NULL, 1.0f), PVID_BAD_POINTER);
    assert_int_equal(pvid_gate_init_f32(&gate, NULL, 1.0f, 1.0f, 1.0f), PVID_BAD_POINTER);
    assert_int_equal(pvid_gate_init_q31(&gate_q31, NULL, 1u, (pvid_scaled_q31){0, 0}), PVID_BAD_POINTER);
    assert_int_equal(pvid_trust_init_f32(&weak.trust, NULL, &weak.estimator), PVID_BAD_POINTER);
    assert_int_equal(pvid_trust_init_f32(&weak.trust, &config.trust, NULL), PVID_BAD_POINTER);
    assert_int_equal(pvid_trust_init_q31(&weak_q31.trust, NULL, &weak_q31.estimator), PVID_BAD_POINTER);
    assert_int_equal(pvid_trust_init_q31(&weak_q31.trust, &kapitza_config_q31.trust, NULL), PVID_BAD_POINTER);
}

static void estimate_is_read_from_a_ready_object_only(void **state)
{
    const pvid_weak_config_f32 config = weak_config();
    pvid_estimate_f32 estimate;
    pvid_estimate_q31 estimate_q31;
    memset(&weak, 0, sizeof weak);
    memset(&weak_q31, 0, sizeof weak_q31);
    assert_false(pvid_weak_read_f32(NULL, &estimate, NULL));
    assert_false(pvid_weak_read_q31(NULL, &estimate_q31, NULL));
    assert_false(pvid_weak_read_f32(&weak, &estimate, NULL));
    assert_false(pvid_weak_read_q31(&weak_q31, &estimate_q31, NULL));
    assert_int_equal(pvid_weak_init_f32(&weak, &config), PVID_OK);
    assert_int_equal(pvid_weak_init_q31(&weak_q31, &kapitza_config_q31), PVID_OK);
    assert_false(pvid_weak_read_f32(&weak, NULL, NULL));
    assert_false(pvid_weak_read_q31(&weak_q31, NULL, NULL));
    assert_true(pvid_weak_read_f32(&weak, &estimate, NULL));
    assert_true(pvid_weak_read_q31(&weak_q31, &estimate_q31, NULL));
    pvid_record_writer writer = {0, 0, 0};
    assert_int_equal(pvid_record_save_weak_f32(&weak, NULL, 1, image, sizeof image), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_save_weak_f32(&weak, &writer, 1, NULL, sizeof image), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_load_weak_f32(&weak, NULL, 1, image, sizeof image), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_load_weak_f32(&weak, &config, 1, NULL, sizeof image), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_save_weak_q31(&weak_q31, NULL, 1, image, sizeof image), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_save_weak_q31(&weak_q31, &writer, 1, NULL, sizeof image), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_load_weak_q31(&weak_q31, NULL, 1, image, sizeof image), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_load_weak_q31(&weak_q31, &kapitza_config_q31, 1, NULL, sizeof image),
                     PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_snapshot_save_weak_f32(&weak, NULL, 1, image, sizeof image), 0);
    assert_int_equal(pvid_snapshot_save_weak_f32(&weak, &config, 1, NULL, sizeof image), 0);
    assert_int_equal(pvid_snapshot_save_weak_q31(&weak_q31, NULL, 1, image, sizeof image), 0);
    assert_int_equal(pvid_snapshot_save_weak_q31(&weak_q31, &kapitza_config_q31, 1, NULL, sizeof image), 0);
}

/* Whatever stood in the memory, and whatever the object was before. */
static void a_refused_init_leaves_an_object_that_does_nothing(void **state)
{
    for (int how = 0; how < 3; how++) {
        pvid_weak_config_f32 config = weak_config();
        pvid_weak_config_q31 other = kapitza_config_q31;
        if (how == 1) { /* it has been at work */
            assert_int_equal(pvid_weak_init_f32(&weak, &config), PVID_OK);
            assert_int_equal(pvid_weak_init_q31(&weak_q31, &other), PVID_OK);
        } else {
            memset(&weak, 0xFF, sizeof weak);
            memset(&weak_q31, 0xFF, sizeof weak_q31);
        }
        if (how == 2) {
            assert_int_equal(pvid_weak_init_f32(&weak, NULL), PVID_BAD_POINTER);
            assert_int_equal(pvid_weak_init_q31(&weak_q31, NULL), PVID_BAD_POINTER);
        } else { /* by the field that is looked at last, and by the first */
            config.iterations = (how == 0) ? 1u : 0u;
            config.sample_rate_hz = (how == 0) ? 0.0f : config.sample_rate_hz;
            other.iterations = (how == 0) ? 1u : 0u;
            other.offset = (how == 0) ? NULL : other.offset;
            assert_int_not_equal(pvid_weak_init_f32(&weak, &config), PVID_OK);
            assert_int_not_equal(pvid_weak_init_q31(&weak_q31, &other), PVID_OK);
        }
        call_all(&weak, &weak_q31);
    }
}

static void estimators_and_differentiators_do_nothing_either(void **state)
{
    static pvid_estimator_f32 estimator;
    static pvid_estimator_q31 estimator_q31;
    static pvid_differentiator_f32 differentiator;
    const float n[PVID_MAX_THETA] = {0.0f};
    const int32_t n_q31[PVID_MAX_THETA_Q31] = {0};
    const pvid_scaled_q31 g_q31[PVID_MAX_THETA_Q31] = {{0, 0}};
    float out[PVID_ORDERS];
    for (int i = 0; i < 2; i++) {
        pvid_estimator_f32 *self = (i == 0) ? &estimator : NULL;
        pvid_estimator_q31 *self_q31 = (i == 0) ? &estimator_q31 : NULL;
        assert_int_equal(pvid_estimator_step_f32(self, n, 0.0f), PVID_NOT_READY);
        assert_int_equal(pvid_estimator_add_f32(self, n, 0.0f), PVID_NOT_READY);
        assert_int_equal(pvid_estimator_add_kind_f32(self, 0, n, 0.0f), PVID_NOT_READY);
        assert_int_equal(pvid_estimator_add_to_b_f32(self, n), PVID_NOT_READY);
        assert_int_equal(pvid_estimator_update_f32(self), PVID_NOT_READY);
        assert_int_equal(pvid_estimator_iterate_f32(self), PVID_NOT_READY);
        pvid_estimator_place_f32(self, n);
        assert_int_equal(pvid_estimator_add_q31(self_q31, n_q31, 0), PVID_NOT_READY);
        assert_int_equal(pvid_estimator_add_kind_q31(self_q31, 0, n_q31, 0), PVID_NOT_READY);
        assert_int_equal(pvid_estimator_add_to_b_q31(self_q31, g_q31), PVID_NOT_READY);
        assert_int_equal(pvid_estimator_update_q31(self_q31), PVID_NOT_READY);
        assert_int_equal(pvid_estimator_iterate_q31(self_q31), PVID_NOT_READY);
        pvid_estimator_place_q31(self_q31, 0, 1);
    }
    for (int i = 0; i < 2 * PVID_MAX_WINDOW; i++) {
        assert_false(pvid_differentiator_step_f32(&differentiator, 1.0f, out));
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(static_objects_before_init_do_nothing),
    cmocka_unit_test(null_is_an_answer),
    cmocka_unit_test(init_refuses_null),
    cmocka_unit_test(estimators_before_init_do_nothing),
    cmocka_unit_test(a_missing_reading_is_not_ready),
    cmocka_unit_test(estimate_is_read_from_a_ready_object_only),
    cmocka_unit_test(a_refused_init_leaves_an_object_that_does_nothing),
    cmocka_unit_test(estimators_and_differentiators_do_nothing_either),
};
RUN(tests)
