/* pvid/fnv.h: FNV-1a, 32 bits, against the published test vectors of Fowler, Noll and Vo: those whose length
 * is a multiple of four bytes, since the library hashes words. */
#include "test.h"

#include "pvid/fnv.h"
#include "pvid/fnv_q31.h"

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
    assert_int_equal(PVID_FNV_START, 2166136261u);
}

static void test_published_vectors(void **state)
{
    assert_int_equal(pvid_fnv_word(PVID_FNV_START, word_of("foob")), 0x3F5076EFu);
    assert_int_equal(pvid_fnv_word(PVID_FNV_START, word_of("chon")), 0xAC297727u);
    assert_int_equal(pvid_fnv_word(pvid_fnv_word(PVID_FNV_START, word_of("chon")), word_of("go w")), 0xDD77ED30u);
}

/* Of an estimator every parameter, sum, both halves of an integer sum, its exponent and the reason count, in this
 * order, and nothing else. */
static void test_the_hash_of_an_estimator_is_that_of_its_words(void **state)
{
    enum { P = 2, THETA = 3, MOMENTS = 6, SUMS = MOMENTS + THETA + 2 };
    static pvid_model_f32 model = {.n_theta = THETA, .n_p = P, .n_moments = MOMENTS};
    static pvid_estimator_f32 single;
    static pvid_model_q31 model_q31 = {.n_theta = THETA, .n_p = P};
    static pvid_estimator_q31 fixed;
    single.model = &model;
    single.information.n_moments = MOMENTS;
    single.information.n_theta = THETA;
    fixed.model = &model_q31;
    fixed.information.n_sums = SUMS;
    fixed.information.exponent = 3;
    for (int i = 0; i < PVID_MAX_P; i++) { /* also beyond what the models have */
        single.p[i] = 1.5f + (float)i;
        fixed.p[i] = 1000003 * (i - 1);
    }
    for (int i = 0; i < SUMS + 1; i++) {
        single.information.high[i] = 256.0f * (float)(i + 1);
        single.information.low[i] = 0.25f;
        fixed.information.sums[i] = (i - 4) * INT64_C(0x123456789A);
    }
    uint32_t of_single = 17u;
    uint32_t of_fixed = 17u;
    for (int i = 0; i < P; i++) {
        float x = 1.5f + (float)i;
        uint32_t word;
        memcpy(&word, &x, sizeof word);
        of_single = pvid_fnv_word(of_single, word);
        of_fixed = pvid_fnv_word(of_fixed, (uint32_t)(1000003 * (i - 1)));
    }
    for (int i = 0; i < SUMS; i++) {
        const float sum = (256.0f * (float)(i + 1)) + 0.25f;
        uint32_t word;
        memcpy(&word, &sum, sizeof word);
        of_single = pvid_fnv_word(of_single, word);
        const uint64_t whole = (uint64_t)((i - 4) * INT64_C(0x123456789A));
        of_fixed =
            pvid_fnv_word(pvid_fnv_word(of_fixed, (uint32_t)(whole % 4294967296u)), (uint32_t)(whole / 4294967296u));
    }
    of_single = pvid_fnv_word(of_single, (uint32_t)PVID_UPDATED);
    of_fixed = pvid_fnv_word(pvid_fnv_word(of_fixed, 3u), (uint32_t)PVID_UPDATED);
    assert_int_equal(pvid_fnv_estimator_f32(17u, &single, PVID_UPDATED), of_single);
    assert_int_equal(pvid_fnv_estimator_q31(17u, &fixed, PVID_UPDATED), of_fixed);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_empty_input_is_the_offset_basis),
    cmocka_unit_test(test_published_vectors),
    cmocka_unit_test(test_the_hash_of_an_estimator_is_that_of_its_words),
};
RUN(tests)
