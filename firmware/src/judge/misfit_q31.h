/* The misfit alarm of the fixed-point strong form, by its residuals: see pvid/misfit_q31.h. Private to the core. */
#ifndef PVID_PRIVATE_MISFIT_Q31_H
#define PVID_PRIVATE_MISFIT_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/misfit_q31.h"

/* Rows whose squares fit into the sum of an int64. */
#define PVID_MISFIT_FEW 64u

/* Initialises `self` for drive_ticks rows per second (1..2^30) and a time constant of forgetting of
 * forgetting_groups rows, 0: none. */
void pvid_misfit_init_q31(pvid_misfit_q31 *self, uint32_t drive_ticks, uint32_t forgetting_groups);

/* The square of a sensitivity p[0] dY/dp[0], clamped to +-2^31, over 64: at most 2^56. */
int64_t pvid_misfit_signal_q31(int64_t sensitivity);

/* Adds the rows of an instant: the sum of the squares of their residuals and that of their signals, each clamped to
 * 2^56. Returns true at the end of a block, which must then be judged. */
bool pvid_misfit_add_q31(pvid_misfit_q31 *self, int64_t square, int64_t signal);

/* Ends a block. Returns whether it is a misfit. */
bool pvid_misfit_judge_q31(pvid_misfit_q31 *self);

#endif
