/* pvid/text.h: every number has a text, and a number that is none has one too. */
#include "test.h"

#include "pvid/text.h"

static void test_a_reason_is_its_name_in_words(void **state)
{
    assert_string_equal(pvid_reason_text(PVID_UPDATED), "updated");
    assert_string_equal(pvid_reason_text(PVID_HELD_NOT_EXCITED), "held not excited");
    assert_string_equal(pvid_reason_text(PVID_HELD_DISAGREES), "held disagrees");
}

static void test_a_status_tells_what_the_field_must_be(void **state)
{
    assert_string_equal(pvid_status_text(PVID_OK), "ok");
    assert_string_equal(pvid_status_text(PVID_BAD_ROW_SD), "bad row sd: not finite or not positive");
    assert_string_equal(pvid_status_text(PVID_BAD_POINTER),
                        "bad pointer: the object, the configuration or the bank is NULL");
}

static void test_a_number_that_is_none_has_a_text_too(void **state)
{
    assert_string_equal(pvid_reason_text((pvid_reason)(PVID_HELD_DISAGREES + 1)), "unknown reason");
    assert_string_equal(pvid_status_text((pvid_status)(PVID_BAD_COMMISSION_CHECK + 1)), "unknown status");
    assert_string_equal(pvid_reason_text((pvid_reason)INT32_MAX), "unknown reason");
}

static void test_every_status_has_a_text_of_its_own(void **state)
{
    for (int a = 0; a <= (int)PVID_BAD_COMMISSION_CHECK; a++) {
        for (int b = 0; b < a; b++) {
            assert_string_not_equal(pvid_status_text((pvid_status)a), pvid_status_text((pvid_status)b));
        }
    }
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_a_reason_is_its_name_in_words),
    cmocka_unit_test(test_a_status_tells_what_the_field_must_be),
    cmocka_unit_test(test_a_number_that_is_none_has_a_text_too),
    cmocka_unit_test(test_every_status_has_a_text_of_its_own),
};
RUN(tests)
