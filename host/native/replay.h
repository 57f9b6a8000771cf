/* What pvid.core.native calls besides the core itself. */
#ifndef PVID_REPLAY_H
#define PVID_REPLAY_H

#include <stdint.h>

#include "pvid/pvid.h"

/* Where a replay writes; NULL: not recorded. Rows stand one after the other, without padding. */
typedef struct {
    float *p;                    /* [ticks][n_p] */
    float *published;            /* [ticks][n_p] of the weak form */
    float *published_se;         /* likewise: its standard errors */
    uint32_t *standing;          /* [ticks] of it: age + 2^16 state + 2^24 causes */
    float *sums;                 /* [ticks][n_moments + n_theta + 2] */
    uint8_t *reason;             /* [ticks] */
    uint32_t *hash;              /* [ticks] running hash after the tick */
    uint32_t *running_hash;      /* in and out; needed with hash */
    pvid_estimate_f32 *estimate; /* [ticks / estimate_every, rounded up] */
    uint32_t estimate_every;
} pvid_record_f32;

/* Compiler and flags this library was built with. */
const char *pvid_native_build(void);

/* Steps an initialised estimator through given rows n[ticks][n_theta], y[ticks]. */
void pvid_replay_rows_f32(pvid_estimator_f32 *self, uint32_t ticks, const float n[], const float y[],
                          const pvid_record_f32 *record);

#endif
