/* pvid/misfit_q31.h - alarm of the fixed-point strong form: misfit.h with integers only.
 *
 * The same blocks, quotient q and thresholds. The squares of up to 64 rows are exact 64-bit sums; block sums are
 * numbers of 30 bits with an exponent, whose range is never exceeded.
 *
 * Cost: ten instructions per row with a long multiplication, three divisions per block.
 */
#ifndef PVID_MISFIT_Q31_H
#define PVID_MISFIT_Q31_H

#include <stdint.h>

#include "pvid/estimator_q31.h"

/* State: detail/misfit_state_q31.h, not API. Only the strong form writes to it. */
typedef struct pvid_misfit_q31 pvid_misfit_q31;

#include "pvid/detail/misfit_state_q31.h"

#endif
