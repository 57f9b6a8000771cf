/* What is beyond float32, a format or a counter is told, held or refused, each by itself. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solve/state_q31.h"
#include "engine_q31.h"
#include "first_order.h"
#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "pvid/snapshot_weak_q31.h"
#include "strong_table_q31.h"

/* ---- physical parameters in float32 ---- */

static bool physical(float w, float d1, float d2, float l1, float w_variance, float d1_variance, float d2_variance)
{
    pvid_estimate_f32 estimate;
    memset(&estimate, 0, sizeof estimate);
    estimate.p[PVID_KAPITZA_W] = w;
    estimate.p[PVID_KAPITZA_D1] = d1;
    estimate.p[PVID_KAPITZA_D2] = d2;
    estimate.covariance[0][0] = w_variance;
    estimate.covariance[1][1] = d1_variance;
    estimate.covariance[2][2] = d2_variance;
    pvid_kapitza_f32 value = {1.0f, 2.0f, 3.0f};
    pvid_kapitza_f32 se = {4.0f, 5.0f, 6.0f};
    const bool is_physical = pvid_kapitza_physical_f32(&estimate, l1, &value, &se);
    assert_true(is_physical == (value.g != 1.0f)); /* left unwritten unless */
    assert_true(is_physical == (se.rho2 != 6.0f));
    return is_physical;
}

static void physical_parameters_are_finite_or_none(void **state)
{
    (void)state;
    assert_true(physical(31.0f, 8.9f, 5.6f, 0.3f, 1.0f, 1.0f, 1.0f));
    assert_false(physical(1.0e38f, 8.9f, 5.6f, 1.0e6f, 0.0f, 0.0f, 0.0f));       /* g */
    assert_false(physical(31.0f, 1.0e30f, 1.0e-10f, 0.3f, 0.0f, 0.0f, 0.0f));    /* l2 */
    assert_false(physical(31.0f, 1.00001f, 2.0e-39f, 1.0e3f, 0.0f, 0.0f, 0.0f)); /* rho2, and not l2 */
    assert_false(physical(1.0f, 8.9f, 5.6f, 1.0e21f, 1.0e38f, 0.0f, 0.0f));      /* of g */
    assert_false(physical(31.0f, 8.9f, 0.1f, 1.0e3f, 0.0f, 3.0e38f, 0.0f));      /* of l2 */
    assert_false(physical(31.0f, 2.00001f, 1.0f, 1.0f, 0.0f, 3.0e38f, 0.0f));    /* of rho2, and not of l2 */
}

/* ---- where p is put ---- */

static void a_place_is_a_number_within_the_bounds(void **state)
{
    (void)state;
    pvid_estimator_config_f32 config = pvid_estimator_defaults_f32;
    config.model = &parameters;
    config.update_rate_hz = 1.0f;
    config.row_sd = 1.0f;
    for (int i = 0; i < 4; i++) {
        config.start[i] = 2.0f;
        config.start_sd[i] = 1.0f;
        config.lower[i] = 1.0f;
        config.upper[i] = 4.0f;
    }
    pvid_estimator_f32 estimator;
    assert_int_equal(pvid_estimator_init_f32(&estimator, &config), PVID_OK);
    const float there[4] = {0.5f, NAN, 5.0f, 3.0f};
    pvid_estimator_place_f32(&estimator, there);
    const float placed[4] = {1.0f, 2.0f, 4.0f, 3.0f};
    assert_memory_equal(estimator.p, placed, sizeof placed);
    assert_true(estimator.theta[2] == 4.0f); /* at the new p */
}

/* ---- rows of the fixed-point strong form: each entry may be the one that does not fit ---- */

static const pvid_strong_row_q31 exact = {.phi3 = 1 << 30};

/* Whether phi and its derivatives of orders 2, 3 and 4 make a row at these whole rates u, u' and u''. */
static bool row_fits(const pvid_strong_row_q31 *format, const int32_t given[4], int32_t u0, int32_t u1, int32_t u2)
{
    const int32_t phi[PVID_ORDERS] = {given[0], 0, given[1], given[2], given[3]};
    const int32_t one = (int32_t)1 << PVID_KAPITZA_RATE_BITS;
    const int32_t u[PVID_Y_ORDERS_Q31] = {u0 * one, u1 * one, u2 * one};
    int32_t row[PVID_KAPITZA_ROW_Q31];
    return pvid_kapitza_strong_row_q31(format, phi, u, row);
}

/* That a row fits below this size of one of them, the others 0, and not above it: entries are within -2^28..2^28 - 1.
 */
static void assert_largest(const pvid_strong_row_q31 *format, size_t which, int32_t largest, int32_t u0, int32_t u1,
                           int32_t u2)
{
    for (int32_t sign = -1; sign <= 1; sign += 2) {
        int32_t given[4] = {0};
        given[which] = sign * (largest - 1);
        assert_true(row_fits(format, given, u0, u1, u2));
        given[which] += 2 * sign;
        assert_false(row_fits(format, given, u0, u1, u2));
    }
}

enum { PHI0, PHI2, PHI3, PHI4 };

static void each_entry_of_a_row_may_be_too_large(void **state)
{
    (void)state;
    const int32_t limit = PVID_ROW_LIMIT_Q31;
    const int32_t ones[4] = {1, 1, 1, 1};
    assert_true(row_fits(&exact, ones, 1, 1, 1));
    for (size_t which = PHI0; which <= PHI4; which++) {
        assert_largest(&exact, which, limit, 0, 0, 0);
    }
    assert_largest(&exact, PHI0, limit / 16, 2, 0, 0);   /* u^4 phi */
    assert_largest(&exact, PHI0, limit >> 20, 32, 0, 0); /* the same */
    assert_largest(&exact, PHI2, limit / 8, 2, 0, 0);    /* u^3 phi2 */
    assert_largest(&exact, PHI2, limit >> 15, 32, 0, 0); /* the same */
    assert_largest(&exact, PHI2, limit / 16, 0, 0, 16);  /* u2 phi2: the bracket */
    assert_largest(&exact, PHI3, limit / 32, 0, 16, 0);  /* 2 u1 phi3 of it */
    assert_largest(&exact, PHI4, limit / 2, 1, 0, 0);    /* 2 u phi4 of it */
    assert_largest(&exact, PHI4, limit >> 10, 32, 0, 0); /* u u phi4: Y */
    assert_largest(&exact, PHI2, limit / 128, 0, 8, 0);  /* 2 u1 u1 phi2: Y */
}

/* Parts of an entry that leave their own range, where the entry would be within it again or 0. */
static void each_part_of_a_row_may_be_too_large(void **state)
{
    (void)state;
    const int32_t u1_phi2[4] = {0, (1 << 24) + 1, 0, 0};
    assert_false(row_fits(&exact, u1_phi2, 0, 64, 0)); /* 2^30 + 64 */
    pvid_strong_row_q31 coarse = exact;                /* powers of u times phi2 are 0 */
    coarse.finer[0] = -31;
    const int32_t bracket[4] = {0, (1 << 25) + 1, 0, 1 << 25};
    assert_false(row_fits(&coarse, bracket, 32, 0, 64)); /* 2^31 + 64 - 2^30; without u phi4 it is 64 */
    coarse.phi_shift[3] = -31;
    const int32_t phi3[4] = {0, 0, (1 << 30) - 1, 0};
    assert_true(row_fits(&coarse, phi3, 0, 0, 0));
    coarse.phi3 = 1518500250; /* 2^30.5 */
    assert_false(row_fits(&coarse, phi3, 0, 0, 0));
}

/* Each derivative is shifted to its unit. */
static void a_shifted_derivative_may_be_too_large(void **state)
{
    (void)state;
    const int32_t limit = PVID_ROW_LIMIT_Q31;
    static const size_t order[] = {0, 2, 3, 4};
    for (size_t which = PHI0; which <= PHI4; which++) {
        pvid_strong_row_q31 format = exact;
        format.phi_shift[order[which]] = 4;
        assert_largest(&format, which, limit / 16, 0, 0, 0);
        format.phi_shift[order[which]] = 31;
        int32_t one[4] = {0};
        assert_true(row_fits(&format, one, 0, 0, 0));
        one[which] = 1;
        assert_false(row_fits(&format, one, 0, 0, 0));
        format.phi_shift[order[which]] = -1;
        const int32_t largest = (which == PHI2) ? (limit - 1) : ((2 * limit) - 2);
        format.finer[0] = (which == PHI2) ? 1 : 0; /* as fine as before */
        int32_t given[4] = {0};
        given[which] = largest;
        assert_true(row_fits(&format, given, 0, 0, 0));
    }
    pvid_strong_row_q31 finer = exact;
    finer.finer[0] = 4;
    assert_largest(&finer, PHI2, limit / 16, 0, 0, 0);
}

static pvid_weak_q31 identifier;

/* ---- what is remembered ---- */

static void a_weight_beyond_its_counter_is_its_end(void **state)
{
    (void)state;
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

/* ---- a whole run of which no row fits ---- */

static void run_strong(const pvid_strong_config_q31 *config)
{
    static pvid_strong_q31 self;
    assert_int_equal(pvid_strong_init_q31(&self, config), PVID_OK);
    plant_state plant = released_plant();
    uint32_t refused = 0;
    for (int i = 0; i < 400; i++) {
        double phi;
        double y;
        plant_step(&plant, &phi, &y);
        const pvid_reason reason = pvid_strong_step_q31(&self, (int32_t)floor((phi / 5.992112452678286e-06) + 0.5),
                                                        (int32_t)floor((y / 5.0e-06) + 0.5));
        assert_true((reason == PVID_WARMING_UP) == (i < 80));
        refused += (reason == PVID_REJECTED_SATURATED) ? 1u : 0u;
    }
    assert_int_equal(self.estimator.counters.rejected_saturated, refused);
    assert_int_equal(self.estimator.counters.rows + refused, 320);
    assert_true(refused >= 100u);
}

static void rows_that_do_not_fit_are_counted_tick_by_tick(void **state)
{
    (void)state;
    pvid_strong_config_q31 config = strong_unit;
    config.drive_min = 0;
    for (int k = 0; k < PVID_ORDERS; k++) {
        config.row.phi_shift[k] = 31; /* far more than an entry holds */
    }
    config.row.finer[0] = 0;
    run_strong(&config);
    config = strong_unit;
    config.drive_min = 0;
    for (int i = 0; i < 3; i++) { /* p so far off that no innovation fits */
        config.estimator.start[i] = config.estimator.upper[i];
    }
    run_strong(&config);
    config.gate.sigmas = 3u << 16; /* the gate has nothing to weigh */
    run_strong(&config);
}

static void a_snapshot_of_another_form_is_of_another_kind(void **state)
{
    (void)state;
    static pvid_strong_q31 other;
    static uint8_t image[PVID_SNAPSHOT_WEAK_Q31];
    static uint8_t strong_image[PVID_SNAPSHOT_STRONG_Q31];
    assert_int_equal(pvid_weak_init_q31(&identifier, &kapitza_config_q31), PVID_OK);
    assert_int_equal(pvid_strong_init_q31(&other, &strong_unit), PVID_OK);
    const size_t n = pvid_snapshot_save_weak_q31(&identifier, &kapitza_config_q31, 1, image, sizeof image);
    const size_t m = pvid_snapshot_save_strong_q31(&other, &strong_unit, 1, strong_image, sizeof strong_image);
    assert_int_equal(pvid_snapshot_restore_strong_q31(&other, &strong_unit, image, n), PVID_SNAPSHOT_OTHER_KIND);
    assert_int_equal(pvid_snapshot_restore_weak_q31(&identifier, &kapitza_config_q31, strong_image, m),
                     PVID_SNAPSHOT_OTHER_KIND);
    assert_int_equal(pvid_snapshot_restore_strong_q31(&other, &strong_unit, strong_image, m), PVID_SNAPSHOT_RESTORED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(physical_parameters_are_finite_or_none),
        cmocka_unit_test(a_place_is_a_number_within_the_bounds),
        cmocka_unit_test(each_entry_of_a_row_may_be_too_large),
        cmocka_unit_test(each_part_of_a_row_may_be_too_large),
        cmocka_unit_test(a_shifted_derivative_may_be_too_large),
        cmocka_unit_test(rows_that_do_not_fit_are_counted_tick_by_tick),
        cmocka_unit_test(a_snapshot_of_another_form_is_of_another_kind),
        cmocka_unit_test(a_weight_beyond_its_counter_is_its_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
