/* pvid/scaled_q31.h - numbers of any size with 30 bits: m 2^e, integers only.
 *
 * For theta(p) and its Jacobian in fixed point: a parameter may be 1e-5 or 1e5, and no format has to be chosen. Each
 * result is rounded to 30 digits (relative error 2^-30 a sum or product, 2^-29 a quotient). Pure functions.
 * pvid.twin.q31.scaled and pvid.twin.q31.elementary have the same operations in numpy.
 */
#ifndef PVID_SCALED_Q31_H
#define PVID_SCALED_Q31_H

#include "pvid/estimator_q31.h"

#ifdef __cplusplus
extern "C" {
#endif

/* x 2^exponent, |x| <= 2^62. */
pvid_scaled_q31 pvid_scaled_of_q31(int64_t x, int32_t exponent);

/* a + b, a b, a / b (b > 0). Exponents stay within some thousands. */
pvid_scaled_q31 pvid_scaled_plus_q31(pvid_scaled_q31 a, pvid_scaled_q31 b);
pvid_scaled_q31 pvid_scaled_times_q31(pvid_scaled_q31 a, pvid_scaled_q31 b);
pvid_scaled_q31 pvid_scaled_over_q31(pvid_scaled_q31 a, pvid_scaled_q31 b);

/* -a */
static inline pvid_scaled_q31 pvid_scaled_negated_q31(pvid_scaled_q31 a)
{
    const pvid_scaled_q31 result = {-a.m, a.e};
    return result;
}

/* a - b, as a + b. */
static inline pvid_scaled_q31 pvid_scaled_minus_q31(pvid_scaled_q31 a, pvid_scaled_q31 b)
{
    return pvid_scaled_plus_q31(a, pvid_scaled_negated_q31(b));
}

#ifdef __cplusplus
}
#endif

#endif
