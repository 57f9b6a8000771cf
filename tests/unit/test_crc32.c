/* pvid/crc32.h against the check value that every catalogue of checksums gives, whole and in pieces. */
#include "test.h"

#include "pvid/crc32.h"

static void test_crc_is_that_of_zlib(void **state)
{
    assert_int_equal(pvid_crc32(0u, (const uint8_t *)"123456789", 9), 0xCBF43926u);
    const uint32_t half = pvid_crc32(0u, (const uint8_t *)"1234", 4);
    assert_int_equal(pvid_crc32(half, (const uint8_t *)"56789", 5), 0xCBF43926u);
}

static void test_no_byte_changes_nothing(void **state)
{
    assert_int_equal(pvid_crc32(0u, NULL, 0), 0u);
    assert_int_equal(pvid_crc32(0xCBF43926u, NULL, 0), 0xCBF43926u);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_crc_is_that_of_zlib),
    cmocka_unit_test(test_no_byte_changes_nothing),
};
RUN(tests)
