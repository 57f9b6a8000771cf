/* pvid/misfit.h - tells when the strong form leaves more unexplained than it should: its verdict on itself.
 *
 * Sums that took a jolt or a stuck sensor in, and a mechanism that has changed under sums that never forget, leave an
 * estimate that is wrong and looks sure. What gives it away is the rows that follow: their residuals
 * e = Y - N^T theta. They are judged in blocks of rows by their energy, and by the part q that it is of what the rows
 * say of p[0],
 *
 *   q = sum e^2 / sum (p[0] dY/dp[0])^2
 *
 * of which noise in the regressors takes about q away from p[0] (more where the other parameters can imitate it). A
 * block is a misfit where q is beyond PVID_MISFIT_MOST, or where both the energy and q are more than PVID_MISFIT_TIMES
 * what they were in the quietest block. (Another drive moves one of the two, not both.) Below PVID_MISFIT_LEAST nothing
 * is a misfit: the filters' own bias is of that size. The first block only teaches: p is still on its way. Of rows
 * without motion nothing is said; residuals that are no numbers are a misfit.
 *
 * Total; some ten instructions a row, two divisions a block.
 */
#ifndef PVID_MISFIT_H
#define PVID_MISFIT_H

#include <stdint.h>

#define PVID_MISFIT_MOST 4.0e-3f  /* of q: takes some 0.5 % away from w */
#define PVID_MISFIT_LEAST 2.0e-5f /* of q: w is off by some 0.5 % */
#define PVID_MISFIT_TIMES 3.0f    /* blocks of white noise differ by a quarter */
#define PVID_MISFIT_BLOCK_S 4.0f  /* three swings of the slow mode */

/* State: detail/misfit_state.h. Only the strong form writes to it. */
typedef struct pvid_misfit_f32 pvid_misfit_f32;

#include "pvid/detail/misfit_state.h"

#endif
