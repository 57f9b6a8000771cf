#include "number/integer_q31.h"

/* No partial sum overflows: |high low| <= 2^31 - 2^15, and the carry is below 2^16 if the product is positive. */
int64_t pvid_product_in_halves_q31(int32_t a, int32_t b)
{
    const uint32_t a_low = (uint32_t)a & 0xFFFFu;
    const uint32_t b_low = (uint32_t)b & 0xFFFFu;
    const int32_t a_high = pvid_floor_shift_32_q31(a, 16);
    const int32_t b_high = pvid_floor_shift_32_q31(b, 16);
    const uint32_t low = a_low * b_low;
    const int32_t first = (a_high * (int32_t)b_low) + (int32_t)(low >> 16);
    const uint32_t carried = (uint32_t)first & 0xFFFFu;
    const int32_t second = ((int32_t)a_low * b_high) + (int32_t)carried;
    const int32_t high = (a_high * b_high) + pvid_floor_shift_32_q31(first, 16) + pvid_floor_shift_32_q31(second, 16);
    const uint32_t bottom = (((uint32_t)second & 0xFFFFu) << 16) | (low & 0xFFFFu);
    const uint64_t both = ((uint64_t)(uint32_t)high << 32) | bottom; /* the two registers */
    return (int64_t)both;
}

/* The sum of the two mixed products stays below 2^31. */
int64_t pvid_short_product_in_halves_q31(int32_t a, int32_t b)
{
    const uint32_t a_low = (uint32_t)a & 0xFFFFu;
    const uint32_t b_low = (uint32_t)b & 0xFFFFu;
    const int32_t a_high = pvid_floor_shift_32_q31(a, 16);
    const int32_t b_high = pvid_floor_shift_32_q31(b, 16);
    const int32_t mixed = (a_high * (int32_t)b_low) + ((int32_t)a_low * b_high);
    const int32_t high = (a_high * b_high) + pvid_floor_shift_32_q31(mixed, 16);
    const uint64_t upper = ((uint64_t)(uint32_t)high << 32) | (((uint32_t)mixed & 0xFFFFu) << 16); /* two registers */
    const uint32_t low = a_low * b_low;
    const uint64_t product = upper + low;
    return (int64_t)product;
}

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

#if !defined(__ARM_FEATURE_CLZ) || !defined(__GNUC__)
uint32_t pvid_bit_length_q31(uint64_t x)
{
    static const uint8_t bits_of[16] = {0, 1, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4};
    const uint32_t high = (uint32_t)(x >> 32);
    uint32_t rest = (high != 0u) ? high : (uint32_t)(x & 0xFFFFFFFFu);
    uint32_t length = (high != 0u) ? 32u : 0u;
    if (rest > 0xFFFFu) {
        rest >>= 16;
        length += 16u;
    }
    if (rest > 0xFFu) {
        rest >>= 8;
        length += 8u;
    }
    if (rest > 0xFu) {
        rest >>= 4;
        length += 4u;
    }
    return length + bits_of[rest];
}
#endif

/* The root of 32 bits, digit by digit in base 4; *rest is what it leaves. */
static uint32_t upper_root_of(uint32_t x, uint32_t *rest)
{
    uint32_t left = x;
    uint32_t root = 0;
    for (uint32_t digit = (uint32_t)1 << 30; digit > 0u; digit >>= 2) {
        const uint32_t trial = root + digit;
        root >>= 1;
        if (left >= trial) {
            left -= trial;
            root += digit;
        }
    }
    *rest = left;
    return root;
}

/* The upper half of the digits from the upper half of x 4^up, of 63 or 64 bits; the lower half is the quotient of what
 * that leaves and twice the root, or one less (P. Zimmermann, Karatsuba Square Root, INRIA 1999). */
uint32_t pvid_square_root_q31(uint64_t x)
{
    if (x == 0u) {
        return 0;
    }
    const uint32_t up = (64u - pvid_bit_length_q31(x)) / 2u;
    const uint32_t even = 2u * up;
    const uint64_t all = x << even;
    const uint32_t low = (uint32_t)(all & 0xFFFFFFFFu);
    uint32_t rest;
    const uint32_t upper = upper_root_of((uint32_t)(all >> 32), &rest); /* 2^15 or more, rest <= 2 upper */
    /* (rest 2^16 + the next digits) / (2 upper): half of both fits 32 bits */
    const uint32_t half = (rest << 15) | (low >> 17);
    const uint32_t quotient = half / upper;
    const uint32_t left = half - (quotient * upper);
    const uint64_t remains = ((uint64_t)left << 17) | (low & 0x1FFFFu);
    uint32_t lower = 0xFFFF; /* also of a quotient of 2^16 */
    if (quotient <= 0xFFFFu) {
        const uint32_t square = quotient * quotient;
        lower = ((quotient > 0u) && (square > remains)) ? (quotient - 1u) : quotient;
    }
    const uint32_t root = (upper << 16) | lower;
    return root >> up;
}

/* (x 2^16 + next) / y rounded down, y of 32 bits and x < y; *rest: what is left. The quotient by the upper half of y is
 * too large by two at most. */
static uint32_t digit_of(uint32_t x, uint32_t y, uint32_t next, uint32_t *rest)
{
    const uint32_t upper = y >> 16;
    const uint32_t lower = y & 0xFFFFu;
    uint32_t digit = x / upper;
    uint32_t left = x - (digit * upper);
    for (uint32_t i = 0; i < 2u; i++) {
        if ((left < 0x10000u) && ((digit > 0xFFFFu) || ((digit * lower) > ((left << 16) | next)))) {
            digit--;
            left += upper;
        }
    }
    *rest = ((x << 16) | next) - (digit * y);
    return digit;
}

/* D. E. Knuth, The Art of Computer Programming 2, algorithm D, with two digits of 16 bits. */
uint32_t pvid_quotient_in_halves_q31(uint64_t x, uint32_t y)
{
    const uint32_t up = 32u - pvid_bit_length_q31(y);
    const uint32_t divisor = y << up;
    const uint64_t dividend = x << up;
    const uint32_t low = (uint32_t)(dividend & 0xFFFFFFFFu);
    uint32_t rest;
    const uint32_t upper = digit_of((uint32_t)(dividend >> 32), divisor, low >> 16, &rest);
    const uint32_t lower = digit_of(rest, divisor, low & 0xFFFFu, &rest);
    return (upper << 16) + lower;
}

pvid_root_q31 pvid_root_of_q31(int64_t m, int32_t exponent)
{
    int32_t up = 62 - (int32_t)pvid_bit_length_q31((uint64_t)m);
    if (((exponent - up) & 1) != 0) {
        up--;
    }
    const pvid_root_q31 root = {(int32_t)pvid_square_root_q31((uint64_t)pvid_scale_q31(m, -up)), (exponent - up) / 2};
    return root;
}

int64_t pvid_times_q31(int64_t a, int32_t b)
{
    const int64_t high = pvid_floor_shift_q31(a, 31);
    const int32_t low = (int32_t)(a & (int64_t)INT32_MAX);
    return (high * b) + pvid_round_shift_q31(pvid_product_q31(low, b), 31);
}
