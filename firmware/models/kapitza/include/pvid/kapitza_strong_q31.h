/* pvid/kapitza_strong_q31.h - the strong form of Kapitza's pendulum in integers (theory.md 2): its rows, and its
 * estimator of w, d1, d2.
 *
 * Time is counted in a unit T in which the rates u + w are about 1, w from a reference w_r: with G = u + w_r in place
 * of u the row is the one of theory.md 2 and w - w_r takes the place of w. Rates have 24 bits after the point, all
 * other entries of a row one unit, that of an angle. An entry that does not fit refuses the row; nothing is clamped.
 *
 * The estimator keeps 57 repeated moments as exact 64-bit sums. A solve shifts them from G to the present u + w in 28
 * bits and a common power of two for each family of columns, and factors S = L D L^T with one division of 32 bits a
 * pivot. Law, reasons and settings are those of estimator_q31.h. For every sequence of rows no sum overflows, no
 * divisor is 0, and p stays within its bounds. The proof assumes the Cauchy-Schwarz inequality of the sums
 * (host/docs/proofs.md).
 * Not thread-safe.
 */
#ifndef PVID_KAPITZA_STRONG_Q31_H
#define PVID_KAPITZA_STRONG_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/differentiator_q31.h"
#include "pvid/estimator_q31.h"
#include "pvid/kapitza_parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Entries of a row: those of theory.md 2, N_1 .. N_11 with G in place of u, then Y and G. N_1, N_2 and Y have one unit,
 * -G^k phi'' and -G^k phi have finer ones. */
#define PVID_KAPITZA_ROW_Q31 13
enum { PVID_KAPITZA_ROW_Y = 11, PVID_KAPITZA_ROW_G = 12 };

#define PVID_KAPITZA_RATE_BITS 24                        /* after the point of u, u', u'', w_r and G */
#define PVID_KAPITZA_RATE_LIMIT_Q31 ((int32_t)1 << 29)   /* of |u| and w_r: 32 / T^2 */
#define PVID_KAPITZA_W_BITS (PVID_KAPITZA_RATE_BITS + 1) /* of w */

typedef struct {
    int8_t phi_shift[PVID_ORDERS]; /* left shift of each derivative to its unit, -31..31; negative: right. Order 0: that
                                      of -G^k phi, 2 to 4: that of N_1, N_2 and Y */
    int8_t finer[2];               /* bits that -G^k phi'' and -G^k phi have more than N_1, -31..31 */
    int32_t phi3;                  /* factor on phi''', Q30, 2^30 or 2^30.5: T^2 is a power of two */
    int32_t reference;             /* w_r, 0..PVID_KAPITZA_RATE_LIMIT_Q31 */
} pvid_strong_row_q31;

/* One row from phi[k] = d^k phi/dt^k within +-PVID_DERIVATIVE_LIMIT_Q31 and u = y_A''/l1 within
 * +-PVID_KAPITZA_RATE_LIMIT_Q31, u', u'' within twice that. Fails (returns false, row undefined) iff an entry is
 * outside -2^28..2^28 - 1 or a part of one outside -2^30..2^30 - 1. Cost: 13 products of 32 by 32 bits. */
bool pvid_kapitza_strong_row_q31(const pvid_strong_row_q31 *format, const int32_t phi[PVID_ORDERS],
                                 const int32_t u[PVID_Y_ORDERS_Q31], int32_t row[PVID_KAPITZA_ROW_Q31]);

/* State: detail/kapitza_strong_state_q31.h, not API. Only the functions below write to it. */
typedef struct pvid_kapitza_estimator_q31 pvid_kapitza_estimator_q31;

/* Initialises `self`; of the configuration model, n_bits, y_bits, row_weight and noise_margin are not read, and row_sd
 * is in 2^-8 of Y's unit. rows: their formats. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER), or
 *   - a field of config or rows is out of its range (the status names it; PVID_BAD_FORMAT: p_bits[0] is not
 *     PVID_KAPITZA_W_BITS, or another with the bits of `finer` is not 0..60). */
pvid_status pvid_kapitza_estimator_init_q31(pvid_kapitza_estimator_q31 *self, const pvid_estimator_config_q31 *config,
                                            const pvid_strong_row_q31 *rows);

/* *e = Y - N^T theta at the present p and gradient[a] = d(N^T theta)/dp_a. Returns whether the row can be taken: e and
 * what it is made of fit. */
bool pvid_kapitza_estimator_innovate_q31(const pvid_kapitza_estimator_q31 *self,
                                         const int32_t row[PVID_KAPITZA_ROW_Q31], int32_t *e,
                                         int32_t gradient[PVID_KAPITZA_P]);

/* Adds such a row and, every `divider` rows, solves and moves p. Returns PVID_UPDATED, PVID_ACCUMULATED (no solve due),
 * PVID_HELD_NOT_EXCITED or PVID_HELD_SINGULAR. */
pvid_reason pvid_kapitza_estimator_take_q31(pvid_kapitza_estimator_q31 *self, const int32_t row[PVID_KAPITZA_ROW_Q31],
                                            int32_t e, const int32_t gradient[PVID_KAPITZA_P]);

/* Standard errors, kappa and residual of the present p, as pvid_estimator_assess_f32. Changes nothing. */
void pvid_kapitza_estimator_assess_q31(const pvid_kapitza_estimator_q31 *self, pvid_estimate_q31 *estimate);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/kapitza_strong_state_q31.h"

#endif
