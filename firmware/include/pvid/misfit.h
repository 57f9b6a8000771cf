/* pvid/misfit.h - alarm of the strong form: the residuals of the rows are larger than they were.
 *
 * Sums that contain a jolt, or a mechanism that changed under sums without forgetting, give a wrong estimate with
 * small standard errors. The residuals e = Y - N^T theta of later rows show it. They are judged in blocks by
 * their sum of squares and by
 *
 *   q = sum e^2 / sum (p[0] dY/dp[0])^2
 *
 * Noise in the regressors biases p[0] by about -q (more if other parameters can compensate). A block is a misfit
 * iff
 *   - q > PVID_MISFIT_MOST, or
 *   - both sum e^2 and q exceed PVID_MISFIT_TIMES their values in the quietest block (a different drive changes
 *     only one of them) and q > PVID_MISFIT_LEAST, the size of the filters' bias, or
 *   - a residual is not finite.
 * The first block only sets the reference; blocks without motion are not judged.
 *
 * Cost: ten instructions per row, two divisions per block.
 */
#ifndef PVID_MISFIT_H
#define PVID_MISFIT_H

#include <stdint.h>

#define PVID_MISFIT_MOST 4.0e-3f  /* of q: biases w by about 0.5 % */
#define PVID_MISFIT_LEAST 2.0e-5f /* of q: w is off by about 0.5 % */
#define PVID_MISFIT_TIMES 3.0f    /* blocks of white noise differ by a quarter */
#define PVID_MISFIT_BLOCK_S 4.0f  /* length of a block [s]: three swings of the slow mode */

/* State: detail/misfit_state.h, not API. Only the strong form writes to it. */
typedef struct pvid_misfit_f32 pvid_misfit_f32;

#include "pvid/detail/misfit_state.h"

#endif
