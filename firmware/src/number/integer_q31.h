/* Integer arithmetic that never wraps: rounding shifts, saturation, roots, reciprocals. Private to the core.
 *
 * Fixed-point code shifts and narrows only through these functions. Unless stated otherwise an int64 argument is
 * within +-PVID_WIDE, so that the sum of two fits. All loops have a fixed number of iterations.
 */
#ifndef PVID_INTEGER_Q31_H
#define PVID_INTEGER_Q31_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/detail/shift_q31.h"
#include "pvid/estimator_q31.h"

#define PVID_WIDE ((int64_t)1 << 62)

/* 1 in Q30. */
#define PVID_ONE_Q30 ((int32_t)1 << 30)

/* a b by four multiplications of 16 by 16 bits: half the cost of 64 by 64 on a core without a long multiplication. */
int64_t pvid_product_in_halves_q31(int32_t a, int32_t b);

/* a b. */
static inline int64_t pvid_product_q31(int32_t a, int32_t b)
{
#if defined(__ARM_ARCH_6M__)
    return pvid_product_in_halves_q31(a, b);
#else
    return (int64_t)a * b;
#endif
}

/* a b 2^-32 rounded down. */
static inline int32_t pvid_upper_product_q31(int32_t a, int32_t b)
{
#if defined(__ARM_ARCH_6M__)
    /* as pvid_product_in_halves_q31, without the lower register */
    const uint32_t a_low = (uint32_t)a & 0xFFFFu;
    const uint32_t b_low = (uint32_t)b & 0xFFFFu;
    const int32_t a_high = pvid_floor_shift_32_q31(a, 16);
    const int32_t b_high = pvid_floor_shift_32_q31(b, 16);
    const int32_t first = (a_high * (int32_t)b_low) + (int32_t)((a_low * b_low) >> 16);
    const int32_t second = ((int32_t)a_low * b_high) + (int32_t)((uint32_t)first & 0xFFFFu);
    return (a_high * b_high) + pvid_floor_shift_32_q31(first, 16) + pvid_floor_shift_32_q31(second, 16);
#else
    return (int32_t)pvid_floor_shift_q31((int64_t)a * b, 32);
#endif
}

/* a b where |a| and |b| are 2^30 at most, or |a| + |b| 2^31 - 2^17: ten instructions less on such a core. */
int64_t pvid_short_product_in_halves_q31(int32_t a, int32_t b);

static inline int64_t pvid_short_product_q31(int32_t a, int32_t b)
{
#if defined(__ARM_ARCH_6M__)
    return pvid_short_product_in_halves_q31(a, b);
#else
    return (int64_t)a * b;
#endif
}

/* a a, |a| <= 2^30. */
static inline int64_t pvid_short_square_q31(int32_t a)
{
#if defined(__ARM_ARCH_6M__)
    return pvid_short_product_in_halves_q31(a, a);
#else
    return (int64_t)a * a; /* as below */
#endif
}

/* a a. */
static inline int64_t pvid_square_q31(int32_t a)
{
#if defined(__ARM_ARCH_6M__)
    return pvid_product_in_halves_q31(a, a);
#else
    return (int64_t)a * a; /* not by the function above: the proofs see that it is no less than 0 */
#endif
}

/* x 2^-s: rounded half up where s > 0, saturated at +-PVID_WIDE where s < 0; |x| < INT64_MAX. */
int64_t pvid_scale_q31(int64_t x, int32_t s);

/* x held within +-limit. */
static inline int64_t pvid_clamp_q31(int64_t x, int64_t limit)
{
    return (x > limit) ? limit : ((x < -limit) ? -limit : x);
}

/* |x|, x > INT64_MIN. */
static inline uint64_t pvid_magnitude_q31(int64_t x)
{
    return (x < 0) ? (uint64_t)-x : (uint64_t)x;
}

/* Number of bits of x: 0 for 0, 64 for 2^63 and above. */
#if defined(__ARM_FEATURE_CLZ) && defined(__GNUC__)
static inline uint32_t pvid_bit_length_q31(uint64_t x) /* one instruction counts leading zeros */
{
    const uint32_t high = (uint32_t)(x >> 32);
    const uint32_t word = (high != 0u) ? high : (uint32_t)(x & 0xFFFFFFFFu);
    return (word == 0u) ? 0u : (((high != 0u) ? 64u : 32u) - (uint32_t)__builtin_clz(word));
}
#else
uint32_t pvid_bit_length_q31(uint64_t x);
#endif

/* Number of bits of x < 256, as of a harmonic: without a call. */
static inline uint32_t pvid_byte_length_q31(size_t x)
{
    static const uint8_t bits_of[16] = {0, 1, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4};
    return (x > 15u) ? (4u + bits_of[x >> 4]) : bits_of[x];
}

/* x / y rounded down, x < y 2^32: by two divisions of 32 by 16 bits, where there is none of 64 bits. */
uint32_t pvid_quotient_in_halves_q31(uint64_t x, uint32_t y);

/* x / y rounded down, y > 0. */
static inline uint64_t pvid_quotient_q31(uint64_t x, uint32_t y)
{
#if defined(__arm__)
    if ((x >> 32) < y) {
        return pvid_quotient_in_halves_q31(x, y);
    }
#endif
    return x / y;
}

/* Greatest r with r^2 <= x, x <= 2^62. */
uint32_t pvid_square_root_q31(uint64_t x);

/* r 2^e = sqrt(m 2^exponent), r below 2^31 and of 30 bits at least unless m is 0; 0 <= m <= PVID_WIDE. The greatest
 * such r where m < 2^60; beyond that m may lose its last bit. */
pvid_root_q31 pvid_root_of_q31(int64_t m, int32_t exponent);

/* a b 2^-31 rounded half up, |b| < 2^31. */
int64_t pvid_times_q31(int64_t a, int32_t b);

#endif
