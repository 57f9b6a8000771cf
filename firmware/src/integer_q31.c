#include "integer_q31.h"

int64_t pvid_scale_q31(int64_t x, int32_t s)
{
    if (s >= 0) {
        return pvid_round_shift_q31(x, (uint32_t)s);
    }
    if (x == 0) {
        return 0;
    }
    const uint32_t left = (uint32_t)-s;
    if ((left > 62u) || ((pvid_magnitude_q31(x) >> (62u - left)) != 0u)) {
        return (x < 0) ? -PVID_WIDE : PVID_WIDE;
    }
    return x * ((int64_t)1 << left);
}

uint32_t pvid_bit_length_q31(uint64_t x)
{
    const uint32_t high = (uint32_t)(x >> 32);
    uint32_t rest = (high != 0u) ? high : (uint32_t)(x & 0xFFFFFFFFu);
    uint32_t length = (high != 0u) ? 32u : 0u;
    for (uint32_t step = 16; step > 0u; step >>= 1) {
        if ((rest >> step) != 0u) {
            rest >>= step;
            length += step;
        }
    }
    return length + rest; /* what is left is 0 or 1 */
}

/* Digit by digit, in base 4: `rest` is what is left of x, `root` the digits found, moved along with them. */
uint32_t pvid_square_root_q31(uint64_t x)
{
    uint64_t rest = x;
    uint64_t root = 0;
    for (uint64_t digit = (uint64_t)1 << 62; digit > 0u; digit >>= 2) {
        const uint64_t trial = root + digit;
        root >>= 1;
        if (rest >= trial) {
            rest -= trial;
            root += digit;
        }
    }
    return (uint32_t)root;
}

pvid_reciprocal_q31 pvid_reciprocal_of_q31(uint32_t x)
{
    const uint32_t k = 31u - pvid_bit_length_q31(x);
    const uint64_t quotient = ((uint64_t)1 << 61) / ((uint64_t)x << k);
    const pvid_reciprocal_q31 result = {(int32_t)((quotient > INT32_MAX) ? (uint64_t)INT32_MAX : quotient),
                                        (uint8_t)k};
    return result;
}

pvid_root_q31 pvid_root_of_q31(int64_t m, int32_t exponent)
{
    int32_t up = 62 - (int32_t)pvid_bit_length_q31((uint64_t)m);
    if (((exponent - up) & 1) != 0) {
        up--;
    }
    const pvid_root_q31 root = {(int32_t)pvid_square_root_q31((uint64_t)pvid_scale_q31(m, -up)),
                                (exponent - up) / 2};
    return root;
}

int64_t pvid_times_q31(int64_t a, int32_t b)
{
    const int64_t high = pvid_floor_shift_q31(a, 31);
    const int64_t low = a & (int64_t)INT32_MAX;
    return (high * b) + pvid_round_shift_q31(low * b, 31);
}
