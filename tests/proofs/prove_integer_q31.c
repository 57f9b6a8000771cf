/* integer_q31: every argument that integer_q31.h allows, both signs, all shifts. */
#include "prove.h"

#include "contracts.h"

/* The octave of numbers of `bits` bits: 0, or 2^(bits-1)..2^bits - 1. */
static int64_t of_bits(uint32_t bits, bool negative)
{
    if (bits == 0u) {
        return 0;
    }
    const int64_t low = (int64_t)1 << (bits - 1u);
    const int64_t high = low + (low - 1);
    const int64_t x = any_i64(low, high);
    return negative ? -x : x;
}

static void any_length(uint32_t bits, bool negative)
{
    const int64_t x = of_bits(bits, negative);
    const uint32_t length = pvid_bit_length_q31(pvid_magnitude_q31(x));
    /*@ assert length == bits; */
    const int64_t product = pvid_times_q31(x, any_i32(-INT32_MAX, INT32_MAX));
    /*@ assert -0x4000000000000000 <= product <= 0x4000000000000000; */
}

static void any_scaled(int64_t x, int32_t s)
{
    const int64_t y = pvid_scale_q31(x, s);
    /*@ assert -0x4000000000000000 <= y <= 0x4000000000000000; */
}

/* Of both signs. */
static void any_between(int64_t low, int64_t high, int32_t s)
{
    if (low <= high) {
        any_scaled(any_i64(low, high), s);
        any_scaled(any_i64(-high, -low), s);
    }
}

/* Every number within PVID_WIDE, parted where a shift to the left begins to saturate, and at 2^31, below which the
 * contract promises more. */
static void any_shift(int32_t s)
{
    const int64_t saturates = (s >= 0) ? PVID_WIDE : ((s < -62) ? 1 : (PVID_WIDE >> -s));
    const int64_t narrow = (int64_t)1 << 31;
    const int64_t first = (saturates < narrow) ? saturates : narrow;
    const int64_t second = (saturates < narrow) ? narrow : saturates;
    any_scaled(0, s);
    any_between(1, first - 1, s);
    any_between(first, second - 1, s);
    any_between(second, PVID_WIDE, s);
}

static void any_far_shift(int64_t x)
{
    (void)pvid_scale_q31(x, any_i32(65, INT32_MAX));
    (void)pvid_scale_q31(x, any_i32(-INT32_MAX, -65));
}

void main(void)
{
    for (uint32_t bits = 0; bits <= 62u; bits++) {
        any_length(bits, false);
        any_length(bits, true);
        const int64_t m = of_bits(bits, false);
        (void)pvid_root_of_q31(m, -100000); /* an exponent is but added to, but even ones and odd ones differ */
        (void)pvid_root_of_q31(m, 99999);
        (void)pvid_square_root_q31((uint64_t)m);
    }
    (void)pvid_root_of_q31(PVID_WIDE, -100000);
    (void)pvid_root_of_q31(PVID_WIDE, 99999);
    (void)pvid_square_root_q31((uint64_t)PVID_WIDE);
    any_far_shift(any_i64(0, PVID_WIDE));
    any_far_shift(any_i64(-PVID_WIDE, -1));
    any_far_shift(any_i64(PVID_WIDE + 1, INT64_MAX - 1));
    any_far_shift(any_i64(-INT64_MAX, -PVID_WIDE - 1));
    for (int32_t s = -64; s <= 64; s++) {
        any_shift(s);
        (void)pvid_scale_q31(any_i64(PVID_WIDE + 1, INT64_MAX - 1), s);
        (void)pvid_scale_q31(any_i64(-INT64_MAX, -PVID_WIDE - 1), s);
    }
}
