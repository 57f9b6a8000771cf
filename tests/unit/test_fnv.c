/* pvid/fnv.h: FNV-1a, 32 bits, against the published test vectors of Fowler, Noll and Vo: those whose length
 * is a multiple of four bytes, since the library hashes words. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "pvid/fnv.h"

static uint32_t word_of(const char four[4])
{
    uint32_t word = 0;
    for (size_t i = 0; i < 4u; i++) {
        word |= (uint32_t)(uint8_t)four[i] << (8u * i);
    }
    return word;
}

static void test_empty_input_is_the_offset_basis(void **state)
{
    (void)state;
    assert_int_equal(PVID_FNV_START, 2166136261u);
}

static void test_published_vectors(void **state)
{
    (void)state;
    assert_int_equal(pvid_fnv_word(PVID_FNV_START, word_of("foob")), 0x3F5076EFu);
    assert_int_equal(pvid_fnv_word(PVID_FNV_START, word_of("chon")), 0xAC297727u);
    assert_int_equal(pvid_fnv_word(pvid_fnv_word(PVID_FNV_START, word_of("chon")), word_of("go w")), 0xDD77ED30u);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_empty_input_is_the_offset_basis),
        cmocka_unit_test(test_published_vectors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
