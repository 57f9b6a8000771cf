/* Publications as one context sees them; how they hold while another one writes:
 * tests/core/test_read_while_stepping.py. */
#include "test.h"

#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"

static pvid_publication_f32 shared;
static pvid_publication_q31 shared_q31;

static pvid_estimate_f32 estimate_of(float value)
{
    pvid_estimate_f32 estimate = {.p = {value, value}, .kappa = value, .misfit = value};
    return estimate;
}

static int start_again(void **state)
{
    memset(&shared, 0, sizeof shared);
    memset(&shared_q31, 0, sizeof shared_q31);
    return 0;
}

static void nothing_is_published_at_first(void **state)
{
    const pvid_estimate_f32 none = {.kappa = 0.0f};
    pvid_estimate_f32 read = estimate_of(1.0f);
    uint32_t number = 7;
    assert_true(pvid_publication_read_f32(&shared, &read, &number));
    assert_int_equal(number, 0);
    assert_memory_equal(&read, &none, sizeof none);
}

static void latest_publication_is_read_with_its_number(void **state)
{
    for (uint32_t i = 1; i <= 3u; i++) {
        const pvid_estimate_f32 estimate = estimate_of((float)i);
        const pvid_estimate_q31 estimate_q31 = {.p = {(int32_t)i}, .weight = i};
        pvid_estimate_f32 read;
        pvid_estimate_q31 read_q31;
        uint32_t number;
        pvid_publication_put_f32(&shared, &estimate);
        pvid_publication_put_q31(&shared_q31, &estimate_q31);
        assert_true(pvid_publication_read_f32(&shared, &read, &number));
        assert_int_equal(number, i);
        assert_memory_equal(&read, &estimate, sizeof read);
        assert_true(pvid_publication_read_q31(&shared_q31, &read_q31, NULL));
        assert_memory_equal(&read_q31, &estimate_q31, sizeof read_q31);
    }
}

/* What an interrupt finds that stops a put in its second half. */
static void the_copy_is_read_while_the_estimate_is_written(void **state)
{
    const pvid_estimate_f32 estimate = estimate_of(3.0f);
    pvid_publication_put_f32(&shared, &estimate);
    shared.mark.version++;
    shared.mark.number[1] = 9;
    memset(&shared.estimate, 0x5A, sizeof shared.estimate);
    pvid_estimate_f32 read;
    uint32_t number;
    assert_true(pvid_publication_read_f32(&shared, &read, &number));
    assert_int_equal(number, 9);
    assert_memory_equal(&read, &estimate, sizeof read);
}

static void versions_come_round_and_numbers_stop(void **state)
{
    shared.mark.version = UINT32_MAX - 1u;
    shared.mark.number[0] = UINT32_MAX;
    const pvid_estimate_f32 estimate = estimate_of(5.0f);
    pvid_estimate_f32 read;
    uint32_t number;
    pvid_publication_put_f32(&shared, &estimate);
    assert_int_equal(shared.mark.version, 0);
    assert_true(pvid_publication_read_f32(&shared, &read, &number));
    assert_int_equal(number, UINT32_MAX);
    assert_memory_equal(&read, &estimate, sizeof read);
}

static void null_is_refused(void **state)
{
    static pvid_weak_f32 weak;
    static pvid_weak_q31 weak_q31;
    pvid_estimate_f32 read = estimate_of(1.0f);
    pvid_estimate_q31 read_q31 = {.weight = 1};
    pvid_publication_put_f32(NULL, &read);
    pvid_publication_put_f32(&shared, NULL);
    pvid_publication_put_q31(NULL, &read_q31);
    pvid_publication_put_q31(&shared_q31, NULL);
    assert_int_equal(shared.mark.version | shared_q31.mark.version, 0);
    assert_false(pvid_publication_read_f32(NULL, &read, NULL));
    assert_false(pvid_publication_read_f32(&shared, NULL, NULL));
    assert_false(pvid_publication_read_q31(NULL, &read_q31, NULL));
    assert_false(pvid_publication_read_q31(&shared_q31, NULL, NULL));
    assert_false(pvid_weak_read_f32(NULL, &read, NULL));
    assert_false(pvid_weak_read_f32(&weak, &read, NULL)); /* before init */
    assert_false(pvid_weak_read_q31(NULL, &read_q31, NULL));
    assert_false(pvid_weak_read_q31(&weak_q31, &read_q31, NULL));
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test_setup(nothing_is_published_at_first, start_again),
    cmocka_unit_test_setup(latest_publication_is_read_with_its_number, start_again),
    cmocka_unit_test_setup(the_copy_is_read_while_the_estimate_is_written, start_again),
    cmocka_unit_test_setup(versions_come_round_and_numbers_stop, start_again),
    cmocka_unit_test_setup(null_is_refused, start_again),
};
RUN(tests)
