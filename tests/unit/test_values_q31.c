/* From jets to signs, runs and integrals in fixed point, against their definitions. */
#include "test.h"

#include "number/integer_q31.h"
#include "pvid/elementary_q31.h"
#include "weak/values_q31.h"

enum { HOP = 16, SIGN = 0, RUN = 1, GAINS = 2 };

static bool prepare_of(const int32_t jet[], int32_t out[])
{
    out[0] = 3 * jet[0]; /* derivative of the run */
    out[1] = jet[0];     /* argument of sgn */
    return true;
}

/* Inputs: the jet, the run, the sign. The integrand is the jet. */
static bool values_of(const int32_t in[], int32_t out[])
{
    out[SIGN] = in[2];
    out[RUN] = in[1];
    out[GAINS] = in[0];
    return true;
}

static const pvid_weak_jet jets[1] = {{0, 0}};
static const pvid_weak_channel channels[GAINS] = {{SIGN, PVID_WEAK_NONE, 0, PVID_WEAK_NONE, PVID_WEAK_NONE},
                                                  {RUN, PVID_WEAK_NONE, 0, PVID_WEAK_NONE, PVID_WEAK_NONE}};
static const pvid_weak_model_q31 model = {
    .samples = 1,
    .signals = 1,
    .jets = 1,
    .runs = 1,
    .signs = 1,
    .gains = GAINS,
    .integrands = 1,
    .channels = GAINS,
    .jet = jets,
    .channel = channels,
    .prepare = prepare_of,
    .values = values_of,
};
static const pvid_rescale_q31 rescale[1] = {{0, 0, 1}};
static const pvid_weak_format_q31 formats[GAINS] = {{.value = 3}, {.value = 1}};

/* Channels after the step `ticks - 1` of these jets: those of the step two before it. */
static void channels_after(int32_t width, const int32_t jet[], size_t ticks, int32_t out[GAINS])
{
    const pvid_weak_integral_q31 integral[1] = {{0, 1}};
    const pvid_weak_design_q31 design = {.model = &model,
                                         .decimation = 1,
                                         .hop = HOP,
                                         .run = rescale,
                                         .sign_width = &width,
                                         .integral = integral,
                                         .format = formats};
    pvid_weak_values_q31 self;
    pvid_weak_entry_q31 entry[GAINS * PVID_WEAK_BLOCK_Q31] = {0};
    pvid_weak_values_init_q31(&self, 0);
    for (size_t k = 0; k < ticks; k++) {
        const pvid_weak_outcome outcome = pvid_weak_values_step_q31(&self, &design, &jet[k], entry);
        assert_int_equal(outcome, (k < 2u) ? PVID_WEAK_NO_CHANNELS : PVID_WEAK_CHANNELS);
    }
    out[SIGN] = entry[0];
    out[RUN] = entry[PVID_WEAK_BLOCK_Q31];
}

/* The mean of sgn over the step about k, the argument linear there: v 2/|g|, g the slope, within +-1. */
static void test_a_sign_is_its_mean_over_a_step(void **state)
{
    static const struct {
        int32_t v[3];
        double mean;
    } cases[] = {
        {{-30, -1, 30}, -4.0 / 60.0},
        {{30, 1, -30}, 4.0 / 60.0},
        {{-10, 3, 10}, 12.0 / 20.0},
        {{10, -3, -10}, -12.0 / 20.0},
        {{5, 5, 5}, 1.0},
        {{-7, -7, -7}, -1.0},
        {{-4, 0, 4}, 0.0},
        {{0, 0, 0}, 0.0},
        {{-100, 25, 0}, 1.0},
        {{0, -25, -100}, -1.0},
        {{-2, 1, 2}, 1.0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const int32_t jet[4] = {cases[i].v[0], cases[i].v[1], cases[i].v[2], 0};
        int32_t out[GAINS];
        channels_after(0, jet, 4, out);
        assert_true(fabs((out[SIGN] / 134217728.0) - cases[i].mean) < 1e-8); /* 2^30 2^-3 */
    }
    /* at the first step v goes on in a straight line before it: -1, of -5, -1, 3; and a sign of a width is tanh */
    const int32_t first[3] = {-1, 3, 0};
    int32_t out[GAINS];
    channels_after(0, first, 3, out);
    assert_true(fabs((out[SIGN] / 134217728.0) + (4.0 / 8.0)) < 1e-8);
    const int32_t soft[4] = {400, -300, 200, 0};
    channels_after(1000, soft, 4, out);
    assert_int_equal(out[SIGN], pvid_round_shift_q31(pvid_tanh_q31(-300, 1000), 3));
}

/* Twice the sum by trapezoids, from the first step on; its derivative does not begin before it. */
static void test_a_run_is_the_sum_of_its_derivative_by_trapezoids(void **state)
{
    int32_t jet[12];
    int64_t expected = 0;
    for (int32_t k = 0; k < 12; k++) {
        jet[k] = ((k * 37) % 11) - 4;
    }
    for (size_t ticks = 3; ticks <= 12u; ticks++) {
        int32_t out[GAINS];
        channels_after(0, jet, ticks, out);
        const size_t step = ticks - 3u;
        expected += (step > 0u) ? (3 * ((int64_t)jet[step - 1u] + jet[step])) : 0;
        assert_int_equal(out[RUN], pvid_round_shift_q31(expected, 1));
    }
}

/* From the start of a half on. The first integral is exact; the second one anticipates the error of the first, 11/720
 * of the third derivative a step, and for a cubic differs by this straight line, which an unknown start takes. */
static void test_integrals_of_a_cubic_are_those_of_the_rule(void **state)
{
    static const int32_t hard = 0;
    const pvid_weak_integral_q31 integral[1] = {{0, 1}};
    const pvid_weak_design_q31 design = {.model = &model,
                                         .decimation = 1,
                                         .hop = HOP,
                                         .run = rescale,
                                         .sign_width = &hard,
                                         .integral = integral,
                                         .format = formats};
    pvid_weak_values_q31 self;
    pvid_weak_entry_q31 entry[GAINS * PVID_WEAK_BLOCK_Q31];
    pvid_weak_values_init_q31(&self, 0);
    for (int32_t k = 0; k < 3 * HOP + 2; k++) {
        const int32_t x = k - HOP;
        const int32_t jet = (x * x * x) - (9 * x * x) + (4 * x) - 77;
        const pvid_weak_outcome outcome = pvid_weak_values_step_q31(&self, &design, &jet, entry);
        if (outcome != PVID_WEAK_CHANNELS) {
            continue;
        }
        const int32_t step = k - 2;
        const double from = (double)((step / HOP) * HOP) - HOP; /* x at the start of the half */
        const double to = (double)(step - HOP);
        const double of_to = (pow(to, 4) / 4) - (3 * pow(to, 3)) + (2 * to * to) - (77 * to);
        const double of_from = (pow(from, 4) / 4) - (3 * pow(from, 3)) + (2 * from * from) - (77 * from);
        const double second = ((pow(to, 5) - pow(from, 5)) / 20) - (3 * (pow(to, 4) - pow(from, 4)) / 4) +
                              (2 * (pow(to, 3) - pow(from, 3)) / 3) - (77 * ((to * to) - (from * from)) / 2) -
                              (of_from * (to - from));
        if (step >= HOP) { /* the first half begins with an integrand that goes on in a straight line before it */
            assert_true(fabs(self.once[0] - (120 * (of_to - of_from))) < 1e-6);
            assert_true(fabs((2.0 * self.twice[0]) - (240 * (second + ((11 * 6 * (to - from)) / 720)))) <
                        2.0 * (to - from) + 1e-6); /* rounded each step */
        }
        if ((step > HOP) && ((step % HOP) == 0)) { /* what the half before ended with */
            const double start = from - HOP;
            const double whole = (pow(from, 4) / 4) - (3 * pow(from, 3)) + (2 * from * from) - (77 * from) -
                                 ((pow(start, 4) / 4) - (3 * pow(start, 3)) + (2 * start * start) - (77 * start));
            assert_true(fabs(self.edge[self.half ^ 1u][0][0] - (120 * whole)) < 1e-6);
        }
        pvid_weak_values_next_q31(&self, HOP);
    }
}

static void test_a_constant_at_the_end_is_not_summed(void **state)
{
    pvid_weak_model_q31 other = model;
    assert_int_equal(pvid_weak_summed_q31(&other), GAINS);
    const pvid_weak_channel with[GAINS + 1] = {
        channels[0], channels[1], {PVID_WEAK_NONE, PVID_WEAK_NONE, 0, PVID_WEAK_NONE, PVID_WEAK_NONE}};
    other.channel = with;
    other.channels = GAINS + 1;
    assert_int_equal(pvid_weak_summed_q31(&other), GAINS);
}

/* Twice a run counts from the first sample, two ticks before the first step, by trapezoids; where it depends on
 * derivatives of signals, which are not known there, with that of the first step. */
static void test_a_run_begins_before_the_first_step(void **state)
{
    static const int32_t hard = 0;
    static const pvid_weak_jet first_order[1] = {{0, 1}};
    const pvid_weak_integral_q31 integral[1] = {{0, 1}};
    for (int derived = 0; derived < 2; derived++) {
        pvid_weak_model_q31 own = model;
        own.jet = (derived != 0) ? first_order : jets;
        const pvid_weak_design_q31 design = {.model = &own,
                                             .decimation = 1,
                                             .hop = HOP,
                                             .run = rescale,
                                             .sign_width = &hard,
                                             .integral = integral,
                                             .format = formats};
        const int32_t jet = 11;
        pvid_weak_values_q31 self;
        pvid_weak_entry_q31 entry[GAINS * PVID_WEAK_BLOCK_Q31];
        pvid_weak_values_init_q31(&self, 2);
        const int32_t before[2] = {5, 7};
        pvid_weak_values_begin_q31(&self, &design, &before[0], true); /* half a step, then whole ones */
        pvid_weak_values_begin_q31(&self, &design, &before[1], false);
        (void)pvid_weak_values_step_q31(&self, &design, &jet, entry);
        assert_int_equal(self.run[0], (derived != 0) ? (2 * 2 * 33) : (15 + (2 * 21) + 33));
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_a_sign_is_its_mean_over_a_step),
    cmocka_unit_test(test_a_run_is_the_sum_of_its_derivative_by_trapezoids),
    cmocka_unit_test(test_integrals_of_a_cubic_are_those_of_the_rule),
    cmocka_unit_test(test_a_constant_at_the_end_is_not_summed),
    cmocka_unit_test(test_a_run_begins_before_the_first_step),
};
RUN(tests)
