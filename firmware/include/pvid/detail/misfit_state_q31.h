/* pvid/detail/misfit_state_q31.h - the state behind misfit_q31.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_MISFIT_STATE_Q31_H
#define PVID_DETAIL_MISFIT_STATE_Q31_H

#include "pvid/misfit_q31.h"

/* Only the strong form writes to it. */
struct pvid_misfit_q31 {
    int64_t few_rss;            /* of the last rows, at most 64: sum of e^2 */
    int64_t few_signal;         /* sum of (p[0] dY/dp[0] / 8)^2 of them */
    pvid_scaled_q31 rss;        /* of the block's rows before them */
    pvid_scaled_q31 signal;     /* of (p[0] dY/dp[0])^2 */
    pvid_scaled_q31 growth;     /* factor on least_rss and least_part per block, 1..2: forgetting */
    pvid_scaled_q31 least_rss;  /* rss of the quietest block */
    pvid_scaled_q31 least_part; /* least q of a block */
    uint16_t block;             /* rows of a block, 1.. */
    uint16_t left;              /* rows until it is judged, 1.. */
};

#endif
