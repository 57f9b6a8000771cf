/* What the inits of the fixed-point core accept and refuse, at both ends of every field, and that every field is in the
 * fingerprint by which a snapshot knows its configuration. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "bounds.h"
#include "keep/fingerprint_q31.h"
#include "pvid/pvid_q31.h"
#include "weak_table_q31.h"

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))
#define INT32_LAST 2147483647.0
#define ONE_Q30 1073741824.0
#define KAPPA_LAST 1072668083.0 /* 2^30 - 2^30 / 1000 */

#define FIELD(type, in, member, kind, low, high, status)                                                               \
    {#member, offsetof(type, in member), kind, low, high, status, PVID_OK}
#define FORMAT(type, in, member) FIELD(type, in, member, KIND_INT8, -64.0, 64.0, PVID_BAD_FORMAT)
#define OF_ESTIMATOR(type, in)                                                                                         \
    FIELD(type, in, start_sd[0], KIND_INT32, 1.0, INT32_LAST, PVID_BAD_START_SD),                                      \
        FIELD(type, in, start_sd[1], KIND_INT32, 1.0, INT32_LAST, PVID_BAD_START_SD),                                  \
        FIELD(type, in, start_sd[2], KIND_INT32, 1.0, INT32_LAST, PVID_BAD_START_SD), FORMAT(type, in, p_bits[0]),     \
        FORMAT(type, in, p_bits[1]), FORMAT(type, in, p_bits[2]), FORMAT(type, in, n_bits[0]),                         \
        FORMAT(type, in, n_bits[4]), FORMAT(type, in, y_bits),                                                         \
        FIELD(type, in, row_sd, KIND_INT32, 1.0, INT32_LAST, PVID_BAD_ROW_SD),                                         \
        FIELD(type, in, forgetting_groups, KIND_UINT32, 4.0, 16777216.0, PVID_BAD_FORGETTING),                         \
        FIELD(type, in, gain, KIND_INT32, 0.0, ONE_Q30, PVID_BAD_FEEDBACK),                                            \
        FIELD(type, in, correlation, KIND_UINT32, 65536.0, 2147483648.0, PVID_BAD_CORRELATION),                        \
        FIELD(type, in, row_weight, KIND_UINT32, 1.0, 65536.0, PVID_BAD_ROW_WEIGHT),                                   \
        FIELD(type, in, step_limit, KIND_UINT32, 1.0, 58982.0, PVID_BAD_STEP_LIMIT),                                   \
        FIELD(type, in, kappa_min, KIND_INT32, 0.0, KAPPA_LAST, PVID_BAD_KAPPA_MIN),                                   \
        FIELD(type, in, noise_margin, KIND_UINT32, 0.0, ONE_Q30, PVID_BAD_NOISE_MARGIN),                               \
        FIELD(type, in, dead_zone, KIND_UINT32, 0.0, 6553600.0, PVID_BAD_DEAD_ZONE),                                   \
        FIELD(type, in, divider, KIND_UINT16, 1.0, 65535.0, PVID_BAD_DIVIDER)

/* ---- the estimator, on a model of the user's own ---- */

static void theta_of(const int32_t p[], int64_t theta[])
{
    for (size_t i = 0; i < PVID_MAX_THETA_Q31; i++) {
        theta[i] = p[0];
    }
}

static void jacobian_of(const int32_t p[], int64_t c[])
{
    (void)p;
    for (size_t i = 0; i < PVID_MAX_C_Q31; i++) {
        c[i] = 1;
    }
}

static void formats_of(const int8_t p_bits[], int16_t theta_bits[], int16_t c_bits[])
{
    for (size_t i = 0; i < PVID_MAX_THETA_Q31; i++) {
        theta_bits[i] = p_bits[0];
    }
    memset(c_bits, 0, PVID_MAX_C_Q31 * sizeof c_bits[0]);
}

static const uint8_t c_row[PVID_MAX_C_Q31 + 1] = {0, 1, 2, 3, 4};
static const uint8_t c_column[PVID_MAX_C_Q31 + 1] = {0, 0, 0, 1, 2};

static pvid_model_q31 model;
static pvid_estimator_config_q31 own;
static pvid_estimator_q31 estimator;

static int start_own(void **state)
{
    (void)state;
    const pvid_model_q31 fresh = {
        .n_theta = 5,
        .n_p = 3,
        .n_c = 5,
        .positive = 3u, /* p[2] may have any sign */
        .c_row = c_row,
        .c_column = c_column,
        .theta = theta_of,
        .jacobian = jacobian_of,
        .formats = formats_of,
    };
    model = fresh;
    memset(&own, 0, sizeof own);
    own.model = &model;
    for (int i = 0; i < PVID_MAX_P; i++) {
        own.start[i] = 800;
        own.start_sd[i] = 200;
        own.lower[i] = 100;
        own.upper[i] = 4000;
    }
    own.row_sd = 256;
    own.gain = 1 << 30;
    own.correlation = 1u << 16;
    own.row_weight = 1u << 16;
    own.step_limit = 19661;
    own.divider = 1;
    return 0;
}

static pvid_status init_own(void)
{
    static const pvid_estimator_q31 none;
    memset(&estimator, 0x5A, sizeof estimator);
    const pvid_status status = pvid_estimator_init_q31(&estimator, &own);
    if (status != PVID_OK) {
        assert_memory_equal(&none, &estimator, sizeof none); /* nothing is half made */
    }
    return status;
}

static void estimator_fields_end_at_their_bounds(void **state)
{
    (void)state;
    const bound fields[] = {OF_ESTIMATOR(pvid_estimator_config_q31, )};
    check_bounds(fields, LENGTH(fields), &own, sizeof own, init_own);
    own.n_bits[5] = 127; /* of no entry of N */
    own.p_bits[3] = 127; /* of no parameter */
    assert_int_equal(init_own(), PVID_OK);
}

static pvid_status init_with(size_t i, int32_t start, int32_t lower, int32_t upper)
{
    (void)start_own(NULL);
    own.start[i] = start;
    own.lower[i] = lower;
    own.upper[i] = upper;
    return init_own();
}

static void start_and_bounds_agree_or_are_refused(void **state)
{
    (void)state;
    for (size_t i = 0; i < 3u; i++) {
        assert_int_equal(init_with(i, 8, 8, 9), PVID_OK);
        assert_int_equal(init_with(i, 8, 7, 8), PVID_OK);
        assert_int_equal(init_with(i, 7, 8, 9), PVID_BAD_START);
        assert_int_equal(init_with(i, 9, 7, 8), PVID_BAD_START);
        assert_int_equal(init_with(i, 8, 8, 8), PVID_BAD_BOUNDS);
        assert_int_equal(init_with(i, 8, 9, 7), PVID_BAD_BOUNDS);
        assert_int_equal(init_with(i, 1, 1, INT32_MAX), PVID_OK);
    }
    assert_int_equal(init_with(0, 8, 0, 9), PVID_BAD_BOUNDS);
    assert_int_equal(init_with(1, 8, -1, 9), PVID_BAD_BOUNDS);
    assert_int_equal(init_with(2, -8, -9, 0), PVID_OK);
    assert_int_equal(init_with(2, -8, -INT32_MAX, 0), PVID_OK);
    assert_int_equal(init_with(2, -8, INT32_MIN, 0), PVID_BAD_BOUNDS); /* its magnitude is no int32 */
    assert_int_equal(init_with(3, 0, 0, 0), PVID_OK);                  /* of no parameter */
}

#define ASSERT_MODEL(change, status)                                                                                   \
    do {                                                                                                               \
        (void)start_own(NULL);                                                                                         \
        change;                                                                                                        \
        assert_int_equal(init_own(), status);                                                                          \
    } while (0)

static void a_model_fits_or_is_refused(void **state)
{
    (void)state;
    ASSERT_MODEL((void)0, PVID_OK);
    ASSERT_MODEL(own.model = NULL, PVID_BAD_MODEL);
    ASSERT_MODEL(model.theta = NULL, PVID_BAD_MODEL);
    ASSERT_MODEL(model.jacobian = NULL, PVID_BAD_MODEL);
    ASSERT_MODEL(model.formats = NULL, PVID_BAD_MODEL);
    ASSERT_MODEL(model.c_row = NULL, PVID_BAD_MODEL);
    ASSERT_MODEL(model.c_column = NULL, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_theta = 0, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_theta = PVID_MAX_THETA_Q31, PVID_OK);
    ASSERT_MODEL(model.n_theta = PVID_MAX_THETA_Q31 + 1, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_p = 0, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_p = PVID_MAX_P, PVID_OK);
    ASSERT_MODEL(model.n_p = PVID_MAX_P + 1, PVID_BAD_MODEL);
    ASSERT_MODEL((model.n_theta = 1, model.n_p = 1), PVID_OK);
    ASSERT_MODEL((model.n_theta = 1, model.n_p = 2), PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_c = 0, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_c = 1, PVID_OK);
    ASSERT_MODEL(model.n_c = PVID_MAX_C_Q31, PVID_OK);
    ASSERT_MODEL(model.n_c = PVID_MAX_C_Q31 + 1, PVID_BAD_MODEL);
}

/* ---- the strong form ---- */

static pvid_strong_config_q31 strong_settings;
static pvid_strong_q31 strong;

static int start_strong(void **state)
{
    (void)state;
    memset(&strong_settings, 0, sizeof strong_settings);
    (void)start_own(NULL);
    strong_settings.estimator = own;
    strong_settings.bank.half = 2;
    strong_settings.bank.stride = 1;
    strong_settings.bank.phi_max = 80000;
    strong_settings.bank.y_max = 6000;
    strong_settings.bank.centre = PVID_FIVE_POINTS_CENTRE_Q31;
    strong_settings.bank.weights = pvid_five_points_q31;
    strong_settings.u_multiplier = 1;
    strong_settings.drive_ticks = 50;
    return 0;
}

static pvid_status init_strong(void)
{
    return pvid_strong_init_q31(&strong, &strong_settings);
}

#define SHIFT(member) FIELD(pvid_strong_config_q31, , member, KIND_UINT8, 0.0, 62.0, PVID_BAD_SHIFT)

static const bound strong_fields[] = {
    SHIFT(row.n_a),
    SHIFT(row.n_e),
    SHIFT(row.part),
    SHIFT(row.y),
    SHIFT(row.n_phi2[0]),
    SHIFT(row.n_phi2[3]),
    SHIFT(row.n_phi0[0]),
    SHIFT(row.n_phi0[4]),
    SHIFT(u_shift),
    FIELD(pvid_strong_config_q31, , u_multiplier, KIND_INT32, 1.0, INT32_LAST, PVID_BAD_U_MULTIPLIER),
    FIELD(pvid_strong_config_q31, , drive_min, KIND_INT32, 0.0, ONE_Q30, PVID_BAD_DRIVE_MIN),
    FIELD(pvid_strong_config_q31, , drive_ticks, KIND_UINT32, 1.0, ONE_Q30, PVID_BAD_DRIVE_TICKS),
    FIELD(pvid_strong_config_q31, , phi_offset, KIND_INT32, -2147483648.0, INT32_LAST, PVID_OK),
    FIELD(pvid_strong_config_q31, , y_offset, KIND_INT32, -2147483648.0, INT32_LAST, PVID_OK),
    FIELD(pvid_strong_config_q31, , bank.stride, KIND_UINT16, 1.0, (PVID_MAX_WINDOW - 1) / 4, PVID_BAD_STRIDE),
    /* the fourth derivative's outermost products are 48 times four full scales, and fit 32 bits */
    FIELD(pvid_strong_config_q31, , bank.phi_max, KIND_INT32, 1.0, 2147483647 / (48 * 4), PVID_BAD_FULL_SCALE),
    FIELD(pvid_strong_config_q31, , bank.y_max, KIND_INT32, 1.0, 2147483647 / (48 * 4), PVID_BAD_FULL_SCALE),
    FIELD(pvid_strong_config_q31, , gate.sigmas, KIND_UINT32, 131072.0, 65536000.0, PVID_BAD_GATE_SIGMAS),
    FIELD(pvid_strong_config_q31, , gate.patience_groups, KIND_UINT32, 0.0, ONE_Q30, PVID_BAD_GATE_PATIENCE),
    OF_ESTIMATOR(pvid_strong_config_q31, estimator.),
};

static uint32_t strong_fingerprint(void)
{
    return pvid_fingerprint_strong_q31(&strong_settings);
}

static void every_field_of_the_strong_form_is_in_its_fingerprint(void **state)
{
    (void)state;
    check_fingerprints(strong_fields, LENGTH(strong_fields), &strong_settings, sizeof strong_settings,
                       strong_fingerprint);
    static int32_t weights[2 * PVID_ORDERS];
    memcpy(weights, pvid_five_points_q31, sizeof weights);
    strong_settings.bank.weights = weights;
    const uint32_t before = strong_fingerprint();
    for (size_t i = 0; i < LENGTH(weights); i++) {
        weights[i]++;
        assert_int_not_equal(strong_fingerprint(), before);
        weights[i]--;
    }
    strong_settings.bank.centre++;
    assert_int_not_equal(strong_fingerprint(), before);
    strong_settings.bank.centre--;
    strong_settings.bank.half = 1;
    assert_int_not_equal(strong_fingerprint(), before);
}

static void strong_form_fields_end_at_their_bounds(void **state)
{
    (void)state;
    for (size_t k = 0; k < PVID_ORDERS; k++) { /* what the largest counts make stays far from the limit */
        strong_settings.bank.phi_shift[k] = 2;
    }
    memset(strong_settings.bank.y_shift, 2, sizeof strong_settings.bank.y_shift);
    check_bounds(strong_fields, LENGTH(strong_fields), &strong_settings, sizeof strong_settings, init_strong);
    strong_settings.drive_min = 3;
    strong_settings.drive_ticks = 4;
    assert_int_equal(init_strong(), PVID_OK);
    assert_int_equal(strong.drive_min, 9);
    assert_int_equal(strong.drive_forgetting, INT32_MAX / 4);
}

/* ---- the weak form ---- */

static pvid_weak_design_q31 design;
static pvid_weak_config_q31 weak_settings;
static pvid_weak_q31 weak;

#define MOST_PAIRS ((PVID_MAX_FUNCTIONS * (PVID_MAX_FUNCTIONS + 1)) / 2)

static int32_t taps[2][((PVID_MAX_TAPS - 1) / 2) + 1];
static int16_t chi[(3 * PVID_MAX_FUNCTIONS * PVID_MAX_WEAK_WINDOW) + 1];
static int32_t multiplier[PVID_WEAK_TERMS_Q31 + 1];
static int32_t gram[(PVID_WEAK_GRAMS * MOST_PAIRS) + 1];

static int start_weak(void **state)
{
    (void)state;
    design = weak_unit_design;
    design.smooth = taps[0];
    design.second = taps[1];
    design.chi = chi;
    design.multiplier = multiplier;
    design.gram = gram;
    weak_settings = weak_unit;
    weak_settings.design = &design;
    return 0;
}

static pvid_status init_weak(void)
{
    return pvid_weak_init_q31(&weak, &weak_settings);
}

static uint32_t weak_fingerprint(void)
{
    return pvid_fingerprint_weak_q31(&weak_settings);
}

static const bound weak_fields[] = {
    FIELD(pvid_weak_config_q31, , drive_min, KIND_INT32, 0.0, 262144.0, PVID_BAD_DRIVE_MIN),
    FIELD(pvid_weak_config_q31, , phi_offset, KIND_INT32, -2147483648.0, INT32_LAST, PVID_OK),
    FIELD(pvid_weak_config_q31, , y_offset, KIND_INT32, -2147483648.0, INT32_LAST, PVID_OK),
    FIELD(pvid_weak_config_q31, , iterations, KIND_UINT8, 1.0, PVID_MAX_ITERATIONS, PVID_BAD_ITERATIONS),
    FIELD(pvid_weak_config_q31, , pivot_noise.m, KIND_INT32, 0.0, ONE_Q30, PVID_BAD_PIVOT_NOISE),
    FIELD(pvid_weak_config_q31, , pivot_noise.e, KIND_INT32, -200.0, 200.0, PVID_BAD_PIVOT_NOISE),
    FIELD(pvid_weak_config_q31, , trust.kappa_min, KIND_INT32, 0.0, KAPPA_LAST, PVID_BAD_PUBLISH_KAPPA),
    FIELD(pvid_weak_config_q31, , trust.se_max, KIND_INT32, 1.0, INT32_LAST, PVID_BAD_SE_MAX),
    FIELD(pvid_weak_config_q31, , trust.misfit_max, KIND_UINT32, 65536.0, 4294967295.0, PVID_BAD_MISFIT_MAX),
    FIELD(pvid_weak_config_q31, , trust.groups_min, KIND_UINT16, 0.0, 65535.0, PVID_OK),
    FIELD(pvid_weak_config_q31, , trust.revert_after, KIND_UINT16, 0.0, 65535.0, PVID_OK),
    FIELD(pvid_weak_config_q31, , trust.renewal, KIND_UINT32, 655.0, 65536000.0, PVID_BAD_RENEWAL),
    FIELD(pvid_weak_config_q31, , gate.sigmas, KIND_UINT32, 131072.0, 65536000.0, PVID_BAD_GATE_SIGMAS),
    FIELD(pvid_weak_config_q31, , gate.patience_groups, KIND_UINT32, 0.0, ONE_Q30, PVID_BAD_GATE_PATIENCE),
    OF_ESTIMATOR(pvid_weak_config_q31, estimator.),
    FIELD(pvid_weak_config_q31, estimator., start_sd[3], KIND_INT32, 1.0, INT32_LAST, PVID_BAD_START_SD),
    FORMAT(pvid_weak_config_q31, estimator., p_bits[3]),
    FORMAT(pvid_weak_config_q31, estimator., n_bits[7]),
};

#define SIZE(member, kind, low, high, status)                                                                          \
    {#member, offsetof(pvid_weak_design_q31, member), kind, low, high, status, PVID_BAD_ITERATIONS}
/* Where F or U F would need more than 21 bits the design is refused for that. */
#define TIGHT(member, kind, low, high, status)                                                                         \
    {#member, offsetof(pvid_weak_design_q31, member), kind, low, high, status, PVID_BAD_SHIFT}
static const bound design_fields[] = {
    SIZE(taps, KIND_UINT16, 5.0, PVID_MAX_TAPS, PVID_BAD_TAPS),
    SIZE(decimation, KIND_UINT16, 1.0, PVID_MAX_DECIMATION, PVID_BAD_DECIMATION),
    SIZE(window, KIND_UINT16, 9.0, PVID_MAX_WEAK_WINDOW, PVID_BAD_WINDOW),
    SIZE(functions, KIND_UINT8, 4.0, PVID_MAX_FUNCTIONS, PVID_BAD_FUNCTIONS),
    SIZE(lag, KIND_UINT8, 1.0, 255.0, PVID_BAD_LAG),
    TIGHT(smooth_bits, KIND_UINT8, 0.0, 31.0, PVID_BAD_SHIFT),
    TIGHT(phi_shift, KIND_UINT8, 0.0, 62.0, PVID_BAD_SHIFT),
    SIZE(u_shift, KIND_UINT8, 0.0, 62.0, PVID_BAD_SHIFT),
    TIGHT(uf_shift, KIND_UINT8, 0.0, 62.0, PVID_BAD_SHIFT),
    SIZE(integral_shift[0], KIND_UINT8, 0.0, 62.0, PVID_BAD_SHIFT),
    SIZE(integral_shift[2], KIND_UINT8, 0.0, 62.0, PVID_BAD_SHIFT),
    SIZE(high_shift[0], KIND_UINT8, 0.0, 61.0, PVID_BAD_SHIFT),
    SIZE(high_shift[1], KIND_UINT8, 0.0, 61.0, PVID_BAD_SHIFT),
    SIZE(product_shift[0], KIND_UINT8, 0.0, 62.0, PVID_BAD_SHIFT),
    SIZE(product_shift[4], KIND_UINT8, 0.0, 62.0, PVID_BAD_SHIFT),
    SIZE(sum_shift, KIND_UINT8, 1.0, 30.0, PVID_BAD_SHIFT),
    SIZE(shift[0], KIND_UINT8, 0.0, 62.0, PVID_BAD_SHIFT),
    SIZE(shift[PVID_WEAK_TERMS_Q31 - 1], KIND_UINT8, 0.0, 62.0, PVID_BAD_SHIFT),
    SIZE(gram_bits[0], KIND_INT8, -128.0, 127.0, PVID_OK),
    SIZE(gram_bits[PVID_WEAK_GRAMS - 1], KIND_INT8, -128.0, 127.0, PVID_OK),
    TIGHT(phi_max, KIND_INT32, 1.0, 16777216.0, PVID_BAD_FULL_SCALE),
    SIZE(y_max, KIND_INT32, 1.0, 16777216.0, PVID_BAD_FULL_SCALE),
    TIGHT(u_max, KIND_INT32, 1.0, 262144.0, PVID_BAD_FULL_SCALE),
};

static void weak_form_fields_end_at_their_bounds(void **state)
{
    (void)state;
    check_bounds(weak_fields, LENGTH(weak_fields), &weak_settings, sizeof weak_settings, init_weak);
    check_bounds(design_fields, LENGTH(design_fields), &design, sizeof design, init_weak);
    const uint16_t odd[2] = {3, PVID_MAX_TAPS + 2};
    for (int i = 0; i < 2; i++) {
        design.taps = odd[i];
        assert_int_equal(init_weak(), PVID_BAD_TAPS);
    }
    (void)start_weak(NULL);
    const uint16_t windows[2] = {7, PVID_MAX_WEAK_WINDOW + 2};
    for (int i = 0; i < 2; i++) {
        design.window = windows[i];
        assert_int_equal(init_weak(), PVID_BAD_WINDOW);
    }
    (void)start_weak(NULL);
    weak_settings.design = NULL;
    assert_int_equal(init_weak(), PVID_BAD_DESIGN);
    (void)start_weak(NULL);
    weak_settings.trust.misfit_max = 0; /* no alarm */
    weak_settings.estimator.forgetting_groups = 0;
    assert_int_equal(init_weak(), PVID_OK);
    weak_settings.trust.misfit_max = 1;
    assert_int_equal(init_weak(), PVID_BAD_MISFIT_MAX);
    weak_settings.trust.misfit_max = 0;
    weak_settings.estimator.forgetting_groups = 1;
    assert_int_equal(init_weak(), PVID_BAD_FORGETTING);
}

#define ASSERT_TABLE(table)                                                                                            \
    do {                                                                                                               \
        (void)start_weak(NULL);                                                                                        \
        design.table = NULL;                                                                                           \
        assert_int_equal(init_weak(), PVID_BAD_DESIGN);                                                                \
    } while (0)

static void a_design_without_a_table_is_refused(void **state)
{
    (void)state;
    ASSERT_TABLE(smooth);
    ASSERT_TABLE(second);
    ASSERT_TABLE(chi);
    ASSERT_TABLE(multiplier);
    ASSERT_TABLE(gram);
}

#define REFUSED_AND_NOT(place, refused, accepted)                                                                      \
    do {                                                                                                               \
        (place) = (refused);                                                                                           \
        assert_int_equal(init_weak(), PVID_BAD_DESIGN);                                                                \
        (place) = (accepted);                                                                                          \
        assert_int_equal(init_weak(), PVID_OK);                                                                        \
        (place) = 0;                                                                                                   \
    } while (0)

/* Both ends of what an entry may be, in the first and the last place of every table. */
static void a_table_that_would_overflow_is_refused(void **state)
{
    (void)state;
    const size_t half = (design.taps - 1u) / 2u;
    const size_t last_chi = (3u * design.functions * design.window) - 1u;
    const size_t last_gram = ((PVID_WEAK_GRAMS / 2u) * design.functions * (design.functions + 1u)) - 1u;
    const int32_t steepest = INT32_MAX / (4 * design.y_max);
    REFUSED_AND_NOT(taps[1][0], steepest + 1, steepest);
    REFUSED_AND_NOT(taps[1][half - 1u], -steepest - 1, -steepest);
    REFUSED_AND_NOT(taps[1][0], INT32_MIN, 0);
    /* what the smoothing weights may add up to: F = 2^20 - 1 at full scale */
    const int64_t room = ((((int64_t)1 << 20) << design.phi_shift) - 1) / design.phi_max;
    const int64_t most = (room - ((int64_t)1 << design.smooth_bits)) / 4;
    const int64_t tallest = INT32_MAX / (4 * design.phi_max);
    const int32_t tall = (int32_t)((most < tallest) ? most : tallest);
    REFUSED_AND_NOT(taps[0][0], tall + 1, tall / 2);
    REFUSED_AND_NOT(taps[0][half - 1u], -tall - 1, -(tall / 2));
    const int32_t rounding = (int32_t)1 << (design.sum_shift - 1u);
    const int16_t highest = (int16_t)((INT32_MAX - rounding) >> 20);
    REFUSED_AND_NOT(chi[0], (int16_t)(highest + 1), highest);
    REFUSED_AND_NOT(chi[last_chi], (int16_t)(-highest - 1), (int16_t)-highest);
    REFUSED_AND_NOT(gram[0], (1 << 30) + 1, 1 << 30);
    REFUSED_AND_NOT(gram[last_gram], -(1 << 30) - 1, -(1 << 30));
    chi[last_chi + 1u] = INT16_MAX; /* beyond the tables nothing is looked at */
    gram[last_gram + 1u] = INT32_MAX;
    taps[0][half] = INT32_MAX;
    taps[1][half] = INT32_MAX;
    assert_int_equal(init_weak(), PVID_OK);
    chi[last_chi + 1u] = 0;
    gram[last_gram + 1u] = 0;
    taps[0][half] = 0;
    taps[1][half] = 0;
}

/* A window of nine samples has 4 free ticks at D = 1; what does not fit into 32 stages each is refused. */
static void a_window_that_cannot_be_worked_off_is_refused(void **state)
{
    (void)state;
    weak_settings.iterations = PVID_MAX_ITERATIONS;
    assert_int_equal(init_weak(), PVID_OK);
    design.window = 9;
    assert_int_equal(init_weak(), PVID_OK);
    assert_in_range(weak.stages_per_tick, 2, 8);
    design.decimation = 1;
    assert_int_equal(init_weak(), PVID_BAD_ITERATIONS);
    weak_settings.iterations = 1;
    assert_int_equal(init_weak(), PVID_OK);
    assert_in_range(weak.stages_per_tick, 9, 32);
    weak_settings.iterations = 5;
    weak_settings.estimator.gain = (1 << 30) - 1; /* the law of g < 1 is a rate: one step a window */
    assert_int_equal(init_weak(), PVID_OK);
    assert_int_equal(weak.iterations, 1);
}

static void weak_form_keeps_its_settings(void **state)
{
    (void)state;
    weak_settings.drive_min = 3;
    assert_int_equal(init_weak(), PVID_OK);
    assert_int_equal(weak.drive_min, 9 * 52 * 52);
    assert_int_equal(weak.zero_bits, weak_settings.estimator.p_bits[3]);
    assert_int_equal(weak.estimator.model->n_p, 4);
    weak_settings.zero_unknown = false;
    assert_int_equal(init_weak(), PVID_OK);
    assert_int_equal(weak.zero_bits, 0);
    assert_int_equal(weak.estimator.model->n_p, 3);
}

static void every_field_of_the_weak_form_is_in_its_fingerprint(void **state)
{
    (void)state;
    check_fingerprints(weak_fields, LENGTH(weak_fields), &weak_settings, sizeof weak_settings, weak_fingerprint);
    check_fingerprints(design_fields, LENGTH(design_fields), &design, sizeof design, weak_fingerprint);
    const uint32_t before = weak_fingerprint();
    /* c is a parameter only where the zero is unknown */
    weak_settings.estimator.start[3] = 5;
    assert_true(weak_fingerprint() != before);
    weak_settings.zero_unknown = false;
    const uint32_t zeroed = weak_fingerprint();
    assert_true(zeroed != before);
    weak_settings.estimator.start[3] = 0;
    assert_int_equal(weak_fingerprint(), zeroed);
    weak_settings.zero_unknown = true;
    int32_t *bounds[6] = {&weak_settings.estimator.start[0], &weak_settings.estimator.start[2],
                          &weak_settings.estimator.lower[0], &weak_settings.estimator.lower[3],
                          &weak_settings.estimator.upper[0], &weak_settings.estimator.upper[3]};
    for (int i = 0; i < 6; i++) {
        *bounds[i] -= 1;
        assert_true(weak_fingerprint() != before);
        *bounds[i] += 1;
    }
    assert_int_equal(weak_fingerprint(), before);
}

/* Each table is hashed to its last entry, and not beyond. */
static void every_entry_of_the_tables_is_in_the_fingerprint(void **state)
{
    (void)state;
    const size_t half = (weak_unit_design.taps - 1u) / 2u;
    const size_t functions = weak_unit_design.functions;
    const struct {
        int32_t *table;
        size_t entries;
    } tables[] = {
        {taps[0], half},
        {taps[1], half},
        {multiplier, PVID_WEAK_TERMS_Q31},
        {gram, PVID_WEAK_GRAMS * ((functions * (functions + 1u)) / 2u)},
    };
    const uint32_t before = weak_fingerprint();
    for (size_t i = 0; i < LENGTH(tables); i++) {
        for (size_t k = 0; k <= tables[i].entries; k++) {
            tables[i].table[k] = 1;
            assert_true((weak_fingerprint() != before) == (k < tables[i].entries));
            tables[i].table[k] = 0;
        }
    }
    const size_t entries = 3u * functions * weak_unit_design.window;
    for (size_t k = 0; k <= entries; k++) {
        chi[k] = 1;
        assert_true((weak_fingerprint() != before) == (k < entries));
        chi[k] = 0;
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(estimator_fields_end_at_their_bounds, start_own),
        cmocka_unit_test(start_and_bounds_agree_or_are_refused),
        cmocka_unit_test(a_model_fits_or_is_refused),
        cmocka_unit_test_setup(strong_form_fields_end_at_their_bounds, start_strong),
        cmocka_unit_test_setup(every_field_of_the_strong_form_is_in_its_fingerprint, start_strong),
        cmocka_unit_test_setup(weak_form_fields_end_at_their_bounds, start_weak),
        cmocka_unit_test(a_design_without_a_table_is_refused),
        cmocka_unit_test_setup(a_table_that_would_overflow_is_refused, start_weak),
        cmocka_unit_test_setup(a_window_that_cannot_be_worked_off_is_refused, start_weak),
        cmocka_unit_test_setup(weak_form_keeps_its_settings, start_weak),
        cmocka_unit_test_setup(every_field_of_the_weak_form_is_in_its_fingerprint, start_weak),
        cmocka_unit_test_setup(every_entry_of_the_tables_is_in_the_fingerprint, start_weak),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
