/* sqrtf in integers, for cores without an FPU and a C library: correctly rounded, hence the bits of a PC.
 *
 * With x = f 2^(e - 23), f an integer of 24 or 25 bits and e even, the root of f 2^25 is found bit by bit: 25
 * bits, the last one for rounding. There are no ties: a root that ends in 1 has an odd square, and f 2^25 is
 * even. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define FRACTION_BITS 23
#define FRACTION_MASK 0x007FFFFFu
#define PAIRS_MASK 0x01FFFFFFu
#define HIDDEN_BIT 0x00800000u
#define INFINITY_BITS 0x7F800000u
#define NAN_BITS 0x7FC00000u
#define SIGN_BIT 0x80000000u

static float from_bits(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

float sqrtf(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    if (((bits & ~SIGN_BIT) == 0u) || (bits == INFINITY_BITS)) {
        return x; /* +-0, infinity */
    }
    if (((bits & ~SIGN_BIT) > INFINITY_BITS) || ((bits & SIGN_BIT) != 0u)) {
        return from_bits(NAN_BITS);
    }
    int32_t exponent = (int32_t)(bits >> FRACTION_BITS);
    uint32_t fraction = bits & FRACTION_MASK;
    if (exponent == 0) { /* subnormal: shift the leading bit up */
        exponent = 1;
        for (int32_t shift = 0; (shift < FRACTION_BITS) && ((fraction & HIDDEN_BIT) == 0u); shift++) {
            fraction <<= 1;
            exponent--;
        }
    }
    fraction |= HIDDEN_BIT;
    exponent -= 127;
    if ((exponent & 1) != 0) {
        fraction <<= 1;
        exponent--;
    }
    /* Two bits of the radicand enter for one of the root; those below the fraction are 0. */
    uint32_t root = 0;
    uint32_t rest = 0;
    for (int32_t step = 0; step < FRACTION_BITS + 2; step++) {
        rest = (rest << 2) | (fraction >> FRACTION_BITS);
        fraction = (fraction << 2) & PAIRS_MASK;
        const uint32_t trial = (root << 2) | 1u;
        root <<= 1;
        if (rest >= trial) {
            rest -= trial;
            root |= 1u;
        }
    }
    root = (root >> 1) + (root & 1u);
    return from_bits(((uint32_t)((exponent / 2) + 126) << FRACTION_BITS) + root);
}
