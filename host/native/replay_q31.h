/* What pvid.core.native calls besides the core itself: the fixed-point counterpart of replay.h. */
#ifndef PVID_REPLAY_Q31_H
#define PVID_REPLAY_Q31_H

#include <stdint.h>

#include "pvid/pvid_q31.h"

/* Where a replay writes; NULL: not recorded. Rows stand one after the other, without padding. */
typedef struct {
    int32_t *p;                  /* [ticks][n_p] */
    int64_t *sums;               /* [ticks][n_sums] */
    uint8_t *exponent;           /* [ticks] of the sums */
    uint8_t *reason;             /* [ticks] */
    uint32_t *hash;              /* [ticks] running hash after the tick */
    uint32_t *running_hash;      /* in and out; needed with hash */
    int32_t *published;          /* [ticks][n_p] of the weak form */
    int32_t *published_se;       /* likewise: its standard errors */
    uint32_t *standing;          /* [ticks] of it, as in replay.h */
    pvid_estimate_q31 *estimate; /* [ticks / estimate_every, rounded up]; the published one in the weak form */
    uint32_t estimate_every;
} pvid_record_q31;

/* Steps an initialised estimator through rows n[ticks][n_theta], y[ticks], a group each. */
void pvid_replay_rows_q31(pvid_estimator_q31 *self, uint32_t ticks, const int32_t n[], const int32_t y[],
                          const pvid_record_q31 *record);

#endif
