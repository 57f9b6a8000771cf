/* pvid/differentiator_q31.h - derivatives of two sensors' counts with integers only.
 *
 * The bank of differentiator.h with integer weights, over two channels sampled at the same time: orders 0 to 4 of
 * phi, 2 to 4 of y, all at the centre of the window. The sums are exact; each is shifted right once, rounding half
 * up.
 *
 *   pvid_differentiator_q31 differentiator;                              (static)
 *   if (pvid_differentiator_init_q31(&differentiator, &bank) != PVID_OK) ...
 *   if (pvid_differentiator_step_q31(&differentiator, phi, y, d_phi, d_y)) use them
 *
 * Never wraps: init sums the weights' magnitudes and refuses a bank in which counts within full scale could
 * overflow a sum or a derivative. Without a block a weight times a difference of counts fits 32 bits.
 *
 * Long windows: a point is the sum of `block` samples, and there is one result for each block: 35 points cover a window
 * of any length in 35 places.
 * Not thread-safe.
 */
#ifndef PVID_DIFFERENTIATOR_Q31_H
#define PVID_DIFFERENTIATOR_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/layout.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Largest magnitude of a derivative. */
#define PVID_DERIVATIVE_LIMIT_Q31 INT32_C(1073741824) /* 2^30 */

/* Largest full scale of a sensor, about its offset, or of the sum of a block [counts]. */
#define PVID_COUNTS_LIMIT_Q31 INT32_C(16777216) /* 2^24 */

/* Orders of y that are computed: 2, 3, 4. */
#define PVID_Y_ORDERS_Q31 3
#define PVID_Y_LOWEST_Q31 2

/* A folded bank as in differentiator.h, with integer weights w and a weighted centre sample in order 0:
 *   order 0:  centre x[0] + sum w[0][i-1] q_i,   2, 4:  sum w[k][i-1] q_i,   1, 3:  sum w[k][i-1] d_i
 *
 * times 2^-shift, with x[i] the sum of the `block` samples of a point. An order k whose weights are 2^b times those
 * of a derivative per time unit^k has 2^(shift - b) counts per time unit^k. */
typedef struct {
    uint16_t half;   /* taps on each side, 2..; 2 half stride + 1 <= PVID_MAX_WINDOW */
    uint16_t stride; /* points from tap to tap, 1.. */
    uint16_t block;  /* samples of a point, 0 or 1: one */
    int32_t phi_max; /* full scale of the counts, 1..; times the block at most PVID_COUNTS_LIMIT_Q31 */
    int32_t y_max;
    int32_t centre;                     /* 1..2^30 */
    uint8_t phi_shift[PVID_ORDERS];     /* 0..62 */
    uint8_t y_shift[PVID_Y_ORDERS_Q31]; /* of orders 2, 3, 4 */
    const PVID_TABLE int32_t *weights;  /* [PVID_ORDERS][half]; kept by reference */
} pvid_fir_bank_q31;

/* Central differences on five points in twelfths: centre 12, no shift, exact. */
extern const PVID_TABLE int32_t pvid_five_points_q31[PVID_ORDERS * 2];
#define PVID_FIVE_POINTS_CENTRE_Q31 12

/* State: detail/differentiator_state_q31.h, not API. Only the functions below write to it. */
typedef struct pvid_differentiator_q31 pvid_differentiator_q31;

/* The init below, for an application with this word (layout.h). */
pvid_status pvid_differentiator_init_layout_q31(pvid_differentiator_q31 *self, const pvid_fir_bank_q31 *bank,
                                                uint32_t layout);

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - library and application were compiled with different sizes (PVID_BAD_LAYOUT; *self is unchanged),
 *   - a field of the bank is out of its range (the status names it), or
 *   - counts within full scale could overflow a product (PVID_BAD_FULL_SCALE) or a sum (PVID_BAD_SHIFT). */
static inline pvid_status pvid_differentiator_init_q31(pvid_differentiator_q31 *self, const pvid_fir_bank_q31 *bank)
{
    return pvid_differentiator_init_layout_q31(self, bank, PVID_LAYOUT);
}

/* Empties the window; call it after a gap, when samples are no longer equidistant. */
void pvid_differentiator_reset_q31(pvid_differentiator_q31 *self);

/* Adds one sample of each channel, within full scale. When it completes a point and the window is full, writes the
 * derivatives of phi and y and returns true. Cost then: 8 half multiplications; five points without a shift are written
 * out. */
bool pvid_differentiator_step_q31(pvid_differentiator_q31 *self, int32_t phi, int32_t y, int32_t d_phi[PVID_ORDERS],
                                  int32_t d_y[PVID_Y_ORDERS_Q31]);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/differentiator_state_q31.h"

#endif
