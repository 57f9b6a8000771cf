/* From an exact sum to an int32 in another format. Private to the core. */
#ifndef PVID_WEAK_RESCALE_Q31_H
#define PVID_WEAK_RESCALE_Q31_H

#include <stdint.h>

#include "number/integer_q31.h"
#include "pvid/weak_q31.h"

/* Saturated at +-INT32_MAX, which is beyond the reach of every input of `values`. */
static inline int32_t pvid_weak_rescaled_q31(int64_t sum, const pvid_weak_rescale_q31 *rescale)
{
    const int32_t first = (int32_t)pvid_clamp_q31(pvid_round_shift_q31(sum, rescale->down), INT32_MAX);
    const int64_t second = pvid_round_shift_q31(pvid_product_q31(first, rescale->multiplier), rescale->shift);
    return (int32_t)pvid_clamp_q31(second, INT32_MAX);
}

#endif
