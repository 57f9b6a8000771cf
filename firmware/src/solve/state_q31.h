/* What every part of the fixed-point estimator reads of its state. Private to the core. */
#ifndef PVID_SOLVE_STATE_Q31_H
#define PVID_SOLVE_STATE_Q31_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "solve/cholesky_q31.h"
#include "solve/information_q31.h"
#include "number/integer_q31.h"
#include "pvid/estimator_q31.h"

#define PVID_CLAMP_LIMIT (2 * PVID_SUM_LIMIT) /* of |b|, rr and what a step may add to them */
#define PVID_ROW_SD_BITS 8                    /* format of row_sd beyond Y's */
#define PVID_SIZE_BITS 22                     /* of the size of a step: |dp| in it still is an int64 */
#define PVID_S_BITS 32                        /* of the unit of s; see pvid_estimator_solve_q31 */
#define PVID_ZERO_EXPONENT_Q31 (-200)         /* exponent of 0: never the largest */

static inline bool pvid_is_positive_q31(const pvid_model_q31 *model, size_t i)
{
    return ((model->positive >> i) & 1u) != 0u;
}

/* Bits of |x|, or PVID_ZERO_EXPONENT_Q31. */
static inline int32_t pvid_length_q31(int64_t x)
{
    return (x == 0) ? PVID_ZERO_EXPONENT_Q31 : (int32_t)pvid_bit_length_q31(pvid_magnitude_q31(x));
}

/* One past the last non-zero of the column of C that starts at `start`. */
static inline size_t pvid_column_end_q31(const pvid_model_q31 *model, size_t start)
{
    size_t k = start;
    while ((k < model->n_c) && (model->c_column[k] == model->c_column[start])) {
        k++;
    }
    return k;
}

static inline const int64_t *pvid_b_of_q31(const pvid_information_q31 *information)
{
    return &information->sums[((size_t)information->n_sums - 2u) - information->n_theta];
}

/* Sums of zero, as behind init: p stays, until the caller places it. */
void pvid_estimator_clear_q31(pvid_estimator_q31 *self);

/* Whether init has accepted a configuration. */
static inline bool pvid_estimator_is_ready_q31(const pvid_estimator_q31 *self)
{
    const bool ready = (self != NULL) && (self->model != NULL);
    PVID_ASSERT(ready);
    return ready;
}

#endif
