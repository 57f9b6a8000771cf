/* pvid/detail/misfit_state.h - the state behind misfit.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_MISFIT_STATE_H
#define PVID_DETAIL_MISFIT_STATE_H

#include "pvid/misfit.h"

/* Only the strong form writes to it. */
struct pvid_misfit_f32 {
    float growth;     /* factor on least_rss and least_part per block, >= 1: forgetting */
    float rss;        /* sum of e^2 of the block so far */
    float signal;     /* sum of (p[0] dY/dp[0])^2 of the block */
    float least_rss;  /* rss of the quietest block */
    float least_part; /* least q of a block */
    uint16_t block;   /* rows of a block, 1.. */
    uint16_t left;    /* rows until it is judged, 1.. */
};

#endif
