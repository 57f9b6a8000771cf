/* How the fixed-point strong form judges itself by its residuals: see pvid/misfit_q31.h. Private to the core. */
#ifndef PVID_PRIVATE_MISFIT_Q31_H
#define PVID_PRIVATE_MISFIT_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/misfit_q31.h"

/* Rows whose squares add up in an int64. */
#define PVID_MISFIT_FEW 64u

/* Prepares `self` for rows that come drive_ticks a second (1..2^30) and are forgotten with a time constant of
 * forgetting_groups rows, 0: never. */
void pvid_misfit_init_q31(pvid_misfit_q31 *self, uint32_t drive_ticks, uint32_t forgetting_groups);

/* Takes a row in: the square of its residual, at most 2^56, and p[0] times its gradient in p[0], of which what is
 * beyond
 * +-2^31 counts as that. Returns whether it was the last of a block, which is then to be judged. */
bool pvid_misfit_add_q31(pvid_misfit_q31 *self, int64_t square, int64_t sensitivity);

/* Ends a block: whether it is a misfit. */
bool pvid_misfit_judge_q31(pvid_misfit_q31 *self);

#endif
