/* What the weak form in fixed point refuses: every count, index, pointer and number of a model, a design and the
 * configuration. */
#include "test.h"

#include "kapitza_plant_q31.h"
#include "pvid/pvid_q31.h"
#include "weak/valid_q31.h"

#define ONE_Q30 ((int32_t)1 << 30)

enum { CONSTANT = 8, INTEGRAL = 1, PLAIN = 5, RAMP = 7 }; /* channels */

static struct {
    pvid_weak_signal signal[2];
    pvid_weak_jet jet[2];
    pvid_weak_channel channel[9];
    pvid_weak_term_q31 term[13];
    pvid_weak_kind kind[1];
    int32_t full_scale[2];
    uint8_t down[2];
    pvid_weak_filter_q31 filter[2];
    pvid_weak_integral_q31 integral[3];
    pvid_weak_format_q31 format[9];
    pvid_scaled_q31 factor[13];
    pvid_weak_noise_q31 noise[21];
    uint8_t order[1];
    pvid_scaled_q31 variance[1];
    pvid_rescale_q31 run[1];
    int32_t width[1];
    int32_t weights[PVID_MAX_RING + 2];
    int32_t offset[2];
    int32_t least[2];
} own;
static pvid_model_q31 theta;
static pvid_weak_model_q31 model;
static pvid_weak_design_q31 design;
static pvid_weak_config_q31 config;
static pvid_weak_q31 identifier;

static bool prepare(const int32_t jet[], int32_t out[])
{
    (void)jet;
    out[0] = 0;
    return true;
}

#include "weak_valid_cases.h"

static void start_again(void)
{
    config = kapitza_config_q31;
    design = kapitza_design_q31;
    model = kapitza_weak_q31;
    theta = kapitza_model_q31;
    memset(&own, 0, sizeof own);
    memcpy(own.signal, kapitza_signal, sizeof own.signal);
    memcpy(own.jet, kapitza_jet, sizeof own.jet);
    memcpy(own.channel, kapitza_channel, sizeof own.channel);
    memcpy(own.term, kapitza_term, sizeof own.term);
    memcpy(own.kind, kapitza_kind, sizeof own.kind);
    memcpy(own.full_scale, kapitza_full_scale_q31, sizeof own.full_scale);
    memcpy(own.down, kapitza_down_q31, sizeof own.down);
    memcpy(own.filter, kapitza_filter_q31, sizeof own.filter);
    memcpy(own.integral, kapitza_integral_q31, sizeof own.integral);
    memcpy(own.format, kapitza_format_q31, sizeof own.format);
    memcpy(own.factor, kapitza_factor_q31, sizeof own.factor);
    memcpy(own.noise, kapitza_noise_q31, sizeof own.noise);
    own.run[0].multiplier = 1;
    point_at_own();
    design.full_scale = own.full_scale;
    design.down = own.down;
    design.filter = own.filter;
    design.integral = own.integral;
    design.format = own.format;
    design.factor = own.factor;
    config.design = &design;
    config.offset = own.offset;
    config.drive_min = own.least;
}

static pvid_status validity(void)
{
    return pvid_weak_valid_q31(&design);
}

/* A running integral and a sign, which the pendulum has not. */
#define WITH_RUN                                                                                                       \
    model.runs = 1;                                                                                                    \
    model.prepare = prepare;                                                                                           \
    design.run = own.run
#define WITH_SIGN                                                                                                      \
    model.signs = 1;                                                                                                   \
    model.prepare = prepare;                                                                                           \
    design.sign_width = own.width

static void counts_of_a_model(void **state)
{
    assert_int_equal(pvid_weak_valid_q31(NULL), PVID_BAD_DESIGN);
    GIVES(model.jets = PVID_MAX_INPUTS + 1, PVID_BAD_MODEL);
    GIVES(WITH_RUN, PVID_OK);
    GIVES(WITH_RUN; model.runs = PVID_MAX_INTEGRANDS + 1, PVID_BAD_MODEL);
    GIVES(WITH_SIGN, PVID_OK);
    GIVES(WITH_SIGN; model.signs = PVID_MAX_INTEGRANDS + 1, PVID_BAD_MODEL);
    GIVES(WITH_SIGN; model.prepare = NULL, PVID_BAD_MODEL);
    GIVES(model.channels = PVID_MAX_CHANNELS + 2, PVID_BAD_MODEL);
}

static void pointers_of_model_and_design(void **state)
{
    GIVES(design.full_scale = NULL, PVID_BAD_DESIGN);
    GIVES(design.down = NULL, PVID_BAD_DESIGN);
    GIVES(design.filter = NULL, PVID_BAD_DESIGN);
    GIVES(design.format = NULL, PVID_BAD_DESIGN);
    GIVES(design.factor = NULL, PVID_BAD_DESIGN);
    GIVES(design.noise = NULL; design.n_noise = 0, PVID_OK);
    GIVES(design.integral = NULL, PVID_BAD_DESIGN);
    GIVES(WITH_RUN; design.run = NULL, PVID_BAD_DESIGN);
    GIVES(WITH_SIGN; design.sign_width = NULL, PVID_BAD_DESIGN);
}

static void sizes_of_a_design(void **state)
{
    GIVES(design.power = 0, PVID_BAD_FUNCTIONS);
    GIVES(design.power = 5, PVID_BAD_FUNCTIONS);
    GIVES(design.power = PVID_MAX_POWER + 2, PVID_BAD_FUNCTIONS);
    GIVES(design.hop = 8, PVID_OK);
    GIVES(design.hop = 4, PVID_BAD_WINDOW); /* less than the harmonics */
    GIVES(design.hop = 33, PVID_BAD_WINDOW);
    GIVES(design.hop = 4096 + 4, PVID_BAD_WINDOW);
}

static void tables_of_a_model(void **state)
{
    GIVES(own.signal[1].source = PVID_SIGNAL_LAST + 1, PVID_BAD_MODEL);
    GIVES(own.jet[1].order = PVID_MAX_POWER + 1, PVID_BAD_MODEL);
    GIVES(own.channel[CONSTANT].fold = 1, PVID_BAD_MODEL);
    GIVES(own.channel[2] = kapitza_channel[CONSTANT], PVID_BAD_MODEL); /* not the last one */
    GIVES(own.channel[0] = kapitza_channel[CONSTANT]; model.channels = 1, PVID_BAD_MODEL);
    GIVES(own.channel[0].gain = 3, PVID_BAD_MODEL);
    GIVES(own.channel[INTEGRAL].fold = 3, PVID_BAD_MODEL);
    GIVES(own.channel[INTEGRAL].integrand = 3, PVID_BAD_MODEL);
    GIVES(own.channel[INTEGRAL].plain = 9, PVID_BAD_MODEL);
    GIVES(own.channel[INTEGRAL].plain = 0, PVID_BAD_MODEL);    /* of another gain */
    GIVES(own.channel[INTEGRAL].plain = RAMP, PVID_BAD_MODEL); /* an integral itself */
    GIVES(own.channel[INTEGRAL].ramp = PLAIN, PVID_BAD_MODEL);
    GIVES(own.channel[RAMP].integrand = 0, PVID_BAD_MODEL); /* the ramp of others */
    GIVES(own.term[3].channel = 9, PVID_BAD_MODEL);
    GIVES(own.term[12].column = 11, PVID_BAD_MODEL);
    GIVES(own.term[3].column = 1, PVID_BAD_MODEL); /* behind a larger one */
    GIVES(own.term[10].order = 5, PVID_BAD_MODEL);
    GIVES(own.factor[1].m = ONE_Q30, PVID_OK);
    GIVES(own.factor[1].m = ONE_Q30 + 1, PVID_BAD_MODEL);
    GIVES(own.factor[1].m = -ONE_Q30, PVID_OK);
    GIVES(own.factor[1].m = -ONE_Q30 - 1, PVID_BAD_MODEL);
    GIVES(own.factor[1].e = 8193, PVID_BAD_MODEL);
    GIVES(own.factor[1].e = -8193, PVID_BAD_MODEL);
    GIVES(own.kind[0].thetas = 7, PVID_BAD_MODEL); /* theta has eight */
    GIVES(own.kind[0].nuisances = PVID_MAX_COLUMNS - 8, PVID_BAD_MODEL);
    GIVES(own.kind[0].nuisances = 7; own.kind[0].thetas = 1, PVID_BAD_MODEL);
    GIVES(theta.n_theta = 9, PVID_BAD_MODEL);
    static pvid_weak_term_q31 many[16];
    static pvid_scaled_q31 of_many[16];
    GIVES(model.term = many; design.factor = of_many; own.kind[0].end = 15, PVID_OK);
    GIVES(model.term = many; design.factor = of_many; own.kind[0].end = 16, PVID_BAD_MODEL); /* of one column */
}

static void several_kinds(void **state)
{
    static pvid_weak_kind two[2] = {{3, 0, 0, 6}, {5, 0, 6, 13}};
    static pvid_weak_term_q31 of_two[13] = {{0, 0, 0}, {1, 0, 1}, {2, 0, 2}, {0, 0, 3}, {3, 0, 3}, {4, 0, 3}, {2, 0, 0},
                                            {5, 0, 1}, {6, 0, 2}, {8, 0, 3}, {2, 0, 4}, {5, 0, 5}, {7, 0, 5}};
    static const uint8_t ends[2] = {3, 8};
    static const uint8_t others[2] = {4, 8};
    static const uint8_t orders[2] = {0, 0};
    static const pvid_scaled_q31 variances[2] = {{0, 0}, {0, 0}};
#define TWO                                                                                                            \
    model.kinds = 2;                                                                                                   \
    model.kind = two;                                                                                                  \
    model.term = of_two;                                                                                               \
    theta.n_kinds = 2;                                                                                                 \
    theta.kind_end = ends;                                                                                             \
    design.n_noise = 0;                                                                                                \
    design.error_order = orders;                                                                                       \
    design.error_variance = variances
    GIVES(TWO, PVID_OK);
    GIVES(TWO; theta.n_kinds = 1, PVID_BAD_MODEL);
    GIVES(TWO; theta.kind_end = NULL, PVID_BAD_MODEL);
    GIVES(TWO; theta.kind_end = others, PVID_BAD_MODEL);
}

static void full_scales_and_filters(void **state)
{
    GIVES(own.full_scale[0] = 0, PVID_BAD_FULL_SCALE);
    GIVES(own.full_scale[0] = ((int32_t)1 << 24) + 1, PVID_BAD_FULL_SCALE);
    GIVES(own.full_scale[0] = (int32_t)1 << 24, PVID_BAD_FULL_SCALE); /* 24 24 times that exceeds an int32 */
    GIVES(own.down[0] = 0; own.full_scale[0] = 1 << 20, PVID_BAD_FULL_SCALE);
    GIVES(own.down[0] = 31, PVID_OK);
    GIVES(own.down[0] = 32, PVID_BAD_FULL_SCALE);
    GIVES(own.signal[1].source = PVID_SIGNAL_HELD; own.full_scale[1] = (int32_t)1 << 18, PVID_BAD_FULL_SCALE);
    GIVES(own.signal[1].source = PVID_SIGNAL_JUMP, PVID_OK);
    GIVES(own.filter[0].half = PVID_MAX_RING; own.filter[0].weights = own.weights, PVID_BAD_TAPS);
    GIVES(own.filter[0].half = PVID_MAX_RING + 1; own.filter[0].weights = own.weights, PVID_BAD_DESIGN);
    GIVES(own.filter[0].down = 63, PVID_BAD_DESIGN);
    GIVES(own.filter[0].weights = NULL, PVID_BAD_DESIGN);
    GIVES(own.filter[0].half = 1; own.filter[0].weights = own.weights, PVID_OK);
    GIVES(own.filter[0].half = 1; own.filter[0].weights = own.weights; own.weights[1] = ONE_Q30 + 1, PVID_BAD_DESIGN);
    GIVES(
        own.filter[0].half = 9; own.filter[0].weights = own.weights; own.full_scale[0] = 466000;
        for (int i = 0; i < 10; i++) { own.weights[i] = ONE_Q30; }, PVID_BAD_DESIGN);
}

static void noise_of_the_sensors(void **state)
{
    GIVES(own.noise[3].kind = 1, PVID_BAD_DESIGN);
    GIVES(own.noise[3].power = 6, PVID_BAD_DESIGN);
    GIVES(own.noise[3].a = 8; own.noise[3].b = 7, PVID_BAD_DESIGN);
    GIVES(own.noise[3].b = 9, PVID_BAD_DESIGN); /* a nuisance */
    GIVES(own.noise[3].factor.e = 9000, PVID_BAD_DESIGN);
    GIVES(own.order[0] = 5, PVID_OK);
    GIVES(own.order[0] = 6, PVID_BAD_DESIGN);
    GIVES(own.variance[0].m = -1, PVID_BAD_DESIGN);
    GIVES(own.variance[0].e = 8192, PVID_OK);
    GIVES(own.variance[0].e = 8193, PVID_BAD_DESIGN);
}

static void shifts(void **state)
{
    GIVES(design.sum_shift = 0, PVID_BAD_SHIFT);
    GIVES(design.sum_shift = 4, PVID_BAD_SHIFT); /* 32 steps of 29 bits */
    GIVES(design.sum_shift = 16, PVID_OK);
    GIVES(design.sum_shift = 17, PVID_BAD_SHIFT);
    GIVES(own.format[0].value = 0, PVID_BAD_SHIFT);
    GIVES(own.format[CONSTANT].value = 0, PVID_OK);
    GIVES(own.format[0].value = 31, PVID_BAD_SHIFT);
    GIVES(own.format[0].own = 32, PVID_BAD_SHIFT);
    GIVES(own.format[0].plain = 63, PVID_BAD_SHIFT);
    GIVES(own.format[0].ramp = 63, PVID_BAD_SHIFT);
    GIVES(own.format[RAMP].plain = 1, PVID_BAD_SHIFT);
    GIVES(own.format[RAMP].ramp = 1, PVID_OK);
    GIVES(own.format[INTEGRAL].ramp = 1, PVID_BAD_SHIFT);
    GIVES(own.format[0].lift = 31, PVID_BAD_SHIFT);
    GIVES(own.format[RAMP].lift = 24, PVID_OK); /* twice 32 steps */
    GIVES(own.format[RAMP].lift = 25, PVID_BAD_SHIFT);
    GIVES(own.integral[2].down = 31, PVID_BAD_SHIFT);
    GIVES(own.integral[2].twice = 0, PVID_BAD_SHIFT);
    GIVES(own.integral[2].twice = 31, PVID_BAD_SHIFT);
    GIVES(WITH_RUN; own.run[0].down = 62; own.run[0].shift = 62, PVID_OK);
    GIVES(WITH_RUN; own.run[0].down = 63, PVID_BAD_SHIFT);
    GIVES(WITH_RUN; own.run[0].shift = 63, PVID_BAD_SHIFT);
    GIVES(WITH_RUN; own.run[0].multiplier = 0, PVID_BAD_SHIFT);
    GIVES(WITH_SIGN; own.width[0] = -1, PVID_BAD_SHIFT);
}

#define INIT_GIVES(change, status)                                                                                     \
    do {                                                                                                               \
        start_again();                                                                                                 \
        change;                                                                                                        \
        assert_int_equal(pvid_weak_init_q31(&identifier, &config), status);                                            \
    } while (0)

static void the_configuration(void **state)
{
    INIT_GIVES((void)0, PVID_OK);
    assert_int_equal(pvid_weak_init_q31(&identifier, NULL), PVID_BAD_POINTER);
    assert_int_equal(pvid_weak_init_q31(NULL, &config), PVID_BAD_POINTER);
    INIT_GIVES(config.design = NULL, PVID_BAD_DESIGN);
    INIT_GIVES(config.offset = NULL, PVID_BAD_DESIGN);
    INIT_GIVES(own.offset[1] = ONE_Q30, PVID_OK);
    INIT_GIVES(own.offset[1] = ONE_Q30 + 1, PVID_BAD_DESIGN);
    INIT_GIVES(own.offset[1] = -ONE_Q30 - 1, PVID_BAD_DESIGN);
    INIT_GIVES(config.drive_min = NULL, PVID_OK);
    INIT_GIVES(own.least[1] = (int32_t)1 << 24, PVID_OK);
    INIT_GIVES(own.least[1] = ((int32_t)1 << 24) + 1, PVID_BAD_DRIVE_MIN);
    INIT_GIVES(own.least[1] = -1, PVID_BAD_DRIVE_MIN);
    INIT_GIVES(config.iterations = 0, PVID_BAD_ITERATIONS);
    INIT_GIVES(config.iterations = PVID_MAX_ITERATIONS + 1, PVID_BAD_ITERATIONS);
    INIT_GIVES(config.gate.sigmas = 1, PVID_BAD_GATE_SIGMAS);
    INIT_GIVES(config.trust.se_max = 0, PVID_BAD_SE_MAX);
    INIT_GIVES(config.estimator.start[0] = -1, PVID_BAD_START);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(what_either_core_refuses),
    cmocka_unit_test(counts_of_a_model),
    cmocka_unit_test(pointers_of_model_and_design),
    cmocka_unit_test(sizes_of_a_design),
    cmocka_unit_test(tables_of_a_model),
    cmocka_unit_test(several_kinds),
    cmocka_unit_test(full_scales_and_filters),
    cmocka_unit_test(noise_of_the_sensors),
    cmocka_unit_test(shifts),
    cmocka_unit_test(the_configuration),
};
RUN(tests)
