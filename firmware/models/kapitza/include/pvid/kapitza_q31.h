/* pvid/kapitza_q31.h - physical parameters of the pendulum from a fixed-point estimate, with integers only.
 *
 *   g = w l1,   l2 = l1 (d1 - d2 - 1)/d2,   rho2 = l1 sqrt(d1 - d2 - 1)/d2          (theory.md 1)
 *
 * Lengths and g are int32 with 24 fractional bits: up to 127 m in steps of 60 nm, m/s^2 likewise.
 */
#ifndef PVID_KAPITZA_Q31_H
#define PVID_KAPITZA_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/estimator_q31.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PVID_KAPITZA_BITS_Q31 24

/* Scale factors from p to metres; `pvid tables --core q31` prints them. */
typedef struct {
    int32_t l1;           /* [2^-24 m], > 0 */
    int32_t g_multiplier; /* g [2^-24 m/s^2] = w g_multiplier 2^-g_shift for the integer w of an estimate, > 0 */
    int8_t g_shift;       /* -31..62 */
    int8_t d1_bits;       /* formats of d1 and d2 in the estimate, 0..31 */
    int8_t d2_bits;
} pvid_kapitza_scale_q31;

/* [2^-24 m/s^2, m, m] */
typedef struct {
    int32_t g;
    int32_t l2;
    int32_t rho2;
} pvid_kapitza_q31;

/* Physical parameters of an estimate and their standard errors by the delta method. Fails (returns false, writes
 * nothing) iff
 *   - p is outside the physical region,
 *   - a parameter exceeds 127, or
 *   - a field of scale is out of its range. */
bool pvid_kapitza_physical_q31(const pvid_estimate_q31 *estimate, const pvid_kapitza_scale_q31 *scale,
                               pvid_kapitza_q31 *value, pvid_kapitza_q31 *se);

#ifdef __cplusplus
}
#endif

#endif
