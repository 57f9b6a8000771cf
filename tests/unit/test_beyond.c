/* What is beyond float32, a format or a counter is told, held or refused, each by itself. */
#include "test.h"

#include "solve/state_q31.h"
#include "kapitza_plant_q31.h"
#include "first_order.h"
#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "pvid/snapshot_weak_q31.h"

static pvid_weak_q31 identifier;

static void a_weight_beyond_its_counter_is_its_end(void **state)
{
    assert_int_equal(pvid_weak_init_q31(&identifier, &kapitza_config_q31), PVID_OK);
    pvid_information_q31 *information = &identifier.estimator.information;
    pvid_estimate_q31 estimate;
    int64_t *weight = &information->sums[information->n_sums - 1u];
    *weight = ((int64_t)UINT32_MAX << 16) + 65535;
    pvid_estimator_assess_q31(&identifier.estimator, &estimate);
    assert_true(estimate.weight == UINT32_MAX);
    *weight = (int64_t)1 << 50;
    pvid_estimator_assess_q31(&identifier.estimator, &estimate);
    assert_true(estimate.weight == UINT32_MAX);
    *weight = ((int64_t)UINT32_MAX - 1) << 16;
    pvid_estimator_assess_q31(&identifier.estimator, &estimate);
    assert_true(estimate.weight == UINT32_MAX - 1u);
}

static void a_snapshot_of_the_other_core_is_of_another_kind(void **state)
{
    static pvid_weak_f32 single;
    static uint8_t image[PVID_SNAPSHOT_WEAK_Q31];
    static uint8_t image_of_single[PVID_SNAPSHOT_WEAK_F32];
    const pvid_weak_design_f32 design = design_of(&mechanism);
    const pvid_weak_config_f32 config = config_of(&design);
    assert_int_equal(pvid_weak_init_q31(&identifier, &kapitza_config_q31), PVID_OK);
    assert_int_equal(pvid_weak_init_f32(&single, &config), PVID_OK);
    const size_t n = pvid_snapshot_save_weak_q31(&identifier, &kapitza_config_q31, 1, image, sizeof image);
    const size_t m = pvid_snapshot_save_weak_f32(&single, &config, 1, image_of_single, sizeof image_of_single);
    assert_int_equal(pvid_snapshot_restore_weak_f32(&single, &config, image, n), PVID_SNAPSHOT_OTHER_KIND);
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &kapitza_config_q31, image_of_single, m),
                     PVID_SNAPSHOT_OTHER_KIND);
    assert_int_equal(pvid_snapshot_restore_weak_f32(&single, &config, image_of_single, m), PVID_SNAPSHOT_RESTORED);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(a_snapshot_of_the_other_core_is_of_another_kind),
    cmocka_unit_test(a_weight_beyond_its_counter_is_its_end),
};
RUN(tests)
