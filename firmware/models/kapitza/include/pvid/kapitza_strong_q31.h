/* pvid/kapitza_strong_q31.h - the strong form of Kapitza's pendulum in integers (theory.md 2).
 *
 * A row consists of derivatives in one time unit: all orders of phi in one format, u, u', u'' in another, so that
 * products with equal total order have equal formats. Each entry of the row is shifted to its own format, which
 * the design tool chooses from its expected size; a row with an entry that does not fit is refused, never clamped.
 */
#ifndef PVID_KAPITZA_STRONG_Q31_H
#define PVID_KAPITZA_STRONG_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/differentiator_q31.h"
#include "pvid/kapitza_parameters.h"
#include "pvid/model_q31.h"

#if !defined(PVID_PLAIN_NAMES) /* see sized.h */
#define pvid_kapitza_strong_row_q31 PVID_SIZED(pvid_kapitza_strong_row_q31)
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Right shifts, 0..62, rounding half up, that bring a row to its formats. With phi in units of 2^-f and u in units
 * of 2^-g:
 *
 *   N_2 has -n_e + f bits after the point, N_1 f + g - n_a,
 *   N_6 has f - n_phi2[0], N_5 .. N_3 each g - n_phi2[k] more than the one before, N_11 .. N_7 likewise with n_phi0,
 *   Y has f + 2 g - part - y. */
typedef struct {
    uint8_t n_a;       /* of N_1 */
    uint8_t n_e;       /* of N_2 = -phi'''' */
    uint8_t n_phi2[4]; /* of -phi'', -u phi'', -u^2 phi'', -u^3 phi'': N_6 .. N_3 */
    uint8_t n_phi0[5]; /* of -phi .. -u^4 phi: N_11 .. N_7 */
    uint8_t part;      /* of the two parts of Y */
    uint8_t y;
} pvid_strong_row_q31;

/* One row from phi[k] = d^k phi/dt^k and u = y_A''/l1, u', u'', all within +-PVID_DERIVATIVE_LIMIT_Q31. Writes Y
 * and N[11] in the order of pvid_kapitza_strong_row_f32, with the binomial coefficients in theta. Fails (returns
 * false, Y and N undefined) iff an entry or a part of Y exceeds +-PVID_ROW_LIMIT_Q31. Cost: 13 products of 32 by
 * 32 bits. */
bool pvid_kapitza_strong_row_q31(const pvid_strong_row_q31 *shifts, const int32_t phi[PVID_ORDERS],
                                 const int32_t u[PVID_Y_ORDERS_Q31], int32_t *y, int32_t n[PVID_KAPITZA_STRONG_THETA]);

/* Sensitivity of N^T theta: w times its gradient in w, from term[i] = N_i theta_i; each term counts with the power
 * of w in theta_i. */
int64_t pvid_kapitza_strong_sensitivity_q31(const int64_t term[PVID_KAPITZA_STRONG_THETA]);

/* The strong form as a model: 11 entries of theta, p = (w, d1, d2). */
extern const pvid_model_q31 pvid_kapitza_strong_q31;

#ifdef __cplusplus
}
#endif

#endif
