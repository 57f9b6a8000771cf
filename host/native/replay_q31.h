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
    pvid_estimate_q31 *estimate; /* [ticks / estimate_every, rounded up]; the published one in the weak form */
    uint32_t estimate_every;
} pvid_record_q31;

/* Steps an initialised identifier through a run of counts. */

void pvid_replay_strong_q31(pvid_strong_q31 *self, uint32_t ticks, const int32_t phi[], const int32_t y[],
                            const pvid_record_q31 *record);

/* Steps an initialised estimator through rows n[ticks][n_theta], y[ticks], a group each. */
void pvid_replay_rows_q31(pvid_estimator_q31 *self, uint32_t ticks, const int32_t n[], const int32_t y[],
                          const pvid_record_q31 *record);

/* Derivatives of counts within full scale after every tick: d_phi[ticks][5], d_y[ticks][3], ready[ticks]. */
void pvid_replay_derivatives_q31(pvid_differentiator_q31 *self, uint32_t ticks, const int32_t phi[], const int32_t y[],
                                 int32_t d_phi[], int32_t d_y[], uint8_t ready[]);

/* Rows[ticks] of the strong form from phi[ticks][5] and u[ticks][3], and whether they fit[ticks]. */
void pvid_replay_strong_rows_q31(const pvid_strong_row_q31 *format, uint32_t ticks, const int32_t phi[],
                                 const int32_t u[], int32_t rows[], uint8_t fits[]);

/* Steps an initialised estimator of the strong form through rows[ticks]. */
void pvid_replay_kapitza_rows_q31(pvid_kapitza_estimator_q31 *self, uint32_t ticks, const int32_t rows[],
                                  const pvid_record_q31 *record);

#endif
