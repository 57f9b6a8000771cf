/* What the inits of the float core accept and refuse, at both ends of every field, and that every field is in the
 * fingerprint by which a snapshot knows its configuration. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "bounds.h"
#include "keep/fingerprint_f32.h"
#include "pvid/pvid.h"

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))
#define LEAST_FLOAT 1.401298464324817e-45f /* next to 0 */
#define RATE 1024.0f                       /* Hz; four ticks are 2^-8 s exactly */

/* A field of `type`, which has an estimator's configuration at `in`. */
#define FIELD(type, in, member, kind, low, high, status)                                                               \
    {#member, offsetof(type, in member), kind, low, high, status, PVID_OK}
#define OF_ESTIMATOR(type, in)                                                                                         \
    FIELD(type, in, start_sd[0], KIND_FLOAT, 1.0e-12f, 1.0e12f, PVID_BAD_START_SD),                                    \
        FIELD(type, in, start_sd[1], KIND_FLOAT, 1.0e-12f, 1.0e12f, PVID_BAD_START_SD),                                \
        FIELD(type, in, start_sd[2], KIND_FLOAT, 1.0e-12f, 1.0e12f, PVID_BAD_START_SD),                                \
        FIELD(type, in, row_sd, KIND_FLOAT, 1.0e-12f, 1.0e12f, PVID_BAD_ROW_SD),                                       \
        FIELD(type, in, feedback_hz, KIND_FLOAT, 0.0, 1.0e12f, PVID_BAD_FEEDBACK),                                     \
        FIELD(type, in, step_limit, KIND_FLOAT, 1.0e-6f, 0.9f, PVID_BAD_STEP_LIMIT),                                   \
        FIELD(type, in, kappa_min, KIND_FLOAT, 0.0, 0.999f, PVID_BAD_KAPPA_MIN),                                       \
        FIELD(type, in, noise_margin, KIND_FLOAT, 0.0, 1.0e6f, PVID_BAD_NOISE_MARGIN),                                 \
        FIELD(type, in, dead_zone, KIND_FLOAT, 0.0, 100.0f, PVID_BAD_DEAD_ZONE),                                       \
        FIELD(type, in, law, KIND_INT32, 0.0, 1.0, PVID_BAD_LAW),                                                      \
        FIELD(type, in, divider, KIND_UINT16, 1.0, 65535.0, PVID_BAD_DIVIDER)
#define OF_FORGETTING(type, in, seconds)                                                                               \
    FIELD(type, in, forgetting_s, KIND_FLOAT, seconds, 1.0e12f, PVID_BAD_FORGETTING)
#define OF_GATE(type)                                                                                                  \
    FIELD(type, , gate.sigmas, KIND_FLOAT, 2.0, 1.0e3f, PVID_BAD_GATE_SIGMAS),                                         \
        FIELD(type, , gate.patience_s, KIND_FLOAT, 0.0, 1.0e12f, PVID_BAD_GATE_PATIENCE)

static void fill_start(pvid_estimator_config_f32 *config)
{
    *config = pvid_estimator_defaults_f32;
    for (int i = 0; i < 3; i++) {
        config->start[i] = 8.0f;
        config->start_sd[i] = 2.0f;
        config->lower[i] = 1.0f;
        config->upper[i] = 40.0f;
    }
    config->row_sd = 1.0e-4f;
}

/* ---- the estimator, on a model of the user's own ---- */

#define MOST_THETA 9 /* whose 45 moments are PVID_MAX_MOMENTS */

static void theta_of(const float p[], float theta[])
{
    for (size_t i = 0; i < MOST_THETA; i++) {
        theta[i] = p[0];
    }
}

static void jacobian_of(const float p[], float c[])
{
    (void)p;
    for (size_t i = 0; i < MOST_THETA; i++) {
        c[i] = 1.0f;
    }
}

static const uint8_t c_row[(PVID_MAX_THETA * PVID_MAX_P) + 1] = {0, 1, 2, 3, 4, 5, 6, 7, 8};
static const uint8_t c_column[(PVID_MAX_THETA * PVID_MAX_P) + 1] = {0, 0, 0, 0, 0, 0, 0, 1, 2};

static pvid_model_f32 model;
static pvid_estimator_config_f32 own;
static pvid_estimator_f32 estimator;

static int start_own(void **state)
{
    (void)state;
    const pvid_model_f32 fresh = {
        .n_theta = MOST_THETA,
        .n_p = 3,
        .n_moments = 45,
        .n_c = 9,
        .positive = 3u, /* p[2] may have any sign */
        .c_row = c_row,
        .c_column = c_column,
        .theta = theta_of,
        .jacobian = jacobian_of,
    };
    model = fresh;
    fill_start(&own);
    own.model = &model;
    own.update_rate_hz = RATE;
    return 0;
}

static pvid_status init_own(void)
{
    static const pvid_estimator_f32 none;
    memset(&estimator, 0x5A, sizeof estimator);
    const pvid_status status = pvid_estimator_init_f32(&estimator, &own);
    if (status != PVID_OK) {
        assert_memory_equal(&none, &estimator, sizeof none); /* nothing is half made */
    }
    return status;
}

static void estimator_fields_end_at_their_bounds(void **state)
{
    (void)state;
    const bound fields[] = {
        OF_ESTIMATOR(pvid_estimator_config_f32, ),
        OF_FORGETTING(pvid_estimator_config_f32, , 4.0f / RATE),
        FIELD(pvid_estimator_config_f32, , update_rate_hz, KIND_FLOAT, 1.0e-6f, 1.0e6f, PVID_BAD_UPDATE_RATE),
        FIELD(pvid_estimator_config_f32, , correlation, KIND_FLOAT, 1.0, 1.0e6f, PVID_BAD_CORRELATION),
        FIELD(pvid_estimator_config_f32, , row_weight, KIND_FLOAT, 1.0e-6f, 1.0, PVID_BAD_ROW_WEIGHT),
    };
    check_bounds(fields, LENGTH(fields), &own, sizeof own, init_own);
    own.forgetting_s = 0.0f; /* none, whatever the rate */
    assert_int_equal(init_own(), PVID_OK);
    own.forgetting_s = LEAST_FLOAT;
    assert_int_equal(init_own(), PVID_BAD_FORGETTING);
}

/* Start, lower and upper of one parameter. */
static pvid_status init_with(size_t i, float start, float lower, float upper)
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
    const float below = nextafterf(8.0f, 0.0f);
    const float above = nextafterf(8.0f, 9.0f);
    for (size_t i = 0; i < 3u; i++) {
        assert_int_equal(init_with(i, 8.0f, 8.0f, 9.0f), PVID_OK);
        assert_int_equal(init_with(i, 8.0f, 7.0f, 8.0f), PVID_OK);
        assert_int_equal(init_with(i, below, 8.0f, 9.0f), PVID_BAD_START);
        assert_int_equal(init_with(i, above, 7.0f, 8.0f), PVID_BAD_START);
        assert_int_equal(init_with(i, 8.0f, 8.0f, 8.0f), PVID_BAD_BOUNDS);
        assert_int_equal(init_with(i, 8.0f, 9.0f, 7.0f), PVID_BAD_BOUNDS);
        assert_int_equal(init_with(i, 8.0f, LEAST_FLOAT, 9.0f), PVID_OK);
        const float strange[3] = {NAN, INFINITY, -INFINITY};
        for (int k = 0; k < 3; k++) {
            assert_int_equal(init_with(i, strange[k], 7.0f, 9.0f), PVID_BAD_START);
            assert_int_equal(init_with(i, 8.0f, strange[k], 9.0f), PVID_BAD_BOUNDS);
            assert_int_equal(init_with(i, 8.0f, 7.0f, strange[k]), PVID_BAD_BOUNDS);
        }
    }
    assert_int_equal(init_with(0, 8.0f, 0.0f, 9.0f), PVID_BAD_BOUNDS);
    assert_int_equal(init_with(1, 8.0f, -1.0f, 9.0f), PVID_BAD_BOUNDS);
    assert_int_equal(init_with(2, -8.0f, -9.0f, 0.0f), PVID_OK);
    assert_int_equal(init_with(3, NAN, NAN, NAN), PVID_OK); /* of no parameter */
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
    ASSERT_MODEL(model.c_row = NULL, PVID_BAD_MODEL);
    ASSERT_MODEL(model.c_column = NULL, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_theta = 0, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_theta = 10, PVID_BAD_MODEL); /* not of 45 moments */
    ASSERT_MODEL(model.n_p = 0, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_gated = 3, PVID_OK);
    ASSERT_MODEL(model.n_gated = 4, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_c = 0, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_c = 1, PVID_OK);
    ASSERT_MODEL(model.n_c = PVID_MAX_THETA * PVID_MAX_P, PVID_OK);
    ASSERT_MODEL(model.n_c = (PVID_MAX_THETA * PVID_MAX_P) + 1, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_moments = 0, PVID_BAD_MODEL);
    ASSERT_MODEL(model.n_moments = 44, PVID_BAD_MODEL);
    /* one entry, one parameter; two parameters are then too many */
    ASSERT_MODEL((model.n_theta = 1, model.n_moments = 1, model.n_p = 1), PVID_OK);
    ASSERT_MODEL((model.n_theta = 1, model.n_moments = 1, model.n_p = 2), PVID_BAD_MODEL);
    /* as many parameters as there is room for, and one more */
    for (size_t i = 3; i < PVID_MAX_P; i++) {
        own.start[i] = own.start[0];
        own.start_sd[i] = own.start_sd[0];
        own.lower[i] = own.lower[0];
        own.upper[i] = own.upper[0];
    }
    model.n_theta = MOST_THETA;
    model.n_moments = 45;
    model.n_p = PVID_MAX_P;
    assert_int_equal(init_own(), PVID_OK);
    model.n_p = PVID_MAX_P + 1;
    assert_int_equal(init_own(), PVID_BAD_MODEL);
}

/* Functions of its own come together or not at all; with them the moments may be fewer, and theta as long as it can. */
static void own_functions_are_all_or_none(void **state)
{
    (void)state;
    const pvid_model_f32 *strong = &pvid_kapitza_strong_f32;
    ASSERT_MODEL(model = *strong, PVID_OK);
    ASSERT_MODEL((model = *strong, own.row_weight = 0.5f), PVID_BAD_ROW_WEIGHT); /* it accumulates by itself */
    ASSERT_MODEL((model = *strong, model.take_row = NULL), PVID_OK);
    ASSERT_MODEL((model = *strong, model.accumulate = NULL), PVID_BAD_MODEL);
    ASSERT_MODEL((model = *strong, model.project = NULL), PVID_BAD_MODEL);
    ASSERT_MODEL((model = *strong, model.innovate = NULL), PVID_BAD_MODEL);
    ASSERT_MODEL((model = *strong, model.n_theta = PVID_MAX_THETA + 1), PVID_BAD_MODEL);
    ASSERT_MODEL((model = *strong, model.n_moments = PVID_MAX_MOMENTS), PVID_OK);
    ASSERT_MODEL((model = *strong, model.n_moments = PVID_MAX_MOMENTS + 1), PVID_BAD_MODEL);
    ASSERT_MODEL(model.take_row = strong->take_row, PVID_BAD_MODEL);
    ASSERT_MODEL(model.innovate = strong->innovate, PVID_BAD_MODEL);
}

/* g = feedback_hz * time between solves, at most 1; 0 asks for Gauss-Newton, and the other law for none. */
static void feedback_is_a_rate(void **state)
{
    (void)state;
    own.update_rate_hz = 4.0f;
    own.feedback_hz = 0.5f;
    assert_int_equal(init_own(), PVID_OK);
    assert_true(estimator.gain == 0.125f);
    own.divider = 2;
    assert_int_equal(init_own(), PVID_OK);
    assert_true(estimator.gain == 0.25f);
    own.feedback_hz = 100.0f;
    assert_int_equal(init_own(), PVID_OK);
    assert_true(estimator.gain == 1.0f);
    own.feedback_hz = 0.0f;
    assert_int_equal(init_own(), PVID_OK);
    assert_true(estimator.gain == 1.0f);
    own.feedback_hz = 0.5f;
    own.law = PVID_LAW_PSEUDOVELOCITY;
    assert_int_equal(init_own(), PVID_OK);
    assert_true(estimator.gain == 0.0f);
}

/* ---- the strong form ---- */

#define MOST_HALF ((PVID_MAX_WINDOW - 1) / 2)

static float bank[PVID_ORDERS * (MOST_HALF + 1)];
static pvid_strong_config_f32 strong_settings;

static int start_strong(void **state)
{
    (void)state;
    memset(&strong_settings, 0, sizeof strong_settings);
    memset(bank, 0, sizeof bank);
    fill_start(&strong_settings.estimator);
    strong_settings.sample_rate_hz = RATE;
    strong_settings.l1 = 0.3f;
    strong_settings.bank.half = 2;
    strong_settings.bank.stride = 1;
    strong_settings.bank.weights = bank;
    return 0;
}

static pvid_strong_f32 strong;

static pvid_status init_strong(void)
{
    return pvid_strong_init_f32(&strong, &strong_settings);
}

static uint32_t strong_fingerprint(void)
{
    return pvid_fingerprint_strong_f32(&strong_settings);
}

static const bound strong_fields[] = {
    FIELD(pvid_strong_config_f32, , sample_rate_hz, KIND_FLOAT, 1.0e-3f, 1.0e6f, PVID_BAD_SAMPLE_RATE),
    FIELD(pvid_strong_config_f32, , l1, KIND_FLOAT, 1.0e-6f, 1.0e6f, PVID_BAD_LENGTH),
    FIELD(pvid_strong_config_f32, , drive_min, KIND_FLOAT, 0.0, 1.0e9f, PVID_BAD_DRIVE_MIN),
    FIELD(pvid_strong_config_f32, , bank.half, KIND_UINT16, 2.0, MOST_HALF, PVID_BAD_HALF),
    FIELD(pvid_strong_config_f32, , bank.stride, KIND_UINT16, 1.0, MOST_HALF / 2, PVID_BAD_STRIDE),
    OF_GATE(pvid_strong_config_f32),
    OF_ESTIMATOR(pvid_strong_config_f32, estimator.),
    OF_FORGETTING(pvid_strong_config_f32, estimator., 4.0f / RATE),
    FIELD(pvid_strong_config_f32, estimator., correlation, KIND_FLOAT, 1.0, 1.0e6f, PVID_BAD_CORRELATION),
    FIELD(pvid_strong_config_f32, estimator., row_weight, KIND_FLOAT, 1.0, 1.0, PVID_BAD_ROW_WEIGHT),
};

static void strong_form_fields_end_at_their_bounds(void **state)
{
    (void)state;
    check_bounds(strong_fields, LENGTH(strong_fields), &strong_settings, sizeof strong_settings, init_strong);
    strong_settings.bank.weights = NULL;
    assert_int_equal(init_strong(), PVID_BAD_BANK);
    strong_settings.bank.weights = bank;
    for (size_t i = 0; i < 2u * PVID_ORDERS; i += (2u * PVID_ORDERS) - 1u) {
        bank[i] = NAN;
        assert_int_equal(init_strong(), PVID_BAD_BANK);
        bank[i] = 0.0f;
    }
    bank[2u * PVID_ORDERS] = NAN; /* not one of the bank's */
    assert_int_equal(init_strong(), PVID_OK);
}

static void strong_form_keeps_its_settings(void **state)
{
    (void)state;
    strong_settings.drive_min = 3.0f;
    strong_settings.gate.sigmas = 3.0f;
    assert_int_equal(init_strong(), PVID_OK);
    assert_true(strong.drive_min == 9.0f);
    assert_true(strong.drive_forgetting == 1.0f / RATE);
    assert_true(strong.gate.limit == 9.0f);
    assert_true(strong.gate.memory == 0.25f * RATE);
    assert_true(strong.gate.floor == 1.0e-6f * (1.0e-4f * 1.0e-4f));
    strong_settings.sample_rate_hz = 0.5f; /* a mean over less than a tick is the tick's own value */
    assert_int_equal(init_strong(), PVID_OK);
    assert_true(strong.drive_forgetting == 1.0f);
    assert_true(strong.gate.memory == 1.0f);
}

static void every_field_of_the_strong_form_is_in_its_fingerprint(void **state)
{
    (void)state;
    check_fingerprints(strong_fields, LENGTH(strong_fields) - 1u, &strong_settings, sizeof strong_settings,
                       strong_fingerprint); /* all but row_weight, which has one value */
    const uint32_t before = strong_fingerprint();
    for (size_t i = 0; i <= 2u * PVID_ORDERS; i++) {
        bank[i] = 1.0f;
        assert_true((strong_fingerprint() != before) == (i < 2u * PVID_ORDERS));
        bank[i] = 0.0f;
    }
    for (size_t i = 0; i < 4u; i++) {
        float *entries[3] = {&strong_settings.estimator.start[i], &strong_settings.estimator.lower[i],
                             &strong_settings.estimator.upper[i]};
        for (int k = 0; k < 3; k++) {
            const float kept = *entries[k];
            *entries[k] = kept + 1.0f;
            assert_true((strong_fingerprint() != before) == (i < 3u));
            *entries[k] = kept;
        }
    }
    strong_settings.estimator.row_weight = 0.5f;
    assert_true(strong_fingerprint() != before);
}

/* ---- the weak form ---- */

#define WINDOW 157
#define FUNCTIONS 6
#define HALF_TAPS ((PVID_MAX_TAPS - 1) / 2)
#define MOST_PAIRS ((PVID_MAX_FUNCTIONS * (PVID_MAX_FUNCTIONS + 1)) / 2)

static float smooth[HALF_TAPS + 1];
static float second[HALF_TAPS + 1];
static float chi[(3 * PVID_MAX_FUNCTIONS * PVID_MAX_WEAK_WINDOW) + 1];
static float gram[(6 * MOST_PAIRS) + 1];
static pvid_weak_design_f32 design;
static pvid_weak_angle_f32 angle;
static pvid_weak_config_f32 weak_settings;
static pvid_weak_f32 weak;

static int start_weak(void **state)
{
    (void)state;
    memset(&weak_settings, 0, sizeof weak_settings);
    memset(chi, 0, sizeof chi);
    const pvid_weak_design_f32 fresh = {
        .taps = 5,
        .decimation = 8,
        .window = WINDOW,
        .functions = FUNCTIONS,
        .smooth = smooth,
        .second = second,
        .chi = chi,
        .gram = gram,
        .overlap = 1.5f,
        .lag = 8,
    };
    design = fresh;
    fill_start(&weak_settings.estimator);
    weak_settings.estimator.start_sd[3] = 1.0f;
    weak_settings.estimator.lower[3] = -1.0f;
    weak_settings.estimator.upper[3] = 1.0f;
    weak_settings.sample_rate_hz = RATE;
    weak_settings.l1 = 0.3f;
    weak_settings.design = &design;
    weak_settings.zero_unknown = true;
    weak_settings.iterations = 3;
    weak_settings.trust = pvid_trust_defaults_f32;
    return 0;
}

static pvid_status init_weak(void)
{
    return pvid_weak_init_f32(&weak, &weak_settings);
}

static uint32_t weak_fingerprint(void)
{
    return pvid_fingerprint_weak_f32(&weak_settings);
}

static const bound weak_fields[] = {
    FIELD(pvid_weak_config_f32, , sample_rate_hz, KIND_FLOAT, 1.0e-3f, 1.0e6f, PVID_BAD_SAMPLE_RATE),
    FIELD(pvid_weak_config_f32, , l1, KIND_FLOAT, 1.0e-6f, 1.0e6f, PVID_BAD_LENGTH),
    FIELD(pvid_weak_config_f32, , drive_min, KIND_FLOAT, 0.0, 1.0e9f, PVID_BAD_DRIVE_MIN),
    FIELD(pvid_weak_config_f32, , pivot_noise, KIND_FLOAT, 0.0, 1.0e9f, PVID_BAD_PIVOT_NOISE),
    FIELD(pvid_weak_config_f32, , angle_limit, KIND_FLOAT, 0.0, 1.0e9f, PVID_BAD_ANGLE_LIMIT),
    FIELD(pvid_weak_config_f32, , iterations, KIND_UINT8, 1.0, PVID_MAX_ITERATIONS, PVID_BAD_ITERATIONS),
    FIELD(pvid_weak_config_f32, , trust.kappa_min, KIND_FLOAT, 0.0, 0.999f, PVID_BAD_PUBLISH_KAPPA),
    FIELD(pvid_weak_config_f32, , trust.se_max, KIND_FLOAT, 1.0e-9f, 1.0e9f, PVID_BAD_SE_MAX),
    FIELD(pvid_weak_config_f32, , trust.misfit_max, KIND_FLOAT, 1.0, 1.0e6f, PVID_BAD_MISFIT_MAX),
    FIELD(pvid_weak_config_f32, , trust.groups_min, KIND_UINT16, 0.0, 65535.0, PVID_OK),
    FIELD(pvid_weak_config_f32, , trust.revert_after, KIND_UINT16, 0.0, 65535.0, PVID_OK),
    FIELD(pvid_weak_config_f32, , trust.renewal, KIND_FLOAT, 0.01f, 1.0e3f, PVID_BAD_RENEWAL),
    OF_GATE(pvid_weak_config_f32),
    OF_ESTIMATOR(pvid_weak_config_f32, estimator.),
    FIELD(pvid_weak_config_f32, , estimator.start_sd[3], KIND_FLOAT, 1.0e-12f, 1.0e12f, PVID_BAD_START_SD),
};

/* Ends of a size leave a window that cannot always be worked off in time. */
#define SIZE(member, kind, low, high, status)                                                                          \
    {#member, offsetof(pvid_weak_design_f32, member), kind, low, high, status, PVID_BAD_ITERATIONS}
static const bound design_fields[] = {
    SIZE(taps, KIND_UINT16, 5.0, PVID_MAX_TAPS, PVID_BAD_TAPS),
    SIZE(decimation, KIND_UINT16, 1.0, PVID_MAX_DECIMATION, PVID_BAD_DECIMATION),
    SIZE(window, KIND_UINT16, 9.0, PVID_MAX_WEAK_WINDOW, PVID_BAD_WINDOW),
    SIZE(functions, KIND_UINT8, 4.0, PVID_MAX_FUNCTIONS, PVID_BAD_FUNCTIONS),
    SIZE(lag, KIND_UINT8, 1.0, 255.0, PVID_BAD_LAG),
    SIZE(overlap, KIND_FLOAT, 1.0, 1.0e6f, PVID_BAD_OVERLAP),
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
    weak_settings.design = NULL;
    assert_int_equal(init_weak(), PVID_BAD_DESIGN);
    (void)start_weak(NULL);
    weak_settings.trust.misfit_max = 0.0f; /* no alarm */
    assert_int_equal(init_weak(), PVID_OK);
    weak_settings.gate.sigmas = 0.0f; /* no gate */
    assert_int_equal(init_weak(), PVID_OK);
    weak_settings.gate.sigmas = LEAST_FLOAT;
    assert_int_equal(init_weak(), PVID_BAD_GATE_SIGMAS);
    weak_settings.gate.sigmas = 0.0f;
    weak_settings.trust.misfit_max = LEAST_FLOAT;
    assert_int_equal(init_weak(), PVID_BAD_MISFIT_MAX);
}

/* Each table is read to its last entry, and not beyond. */
static void every_entry_of_the_tables_has_to_be_finite(void **state)
{
    (void)state;
    const struct {
        float *table;
        size_t entries;
    } tables[] = {
        {smooth, 2},
        {second, 2},
        {chi, (size_t)3 * FUNCTIONS * WINDOW},
        {gram, (size_t)6 * ((FUNCTIONS * (FUNCTIONS + 1)) / 2)},
    };
    for (size_t i = 0; i < LENGTH(tables); i++) {
        const size_t places[4] = {0, tables[i].entries / 2u, tables[i].entries - 1u, tables[i].entries};
        const uint32_t before = weak_fingerprint();
        for (int k = 0; k < 4; k++) {
            float *entry = &tables[i].table[places[k]];
            *entry = NAN;
            assert_int_equal(init_weak(), (k < 3) ? PVID_BAD_DESIGN : PVID_OK);
            *entry = 1.0f;
            assert_true((weak_fingerprint() != before) == (k < 3));
            *entry = 0.0f;
        }
    }
    const float **pointers[4] = {&design.smooth, &design.second, &design.chi, &design.gram};
    for (int i = 0; i < 4; i++) {
        const float *kept = *pointers[i];
        *pointers[i] = NULL;
        assert_int_equal(init_weak(), PVID_BAD_DESIGN);
        *pointers[i] = kept;
    }
}

static void the_correction_needs_storage_and_passes(void **state)
{
    (void)state;
    const bound passes[] = {
        {"passes", offsetof(pvid_weak_config_f32, passes), KIND_UINT8, 1.0, PVID_MAX_PASSES, PVID_BAD_ANGLE,
         PVID_BAD_ITERATIONS},
    };
    weak_settings.full_angle = true;
    weak_settings.passes = 3;
    assert_int_equal(init_weak(), PVID_BAD_ANGLE);
    weak_settings.angle = &angle;
    check_bounds(passes, 1, &weak_settings, sizeof weak_settings, init_weak);
    weak_settings.full_angle = false; /* not asked for: nobody looks */
    weak_settings.passes = 0;
    assert_int_equal(init_weak(), PVID_OK);
    assert_null(weak.angle);
    weak_settings.friction = true; /* this build has no room for its two parameters */
    weak_settings.passes = 3;
    assert_int_equal(init_weak(), PVID_BAD_ANGLE);
}

static void weak_form_keeps_its_settings(void **state)
{
    (void)state;
    weak_settings.drive_min = 3.0f;
    weak_settings.pivot_noise = 16.0f;
    weak_settings.estimator.row_sd = 0.5f;
    weak_settings.estimator.forgetting_s = 64.0f;
    weak_settings.gate.sigmas = 3.0f;
    weak_settings.gate.patience_s = 2.0f;
    assert_int_equal(init_weak(), PVID_OK);
    const float windows_hz = RATE / (8.0f * 78.0f);
    const float groups = 64.0f * windows_hz;
    assert_true(weak.drive_min == 9.0f);
    assert_true(weak.dt == 8.0f / RATE);
    assert_true(weak.row_variance == 0.25f);
    assert_true(weak.pivot_noise == 16.0f / (64.0f * 64.0f * 64.0f * 64.0f / (RATE * RATE * RATE * RATE)));
    assert_true(weak.estimator.information.row_weight == 4.0f / 6.0f);
    assert_true(weak.estimator.correlation == 1.5f);
    assert_true((weak.trust.long_memory >= groups / 1.5f) && (weak.trust.long_memory <= groups * 1.5f));
    assert_int_equal(weak.estimator.model->n_p, 4);
    assert_true(weak.finish.gate.memory == 4.0f);
    assert_true(weak.finish.gate.floor == 1.0f);
    const float growth = weak.finish.gate.widening - 1.0f; /* a factor of 1e4 within the time of patience */
    const float expected = 9.21034f / (2.0f * windows_hz);
    assert_true((growth > 0.999f * expected) && (growth < 1.001f * expected));
    weak_settings.estimator.feedback_hz = 0.01f; /* the law of g < 1 is a rate: one step a window */
    assert_int_equal(init_weak(), PVID_OK);
    assert_int_equal(weak.iterations, 1);
    weak_settings.zero_unknown = false;
    assert_int_equal(init_weak(), PVID_OK);
    assert_int_equal(weak.estimator.model->n_p, 3);
}

static void every_field_of_the_weak_form_is_in_its_fingerprint(void **state)
{
    (void)state;
    check_fingerprints(weak_fields, LENGTH(weak_fields), &weak_settings, sizeof weak_settings, weak_fingerprint);
    check_fingerprints(design_fields, LENGTH(design_fields), &design, sizeof design, weak_fingerprint);
    const uint32_t before = weak_fingerprint();
    bool *flags[2] = {&weak_settings.full_angle, &weak_settings.zero_unknown};
    for (int i = 0; i < 2; i++) {
        *flags[i] = !*flags[i];
        const uint32_t one = weak_fingerprint();
        assert_true(one != before);
        weak_settings.passes++; /* of the correction, where one is asked for */
        assert_true((weak_fingerprint() != one) == (i == 0));
        weak_settings.passes--;
        *flags[i] = !*flags[i];
    }
    /* c is a parameter only where the zero is unknown */
    weak_settings.estimator.start[3] = 0.5f;
    assert_true(weak_fingerprint() != before);
    weak_settings.zero_unknown = false;
    const uint32_t zeroed = weak_fingerprint();
    weak_settings.estimator.start[3] = 0.0f;
    assert_int_equal(weak_fingerprint(), zeroed);
    weak_settings.zero_unknown = true;
    assert_int_equal(weak_fingerprint(), before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(estimator_fields_end_at_their_bounds, start_own),
        cmocka_unit_test(start_and_bounds_agree_or_are_refused),
        cmocka_unit_test(a_model_fits_or_is_refused),
        cmocka_unit_test(own_functions_are_all_or_none),
        cmocka_unit_test_setup(feedback_is_a_rate, start_own),
        cmocka_unit_test_setup(strong_form_fields_end_at_their_bounds, start_strong),
        cmocka_unit_test_setup(strong_form_keeps_its_settings, start_strong),
        cmocka_unit_test_setup(every_field_of_the_strong_form_is_in_its_fingerprint, start_strong),
        cmocka_unit_test_setup(weak_form_fields_end_at_their_bounds, start_weak),
        cmocka_unit_test_setup(every_entry_of_the_tables_has_to_be_finite, start_weak),
        cmocka_unit_test_setup(the_correction_needs_storage_and_passes, start_weak),
        cmocka_unit_test_setup(weak_form_keeps_its_settings, start_weak),
        cmocka_unit_test_setup(every_field_of_the_weak_form_is_in_its_fingerprint, start_weak),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
