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

/* State; only the strong form writes to it. */
typedef struct {
    int64_t few_energy;           /* of the last rows, at most 64: sum of e^2 */
    int64_t few_signal;           /* likewise: sum of (p[0] dY/dp[0] / 8)^2 */
    pvid_scaled_q31 energy;       /* of the block's rows before them */
    pvid_scaled_q31 signal;       /* of (p[0] dY/dp[0])^2 */
    pvid_scaled_q31 growth;       /* of the quietest ones, a block, 1..2: forgetting */
    pvid_scaled_q31 least_energy; /* of a block */
    pvid_scaled_q31 least_part;   /* q of a block */
    uint16_t block;               /* rows of a block, 1.. */
    uint16_t left;                /* rows until it is judged, 1.. */
} pvid_misfit_q31;

#endif
