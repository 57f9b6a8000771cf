/* What the weak form in float32 refuses: every count, index, pointer and number of a model and a design. */
#include "test.h"

#include "first_order.h"
#include "weak/valid_f32.h"

#define TERMS 5
#define LENGTH (2 * PVID_MAX_RING)

static struct {
    pvid_weak_signal signal[2];
    pvid_weak_jet jet[2];
    pvid_weak_channel channel[CHANNELS];
    pvid_weak_term_f32 term[TERMS];
    pvid_weak_kind kind[1];
    pvid_weak_filter_f32 filter[2];
    pvid_weak_noise_f32 noise[2];
    uint8_t order[1];
    float variance[1];
    float width[PVID_MAX_INTEGRANDS];
    float circle[(5 * HOP) / 2];
    float weights[LENGTH];
} own;
static pvid_model_f32 theta;
static pvid_weak_model_f32 model;
static pvid_weak_design_f32 design;

#include "weak_valid_cases.h"

static void start_again(void)
{
    design = design_of(&mechanism);
    model = mechanism;
    theta = parameters;
    memset(&own, 0, sizeof own);
    memcpy(own.signal, signals, sizeof own.signal);
    memcpy(own.jet, jets, sizeof own.jet);
    memcpy(own.channel, channels, sizeof own.channel);
    memcpy(own.term, terms, sizeof own.term);
    memcpy(own.kind, kinds, sizeof own.kind);
    memcpy(own.filter, filters, sizeof own.filter);
    memcpy(own.noise, noise, sizeof own.noise);
    memcpy(own.circle, circle, sizeof own.circle);
    point_at_own();
    design.compensator = own.filter;
    design.sign_width = own.width;
    design.circle = own.circle;
}

static pvid_status validity(void)
{
    return pvid_weak_valid_f32(&design);
}

static void counts_of_a_model(void **state)
{
    assert_int_equal(pvid_weak_valid_f32(NULL), PVID_BAD_DESIGN);
    GIVES(model.samples = 1; own.signal[1].sample = 0, PVID_OK);
    GIVES(model.signals = 1; own.jet[1].signal = 0, PVID_OK);
    GIVES(model.samples = PVID_MAX_SAMPLES, PVID_OK);
    GIVES(model.jets = PVID_MAX_INPUTS - 1, PVID_BAD_MODEL); /* with a run and a sign */
    GIVES(model.runs = PVID_MAX_INTEGRANDS, PVID_OK);
    GIVES(model.runs = PVID_MAX_INTEGRANDS + 1, PVID_BAD_MODEL);
    GIVES(model.signs = PVID_MAX_INTEGRANDS, PVID_OK);
    GIVES(model.signs = PVID_MAX_INTEGRANDS + 1, PVID_BAD_MODEL);
    GIVES(model.integrands = PVID_MAX_INTEGRANDS, PVID_OK);
}

static void pointers_of_a_model(void **state)
{
    GIVES(model.form = NULL, PVID_BAD_MODEL);
    GIVES(model.prepare = NULL, PVID_BAD_MODEL);
    GIVES((model.prepare = NULL, model.runs = 0), PVID_BAD_MODEL);
    GIVES((model.prepare = NULL, model.signs = 0), PVID_BAD_MODEL);
    GIVES((model.prepare = NULL, model.runs = 0, model.signs = 0), PVID_OK);
}

static void signals_and_jets(void **state)
{
    GIVES(own.signal[0].source = PVID_SIGNAL_JUMP, PVID_OK);
    GIVES(own.signal[0].source = PVID_SIGNAL_LAST + 1, PVID_BAD_MODEL);
    GIVES(own.jet[0].order = PVID_MAX_POWER + 1, PVID_BAD_MODEL);
}

static void channels_and_their_integrals(void **state)
{
    GIVES(own.channel[ONE].fold = 1, PVID_BAD_MODEL);
    GIVES(own.channel[X].gain = 3, PVID_BAD_MODEL);
    GIVES(own.channel[U_I2].fold = 3, PVID_BAD_MODEL);
    GIVES(own.channel[U_I1].integrand = 1, PVID_BAD_MODEL);
    GIVES(own.channel[U_I1].plain = CHANNELS, PVID_BAD_MODEL);
    GIVES(own.channel[U_I1].plain = X, PVID_BAD_MODEL);   /* of another gain */
    GIVES(own.channel[U_I1].plain = U_T, PVID_BAD_MODEL); /* an integral itself */
    GIVES(own.channel[U_I2].ramp = U_I1, PVID_BAD_MODEL); /* not of 1 */
    GIVES(own.channel[U_I2].ramp = U, PVID_BAD_MODEL);    /* no integral */
    GIVES(own.channel[U_I2].ramp = CHANNELS, PVID_BAD_MODEL);
    GIVES(model.channels = 1; own.channel[0] = channels[ONE], PVID_BAD_MODEL); /* nothing is summed */
    static pvid_weak_channel many[PVID_MAX_CHANNELS + 2];
    for (size_t i = 0; i < (sizeof many / sizeof many[0]); i++) {
        many[i] = channels[X];
    }
    memcpy(many, channels, sizeof channels);
    GIVES(model.channel = many; model.channels = PVID_MAX_CHANNELS, PVID_OK);
    GIVES(model.channel = many; model.channels = PVID_MAX_CHANNELS + 1, PVID_BAD_MODEL);
    many[PVID_MAX_CHANNELS] = channels[ONE]; /* takes no place */
    GIVES(model.channel = many; model.channels = PVID_MAX_CHANNELS + 1, PVID_OK);
    many[PVID_MAX_CHANNELS] = channels[U];
    many[PVID_MAX_CHANNELS + 1] = channels[ONE];
    many[U_I1].plain = PVID_MAX_CHANNELS; /* is not summed */
    GIVES(model.channel = many; model.channels = PVID_MAX_CHANNELS + 2, PVID_BAD_MODEL);
}

static void terms_and_kinds(void **state)
{
    GIVES(own.term[2].channel = CHANNELS, PVID_BAD_MODEL);
    GIVES(own.term[4].column = 5, PVID_BAD_MODEL);
    GIVES(own.term[1].column = 4, PVID_BAD_MODEL); /* before a smaller one */
    GIVES(own.term[4].order = POWER - 2, PVID_OK);
    GIVES(own.term[4].order = POWER - 1, PVID_BAD_MODEL);
    GIVES(own.term[0].factor = INFINITY, PVID_BAD_MODEL);
    GIVES(own.kind[0].thetas = 3, PVID_BAD_MODEL); /* theta has four */
    GIVES(own.kind[0].nuisances = FUNCTIONS, PVID_BAD_MODEL);
    GIVES(own.kind[0].nuisances = PVID_MAX_COLUMNS - 4, PVID_BAD_MODEL);
    GIVES(theta.n_kinds = 1, PVID_OK);
    GIVES(theta.n_theta = 5, PVID_BAD_MODEL);
    static pvid_weak_kind two[2] = {{2, 0, 0, 2}, {2, 0, 2, 5}};
    static pvid_weak_term_f32 of_two[TERMS] = {
        {U, 0, 0, 1.0f}, {X, 0, 1, -1.0f}, {ONE, 0, 0, 1.0f}, {SIGN, 0, 1, 1.0f}, {X, 1, 2, 1.0f}};
    static pvid_weak_noise_f32 of_both[2] = {{0, 0, 1, 1, 1.0f}, {1, 1, 2, 2, 1.0f}};
    static const float both[2] = {0.0f, 0.0f};
    static const uint8_t orders[2] = {0, 0};
#define TWO                                                                                                            \
    model.kinds = 2;                                                                                                   \
    model.kind = two;                                                                                                  \
    model.term = of_two;                                                                                               \
    design.noise = of_both;                                                                                            \
    design.error_variance = both;                                                                                      \
    design.error_order = orders
    GIVES(TWO; theta.n_kinds = 2, PVID_OK);
    GIVES(TWO, PVID_BAD_MODEL);
    of_both[1].kind = 0; /* the second kind has no noise */
    of_both[1].b = 1;
    of_both[1].a = 1;
    GIVES(TWO; theta.n_kinds = 2, PVID_BAD_DESIGN);
}

static void sizes_of_a_design(void **state)
{
    GIVES(design.decimation = PVID_MAX_DECIMATION, PVID_OK);
    GIVES(design.power = 0, PVID_BAD_DESIGN);
    GIVES(design.power = 3, PVID_BAD_DESIGN);
    GIVES(design.power = POWER + 1, PVID_BAD_DESIGN);
    GIVES(design.power = PVID_MAX_POWER + 2, PVID_BAD_DESIGN);
    GIVES(design.hop = 8, PVID_BAD_WINDOW); /* less than twice the harmonics */
    GIVES(design.hop = 16, PVID_OK);
    GIVES(design.hop = 0, PVID_BAD_WINDOW);
    GIVES(design.hop = HOP - 1, PVID_BAD_WINDOW);
    GIVES(design.hop = 16384 + 8, PVID_BAD_WINDOW);
    GIVES(design.overlap = 0.99f, PVID_BAD_OVERLAP);
    GIVES(design.overlap = 1.0f, PVID_OK);
    GIVES(design.overlap = NAN, PVID_BAD_OVERLAP);
    GIVES(own.filter[1].half = PVID_MAX_RING; own.filter[1].weights = own.weights, PVID_BAD_TAPS);
}

static void tables_of_a_design(void **state)
{
    GIVES(design.compensator = NULL, PVID_BAD_DESIGN);
    GIVES(design.noise = NULL; design.n_noise = 0; own.variance[0] = 1.0f, PVID_OK);
    GIVES(design.n_noise = 0, PVID_BAD_DESIGN);
    GIVES(design.sign_width = NULL, PVID_BAD_DESIGN);
    GIVES(design.sign_width = NULL; model.signs = 0, PVID_OK);
    GIVES(own.circle[(5 * HOP / 2) - 1] = NAN, PVID_BAD_DESIGN);
    GIVES(own.circle[3] = -1.5f, PVID_BAD_DESIGN);
    GIVES(own.width[0] = -1.0f, PVID_BAD_DESIGN);
    GIVES(own.filter[0].half = 1, PVID_BAD_DESIGN); /* without weights */
    GIVES(own.filter[0].half = 2; own.filter[0].weights = own.weights, PVID_OK);
    GIVES(own.filter[0].half = 2; own.filter[0].weights = own.weights; own.weights[1] = NAN, PVID_BAD_DESIGN);
    GIVES(own.jet[0].order = 1, PVID_BAD_DESIGN); /* a derivative without a filter */
    GIVES(own.noise[1].kind = 1, PVID_BAD_DESIGN);
    GIVES(own.noise[1].power = POWER - 1, PVID_OK);
    GIVES(own.noise[1].power = POWER, PVID_BAD_DESIGN);
    GIVES(own.noise[1].a = 5, PVID_BAD_DESIGN); /* beyond b */
    GIVES(own.noise[1].b = 5, PVID_BAD_DESIGN);
    GIVES(own.noise[1].factor = NAN, PVID_BAD_DESIGN);
    GIVES(own.order[0] = POWER - 1, PVID_OK);
    GIVES(own.order[0] = POWER, PVID_BAD_DESIGN);
    GIVES(own.variance[0] = -1.0f, PVID_BAD_DESIGN);
    GIVES(own.variance[0] = INFINITY, PVID_BAD_DESIGN);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(what_either_core_refuses),
    cmocka_unit_test(counts_of_a_model),
    cmocka_unit_test(pointers_of_a_model),
    cmocka_unit_test(signals_and_jets),
    cmocka_unit_test(channels_and_their_integrals),
    cmocka_unit_test(terms_and_kinds),
    cmocka_unit_test(sizes_of_a_design),
    cmocka_unit_test(tables_of_a_design),
};
RUN(tests)
