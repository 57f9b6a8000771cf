/* pvid/bank_q31.h - the filters of a fixed-point strong form (NAME_strong_q31.h): derivatives of order 0 to 4 from one
 * window of counts, integers only.
 *
 * As in differentiator.h, with x_0 the middle sample and x_i, x_-i those i strides away,
 *
 *   q_i = (x_i - x_0) + (x_-i - x_0),   d_i = x_i - x_-i,   i = 1..half
 *   order 0:  centre x_0 + sum w_0i q_i,   orders 2, 4:  sum w_ki q_i,   orders 1, 3:  sum w_ki d_i
 *
 * The sums are exact. `pvid model build --strong` prints the table of a rig.
 */
#ifndef PVID_BANK_Q31_H
#define PVID_BANK_Q31_H

#include <stdint.h>

#include "pvid/config.h"
#include "pvid/model_q31.h"

/* Largest full scale of a sensor about its offset [counts]. */
#define PVID_FULL_SCALE_LIMIT_Q31 INT32_C(16777216) /* 2^24 */

typedef struct {
    uint16_t half;                     /* taps on each side, 2.. */
    uint16_t stride;                   /* samples from tap to tap, 1..; 2 half stride + 1 <= PVID_MAX_WINDOW */
    int32_t centre;                    /* 1..2^30 */
    const PVID_TABLE int32_t *weights; /* [PVID_ORDERS][half]; kept by reference */
} pvid_bank_q31;

#endif
