/* A model of the user's own, as init of the estimator accepts or refuses it. All other refusals are tested by
 * tests/core/test_bad_config.py, and under sanitizers by tests/fuzz/fuzz_api.c. */
#include "test.h"

#include "identity_q31.h"
#include "pvid/pvid.h"

#define THETA_F32 9 /* whose 45 moments are PVID_MAX_MOMENTS */
#define MOST_C ((PVID_MAX_THETA * PVID_MAX_P) + 1)

static const uint8_t c_row[MOST_C] = {0, 1, 2, 3, 4, 5, 6, 7, 8};
static const uint8_t c_column[MOST_C] = {0, 0, 0, 0, 0, 0, 0, 1, 2};

static void theta_f32(const float p[], float theta[])
{
    for (size_t i = 0; i < THETA_F32; i++) {
        theta[i] = p[0];
    }
}

static void jacobian_f32(const float p[], float c[])
{
    (void)p;
    for (size_t i = 0; i < THETA_F32; i++) {
        c[i] = 1.0f;
    }
}

static void theta_q31(const int32_t p[], int64_t theta[])
{
    for (size_t i = 0; i < PVID_MAX_THETA_Q31; i++) {
        theta[i] = p[0];
    }
}

static void jacobian_q31(const int32_t p[], int64_t c[])
{
    (void)p;
    memset(c, 0, PVID_MAX_C_Q31 * sizeof c[0]);
}

static void formats_q31(const int8_t p_bits[], int16_t theta_bits[], int16_t c_bits[])
{
    for (size_t i = 0; i < PVID_MAX_THETA_Q31; i++) {
        theta_bits[i] = p_bits[0];
    }
    memset(c_bits, 0, PVID_MAX_C_Q31 * sizeof c_bits[0]);
}

static pvid_model_f32 model;
static pvid_estimator_config_f32 config;
static pvid_model_q31 fixed;
static pvid_estimator_config_q31 fixed_config;

static void begin(void)
{
    const pvid_model_f32 fresh = {
        .n_theta = THETA_F32,
        .n_p = 3,
        .n_moments = 45,
        .n_c = 9,
        .positive = 3u, /* p[2] may have any sign */
        .c_row = c_row,
        .c_column = c_column,
        .theta = theta_f32,
        .jacobian = jacobian_f32,
    };
    const pvid_model_q31 fresh_fixed = {
        .n_theta = 5,
        .n_p = 3,
        .n_c = 5,
        .positive = 3u,
        .c_row = c_row,
        .c_column = c_column,
        .theta = theta_q31,
        .jacobian = jacobian_q31,
        .formats = formats_q31,
    };
    model = fresh;
    fixed = fresh_fixed;
    config = pvid_estimator_defaults_f32;
    config.model = &model;
    config.row_sd = 1.0e-4f;
    config.update_rate_hz = 1024.0f;
    fixed_config = usual_config_q31(&fixed);
    for (size_t i = 0; i < PVID_MAX_P; i++) {
        config.start[i] = 8.0f;
        config.start_sd[i] = 2.0f;
        config.lower[i] = 1.0f;
        config.upper[i] = 40.0f;
        fixed_config.start[i] = 800;
        fixed_config.start_sd[i] = 200;
        fixed_config.lower[i] = 100;
        fixed_config.upper[i] = 4000;
    }
}

static pvid_status init_f32(void)
{
    static const pvid_estimator_f32 none;
    pvid_estimator_f32 estimator;
    memset(&estimator, 0x5A, sizeof estimator);
    const pvid_status status = pvid_estimator_init_f32(&estimator, &config);
    if (status != PVID_OK) {
        assert_memory_equal(&none, &estimator, sizeof none); /* nothing is half made */
    }
    return status;
}

static pvid_status init_q31(void)
{
    static const pvid_estimator_q31 none;
    pvid_estimator_q31 estimator;
    memset(&estimator, 0x5A, sizeof estimator);
    const pvid_status status = pvid_estimator_init_q31(&estimator, &fixed_config);
    if (status != PVID_OK) {
        assert_memory_equal(&none, &estimator, sizeof none);
    }
    return status;
}

#define ASSERT_INIT(init, change, status)                                                                              \
    do {                                                                                                               \
        begin();                                                                                                       \
        change;                                                                                                        \
        assert_int_equal(init(), status);                                                                              \
    } while (0)
#define ACCEPTED_F32(change) ASSERT_INIT(init_f32, change, PVID_OK)
#define REFUSED_F32(change) ASSERT_INIT(init_f32, change, PVID_BAD_MODEL)
#define ACCEPTED_Q31(change) ASSERT_INIT(init_q31, change, PVID_OK)
#define REFUSED_Q31(change) ASSERT_INIT(init_q31, change, PVID_BAD_MODEL)

static void a_float_model_fits_or_is_refused(void **state)
{
    ACCEPTED_F32((void)0);
    REFUSED_F32(config.model = NULL);
    REFUSED_F32(model.theta = NULL);
    REFUSED_F32(model.jacobian = NULL);
    REFUSED_F32(model.c_row = NULL);
    REFUSED_F32(model.c_column = NULL);
    REFUSED_F32(model.n_theta = 0);
    REFUSED_F32(model.n_theta = 10); /* not of 45 moments */
    REFUSED_F32(model.n_p = 0);
    ACCEPTED_F32(model.n_p = PVID_MAX_P);
    REFUSED_F32(model.n_p = PVID_MAX_P + 1);
    REFUSED_F32(model.n_moments = 46);
    REFUSED_F32(model.n_c = 0);
    ACCEPTED_F32(model.n_c = 1);
    ACCEPTED_F32(model.n_c = MOST_C - 1);
    REFUSED_F32(model.n_c = MOST_C);
    REFUSED_F32(model.n_moments = 0);
    REFUSED_F32(model.n_moments = 44);
    ACCEPTED_F32((model.n_theta = 1, model.n_moments = 1, model.n_p = 1));
    REFUSED_F32((model.n_theta = 1, model.n_moments = 1, model.n_p = 2));
    ASSERT_INIT(init_f32, config.lower[1] = 0.0f, PVID_BAD_BOUNDS); /* positive */
    ACCEPTED_F32((config.start[2] = -8.0f, config.lower[2] = -9.0f));
    ACCEPTED_F32(config.start[3] = 0.0f); /* of no parameter */
}

static void a_fixed_point_model_fits_or_is_refused(void **state)
{
    ACCEPTED_Q31((void)0);
    REFUSED_Q31(fixed_config.model = NULL);
    REFUSED_Q31(fixed.theta = NULL);
    REFUSED_Q31(fixed.jacobian = NULL);
    REFUSED_Q31(fixed.formats = NULL);
    REFUSED_Q31(fixed.c_row = NULL);
    REFUSED_Q31(fixed.c_column = NULL);
    REFUSED_Q31(fixed.n_theta = 0);
    ACCEPTED_Q31(fixed.n_theta = PVID_MAX_THETA_Q31);
    REFUSED_Q31(fixed.n_theta = PVID_MAX_THETA_Q31 + 1);
    REFUSED_Q31(fixed.n_p = 0);
    ACCEPTED_Q31(fixed.n_p = PVID_MAX_P);
    REFUSED_Q31(fixed.n_p = PVID_MAX_P + 1);
    ACCEPTED_Q31((fixed.n_theta = 1, fixed.n_p = 1));
    REFUSED_Q31((fixed.n_theta = 1, fixed.n_p = 2));
    REFUSED_Q31(fixed.n_c = 0);
    ACCEPTED_Q31(fixed.n_c = 1);
    ACCEPTED_Q31(fixed.n_c = PVID_MAX_C_Q31);
    REFUSED_Q31(fixed.n_c = PVID_MAX_C_Q31 + 1);
    ASSERT_INIT(init_q31, fixed_config.lower[1] = 0, PVID_BAD_BOUNDS); /* positive */
    ACCEPTED_Q31((fixed_config.start[2] = -8, fixed_config.lower[2] = -INT32_MAX));
    ASSERT_INIT(init_q31, fixed_config.lower[2] = INT32_MIN, PVID_BAD_BOUNDS);  /* its magnitude is no int32 */
    ACCEPTED_Q31((fixed_config.n_bits[5] = 127, fixed_config.p_bits[3] = 127)); /* of no entry, of no parameter */
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(a_float_model_fits_or_is_refused),
    cmocka_unit_test(a_fixed_point_model_fits_or_is_refused),
};
RUN(tests)
