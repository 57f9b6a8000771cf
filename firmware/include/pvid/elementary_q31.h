/* pvid/elementary_q31.h - sine, cosine, sign, products and quotients in integers.
 *
 * The fixed-point functions that `pvid model build` writes call these. Each int32 has its own format: the value is the
 * integer times 2^-bits. Pure functions.
 */
#ifndef PVID_ELEMENTARY_Q31_H
#define PVID_ELEMENTARY_Q31_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/detail/shift_q31.h"
#include "pvid/scaled_q31.h"

#ifdef __cplusplus
extern "C" {
#endif

/* sin x, cos x in Q30 of x 2^-bits [rad], bits 0..30. Error: below 4e-9 for |x 2^-bits| <= 4, beyond it 1.2e-10 of the
 * angle more. Method: x / pi less the nearest integer, a polynomial of degree 11. */
int32_t pvid_sin_q31(int32_t x, uint32_t bits);
int32_t pvid_cos_q31(int32_t x, uint32_t bits);

/* Sign of v in Q30: -1, 0 or 1. */
int32_t pvid_sign_q31(int32_t v);

/* v / (|v| + width) in Q30, width > 0 in the format of v, |v| <= 2^30. */
int32_t pvid_soft_sign_q31(int32_t v, int32_t width);

/* tanh(v / width) in Q30, width > 0, v > INT32_MIN. Error: below 2^-26. Method: (1 - e) / (1 + e), e = 2^-t with
 * t = 2 |v| / (width ln 2), by a polynomial of degree 6 in the fraction of t. */
int32_t pvid_tanh_q31(int32_t v, int32_t width);

/* Whether |x[i]| <= limit[i] for all i < n. */
bool pvid_within_limits_q31(const int32_t x[], const int32_t limit[], size_t n);

/* Each in 30 digits: a / b for b of any sign, 0 for b = 0; sine and cosine of an angle below 2^30 rad, 0 beyond; sign;
 * magnitude. */
pvid_scaled_q31 pvid_scaled_quotient_q31(pvid_scaled_q31 a, pvid_scaled_q31 b);
pvid_scaled_q31 pvid_scaled_sin_q31(pvid_scaled_q31 a);
pvid_scaled_q31 pvid_scaled_cos_q31(pvid_scaled_q31 a);
pvid_scaled_q31 pvid_scaled_sign_q31(pvid_scaled_q31 a);
pvid_scaled_q31 pvid_scaled_magnitude_q31(pvid_scaled_q31 a);

/* x 2^-s rounded half up, any s >= 0. */
static inline int32_t pvid_fixed_shift_q31(int32_t x, uint32_t s)
{
    return (int32_t)pvid_round_shift_q31(x, s);
}

/* a b 2^-s rounded half up; it fits an int32. */
#if defined(__ARM_ARCH_6M__) /* by four multiplications of 16 by 16 bits */
int32_t pvid_fixed_product_q31(int32_t a, int32_t b, uint32_t s);
#else
static inline int32_t pvid_fixed_product_q31(int32_t a, int32_t b, uint32_t s)
{
    return (int32_t)pvid_round_shift_q31((int64_t)a * b, s);
}
#endif

/* a 2^s / b rounded towards 0, s <= 31; it fits an int32. 0 for b = 0. */
static inline int32_t pvid_fixed_quotient_q31(int32_t a, int32_t b, uint32_t s)
{
    return (b == 0) ? 0 : (int32_t)(((int64_t)a * ((int64_t)1 << s)) / b);
}

/* |x|, x > INT32_MIN. */
static inline int32_t pvid_fixed_magnitude_q31(int32_t x)
{
    return (x < 0) ? -x : x;
}

#ifdef __cplusplus
}
#endif

#endif
