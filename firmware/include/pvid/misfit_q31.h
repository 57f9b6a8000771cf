/* pvid/misfit_q31.h - tells when the fixed-point strong form leaves more unexplained than it should: misfit.h in
 * integers.
 *
 * The same blocks, the same part q and the same thresholds: see there. The squares of up to 64 rows are exact 64-bit
 * sums; what these add up to, and what is judged, are numbers of 30 digits with an exponent, whose range no block ends.
 *
 * Total; some ten instructions a row where there is a long multiplication, three divisions a block.
 */
#ifndef PVID_MISFIT_Q31_H
#define PVID_MISFIT_Q31_H

#include <stdint.h>

#include "pvid/estimator_q31.h"

/* State: detail/misfit_state_q31.h. Only the strong form writes to it. */
typedef struct pvid_misfit_q31 pvid_misfit_q31;

#include "pvid/detail/misfit_state_q31.h"

#endif
