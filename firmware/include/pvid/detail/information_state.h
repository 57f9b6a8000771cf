/* pvid/detail/information_state.h - the state behind information.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_INFORMATION_STATE_H
#define PVID_DETAIL_INFORMATION_STATE_H

#include "pvid/information.h"

struct pvid_information_f32 {
    uint16_t n_moments;
    uint16_t n_theta;
    uint16_t block;   /* groups of rows between folds, 1.. */
    uint16_t age;     /* groups since the last fold, 0..block-1 */
    float retention;  /* factor on the past at a fold, in (0, 1]; 1 keeps everything */
    float row_weight; /* weight of a row */
    float rounding;   /* bound of the rounding error of rr, which every step of p changes (estimator.h); fades with the
                         sums [units of yy] */
    float high[PVID_MAX_SUMS];
    float low[PVID_MAX_SUMS];
};

#endif
