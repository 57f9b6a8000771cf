/* From an exact sum, or an int32, to an int32 in another format. Private to the core. */
#ifndef PVID_NUMBER_RESCALE_Q31_H
#define PVID_NUMBER_RESCALE_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "number/integer_q31.h"
#include "pvid/model_q31.h"

/* Whether every field is in its range. */
static inline bool pvid_rescale_is_valid_q31(const pvid_rescale_q31 *rescale)
{
    return (rescale->down <= 62u) && (rescale->shift <= 62u) && (rescale->multiplier > 0);
}

/* Saturated at +-INT32_MAX, which is beyond every reach and limit. */
static inline int32_t pvid_rescaled_q31(int64_t sum, const pvid_rescale_q31 *rescale)
{
    const int32_t first = (int32_t)pvid_clamp_q31(pvid_round_shift_q31(sum, rescale->down), INT32_MAX);
    const int64_t second = pvid_round_shift_q31(pvid_product_q31(first, rescale->multiplier), rescale->shift);
    return (int32_t)pvid_clamp_q31(second, INT32_MAX);
}

#endif
