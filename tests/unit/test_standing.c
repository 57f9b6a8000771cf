/* What is said of a published estimate, window by window, and when p starts again: judge/standing.h. */
#include "test.h"

#include "judge/standing.h"

#define FREEDOM 20u
#define ONE 65536u

static pvid_standing_judge judge;

static int start_again(void **state)
{
    memset(&judge, 0, sizeof judge);
    return 0;
}

/* A window that is published, and fits. */
static pvid_standing_window good(void)
{
    const pvid_standing_window window = {.published = true,
                                         .solved = true,
                                         .arrived = true,
                                         .judges = true,
                                         .freedom = FREEDOM,
                                         .own = ONE,
                                         .ratio = ONE};
    return window;
}

static pvid_standing_window held(uint32_t ratio)
{
    pvid_standing_window window = good();
    window.published = false;
    window.ratio = ratio;
    return window;
}

static void take(pvid_standing_window window, int times)
{
    for (int i = 0; i < times; i++) {
        (void)pvid_standing_take(&judge, &window);
    }
}

static void is(pvid_standing_state state, uint32_t causes)
{
    assert_int_equal(judge.now.state, state);
    assert_int_equal(judge.now.causes, causes);
}

static void an_estimate_is_valid_behind_eight_windows_that_fit(void **state)
{
    take(good(), 7);
    is(PVID_STANDING_NONE, 0);
    take(good(), 1);
    is(PVID_STANDING_VALID, 0);
    assert_int_equal(judge.now.age, 0);
    take(held(ONE), 3);
    pvid_standing_skip(&judge, false, 0);
    is(PVID_STANDING_VALID, 0);
    assert_int_equal(judge.now.age, 4);
}

static void eight_valid_publications_in_a_row_are_trusted(void **state)
{
    const pvid_standing_window window = good();
    for (int i = 1; i <= 20; i++) {
        assert_int_equal(pvid_standing_take(&judge, &window), i >= 15);
    }
    take(held(ONE), 1);
    assert_false(pvid_standing_take(&judge, &window));
}

static void what_contradicts_twice_withdraws(void **state)
{
    const pvid_standing_window other = held(ONE);
    take(good(), 9);
    judge.contradicts = true;
    take(other, 1);
    is(PVID_STANDING_VALID, 0);
    judge.contradicts = false;
    take(other, 1);
    judge.contradicts = true;
    take(other, 1);
    is(PVID_STANDING_VALID, 0);
    take(other, 1);
    is(PVID_STANDING_WITHDRAWN, PVID_DOUBT_CONTRADICTED);
    judge.contradicts = false;
    take(held(3u * ONE), 40);
    is(PVID_STANDING_WITHDRAWN, PVID_DOUBT_CONTRADICTED);
    take(good(), 60); /* the mean forgets */
    is(PVID_STANDING_VALID, 0);
}

static void larger_errors_are_a_doubt_until_the_next_publication(void **state)
{
    judge.grew = true; /* the scatter of the first windows: no estimate is valid yet */
    take(good(), 7);
    is(PVID_STANDING_NONE, 0);
    judge.grew = false;
    take(good(), 2);
    judge.grew = true;
    take(held(ONE), 1);
    judge.grew = false;
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_GREW);
    take(held(ONE), 1);
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_GREW);
    take(good(), 1);
    is(PVID_STANDING_VALID, 0);
}

/* The limit at 20 degrees of freedom and 32 windows is 1.5 (1 + 3 sqrt(2 / 640)) = 1.75. */
static void residuals_above_the_noise_are_a_misfit_and_one_window_is_none(void **state)
{
    pvid_standing_window worse = good();
    take(good(), 40);
    worse.ratio = PVID_STANDING_CLIP;
    take(worse, 1);
    is(PVID_STANDING_VALID, 0);
    (void)start_again(NULL);
    worse.ratio = (174u * ONE) / 100u;
    take(worse, 100);
    is(PVID_STANDING_VALID, 0);
    worse.ratio = (178u * ONE) / 100u;
    take(worse, 200);
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_MISFIT);
    take(good(), 100);
    is(PVID_STANDING_VALID, 0);
}

/* Two windows with a ratio of 3 and two with a better one, 40 times. */
static void take_scattered(uint32_t better, uint32_t own)
{
    pvid_standing_window window = good();
    window.own = own;
    (void)start_again(NULL);
    for (int i = 0; i < 160; i++) {
        window.ratio = ((i % 4) < 2) ? PVID_STANDING_CLIP : better;
        take(window, 1);
    }
}

/* Means of 2.0 and 2.2, 0.5 and 0.7 above 1.5; three times their scatter is 0.76 and 0.61. The limit of white rows
 * alone is 1.75. */
static void ratios_that_scatter_are_a_misfit_beyond_their_scatter(void **state)
{
    (void)state;
    take_scattered(ONE, ONE);
    is(PVID_STANDING_VALID, 0);
    take_scattered((14u * ONE) / 10u, ONE);
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_MISFIT);
    take_scattered(ONE, ONE / 2u); /* half of it is the sensors' noise, which is white */
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_MISFIT);
}

static void windows_before_p_arrives_are_no_misfit(void **state)
{
    pvid_standing_window far = held(PVID_STANDING_CLIP);
    far.arrived = false;
    take(far, 50);
    take(good(), 8);
    is(PVID_STANDING_VALID, 0);
}

static void without_a_limit_of_misfit_there_is_none(void **state)
{
    pvid_standing_window window = good();
    window.judges = false;
    window.ratio = PVID_STANDING_CLIP;
    take(window, 50);
    is(PVID_STANDING_VALID, 0);
}

/* Windows of one kind's rows, from the oldest on. */
static void take_rejected(const char *windows)
{
    for (; *windows != '\0'; windows++) {
        judge.rejects = *windows == 'x';
        take(good(), 1);
    }
}

static void six_rejected_windows_of_sixteen_are_a_doubt(void **state)
{
    take(good(), 20);
    take_rejected("xx.xx.x");
    is(PVID_STANDING_VALID, 0);
    take_rejected("x");
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_REJECTS);
    take_rejected("........");
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_REJECTS);
    take_rejected(".");
    is(PVID_STANDING_VALID, 0);
}

static void the_last_three_windows_rejected_are_a_doubt(void **state)
{
    take(good(), 20);
    take_rejected("xx.xx");
    is(PVID_STANDING_VALID, 0);
    take_rejected("x");
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_REJECTS);
    take_rejected(".");
    is(PVID_STANDING_VALID, 0);
    take(good(), 16);
    pvid_standing_skip(&judge, true, 0);
    pvid_standing_skip(&judge, true, 0);
    is(PVID_STANDING_VALID, 0);
    pvid_standing_skip(&judge, true, 0);
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_REJECTS);
}

static void an_estimate_ends_to_be_valid_by_its_age(void **state)
{
    uint8_t number;
    pvid_standing_window mute = held(ONE);
    take(good(), 20);
    for (int i = 0; i < 30; i++) {
        pvid_standing_skip(&judge, (i % 15) == 14, 30);
    }
    is(PVID_STANDING_VALID, 0);
    pvid_standing_skip(&judge, false, 30);
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_AGED);
    mute.age_max = 30;
    mute.solved = false; /* at rest: what is merely old is no reason to start again */
    take(mute, 20);
    assert_false(pvid_standing_starts(&judge, false, &number));
    pvid_standing_window fresh = good();
    fresh.age_max = 30;
    take(fresh, 1);
    is(PVID_STANDING_VALID, 0);
    take(mute, 30);
    is(PVID_STANDING_VALID, 0);
    take(mute, 1);
    is(PVID_STANDING_DOUBTED, PVID_DOUBT_AGED);
    for (uint32_t i = 0; i < 70000u; i++) {
        pvid_standing_skip(&judge, false, 0);
    }
    assert_int_equal(judge.now.age, 65535);
}

static void an_opening_withdraws_and_starts_at_the_trusted_p(void **state)
{
    uint8_t number = 9;
    take(good(), 20);
    assert_false(pvid_standing_starts(&judge, true, &number));
    judge.opened = true;
    assert_true(pvid_standing_starts(&judge, true, &number));
    assert_int_equal(number, 0);
    is(PVID_STANDING_WITHDRAWN, PVID_DOUBT_CHANGED);
    assert_false(pvid_standing_starts(&judge, true, &number));
    take(good(), 7);
    is(PVID_STANDING_WITHDRAWN, PVID_DOUBT_CHANGED);
    take(good(), 1);
    is(PVID_STANDING_VALID, 0);
}

/* Windows until the next start while nothing can be solved for. */
static int until_the_next_start(uint8_t *number)
{
    pvid_standing_window mute = held(ONE);
    mute.solved = false;
    for (int i = 1; i < 1000; i++) {
        take(mute, 1);
        if (pvid_standing_starts(&judge, false, number)) {
            return i;
        }
    }
    return 0;
}

static void six_starts_in_turn_then_a_pause(void **state)
{
    uint8_t number;
    assert_int_equal(until_the_next_start(&number), 0); /* before the first publication there is nothing else */
    judge.opened = true;
    (void)pvid_standing_starts(&judge, true, &number);
    for (uint8_t i = 1; i < 6; i++) {
        assert_int_equal(until_the_next_start(&number), 12);
        assert_int_equal(number, i);
    }
    assert_int_equal(until_the_next_start(&number), 64);
    assert_int_equal(number, 0);
}

static void a_misfit_before_the_first_publication_starts_nothing(void **state)
{
    uint8_t number;
    take(held(3 * ONE), 40);
    assert_true(judge.misfit);
    assert_false(pvid_standing_starts(&judge, true, &number));
    take(good(), 1); /* doubted */
    take(held(3 * ONE), 12);
    assert_true(pvid_standing_starts(&judge, true, &number));
}

static void starts_are_spread_by_a_factor_of_four(void **state)
{
    for (uint32_t a = 0; a < 8u; a++) {
        assert_int_equal(pvid_standing_spread(0, a), 32768);
        assert_int_equal(pvid_standing_spread(5, a), 32768);
        uint32_t least = ONE;
        uint32_t most = 0;
        for (uint8_t i = 1; i < 5; i++) {
            const uint32_t x = pvid_standing_spread(i, a);
            assert_true(x < ONE);
            least = (x < least) ? x : least;
            most = (x > most) ? x : most;
        }
        assert_true((most - least) > (ONE / 4u));
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test_setup(an_estimate_is_valid_behind_eight_windows_that_fit, start_again),
    cmocka_unit_test_setup(eight_valid_publications_in_a_row_are_trusted, start_again),
    cmocka_unit_test_setup(what_contradicts_twice_withdraws, start_again),
    cmocka_unit_test_setup(larger_errors_are_a_doubt_until_the_next_publication, start_again),
    cmocka_unit_test_setup(residuals_above_the_noise_are_a_misfit_and_one_window_is_none, start_again),
    cmocka_unit_test_setup(ratios_that_scatter_are_a_misfit_beyond_their_scatter, start_again),
    cmocka_unit_test_setup(windows_before_p_arrives_are_no_misfit, start_again),
    cmocka_unit_test_setup(without_a_limit_of_misfit_there_is_none, start_again),
    cmocka_unit_test_setup(six_rejected_windows_of_sixteen_are_a_doubt, start_again),
    cmocka_unit_test_setup(the_last_three_windows_rejected_are_a_doubt, start_again),
    cmocka_unit_test_setup(an_estimate_ends_to_be_valid_by_its_age, start_again),
    cmocka_unit_test_setup(an_opening_withdraws_and_starts_at_the_trusted_p, start_again),
    cmocka_unit_test_setup(six_starts_in_turn_then_a_pause, start_again),
    cmocka_unit_test_setup(a_misfit_before_the_first_publication_starts_nothing, start_again),
    cmocka_unit_test_setup(starts_are_spread_by_a_factor_of_four, start_again),
};
RUN(tests)
