/* Counters that start over, at any modulus: the difference of two readings is the motion of the encoder. */
#include "test.h"

#include "pvid/counter.h"

static const uint32_t modulus[] = {256u, 1000u, 4000u, 16384u, 65536u, 10000000u, 0x80000000u, 0xFFFFFFFFu, 0u};

static uint32_t remainder_of(int64_t x, uint32_t one)
{
    const int64_t whole = (one != 0u) ? (int64_t)one : ((int64_t)1 << 32);
    return (uint32_t)(((x % whole) + whole) % whole);
}

/* Motions of up to half the modulus, forwards and backwards, from every place about the ends of the range. */
static void the_difference_is_the_motion_of_the_encoder(void **state)
{
    for (size_t i = 0; i < sizeof modulus / sizeof modulus[0]; i++) {
        const int64_t whole = (modulus[i] != 0u) ? (int64_t)modulus[i] : ((int64_t)1 << 32);
        const int64_t largest = (whole - 1) / 2;
        for (int64_t place = -70; place < 70; place++) {
            for (int64_t part = -64; part <= 64; part++) {
                const int64_t motion = (largest * part) / 64;
                const uint32_t before = remainder_of(place, modulus[i]);
                const uint32_t now = remainder_of(place + motion, modulus[i]);
                assert_int_equal(pvid_counter_difference(before, now, modulus[i]), motion);
            }
        }
    }
}

static void a_reading_beyond_the_modulus_is_its_remainder(void **state)
{
    assert_int_equal(pvid_counter_difference(4001u, 3999u, 4000u), -2);
    assert_int_equal(pvid_counter_difference(0u, 0xFFFFFFFFu, 256u), -1);
    assert_int_equal(pvid_counter_difference(0u, 0u, 1u), 0);
    assert_int_equal(pvid_counter_difference(5u, 5u, 0u), 0);
    assert_int_equal(pvid_counter_difference(5u, 0x80000005u, 0u), 0); /* half of 2^32 */
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(the_difference_is_the_motion_of_the_encoder),
    cmocka_unit_test(a_reading_beyond_the_modulus_is_its_remainder),
};
RUN(tests)
