/* pvid/detail/weak_state_q31.h - the state behind weak_q31.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_WEAK_STATE_Q31_H
#define PVID_DETAIL_WEAK_STATE_Q31_H

#include "pvid/detail/weak_job.h"
#include "pvid/weak_q31.h"

#define PVID_WEAK_COLUMNS_Q31 12 /* N1..N8, Y, a, b and one that stays 0 */

/* The front end: a ring of counts, and the FIR job of the last complete block in slices. */
typedef struct {
    pvid_weak_job job;
    int32_t middle[2];
    int64_t sum[2];
    int32_t ring[PVID_MAX_TAPS + PVID_MAX_DECIMATION - 1][2]; /* phi, y [counts about their offsets] */
} pvid_weak_front_q31;

/* One of the two windows. */
typedef struct {
    uint16_t index;                          /* of the present decimated sample in the window, 0..W-2 */
    bool whole;                              /* the window has been filling from its first sample */
    uint8_t buffer;                          /* index in pvid_weak_q31.sums of the sums that the window fills */
    int64_t before[PVID_WEAK_INTEGRALS_Q31]; /* the integrands at the last sample */
    int64_t once[PVID_WEAK_INTEGRALS_Q31];   /* twice their integrals */
    int64_t twice[PVID_WEAK_INTEGRALS_Q31];  /* four times the integrals of these */
    int64_t f_sum;
    int64_t u_sum;
    int64_t u_square_sum;
    int64_t curvature_square_sum; /* sum of the squared second differences of F */
    uint16_t curvatures;          /* number of second differences in this sum */
} pvid_weak_window_q31;

/* Second differences F(t) - 2 F(t - lag) + F(t - 2 lag), one every `lag` decimated samples. */
typedef struct {
    uint8_t wait;      /* decimated samples until the next second difference */
    uint8_t known;     /* samples in `before`, 0..2 */
    bool due;          /* the present sample completes a second difference */
    int32_t before[2]; /* F one lag and two lags ago */
    int64_t square;    /* the squared second difference; valid if due */
} pvid_weak_curvature_q31;

#define PVID_WEAK_FACTOR_Q31 ((PVID_MAX_FUNCTIONS * (PVID_MAX_FUNCTIONS + 1)) / 2)

/* Processing of a complete window: rows, then steps of p, then the assessment. */
typedef struct {
    uint8_t stage;
    uint8_t index; /* of the function within the stage */
    uint8_t iteration;
    uint8_t buffer;
    bool whitened;     /* the Gram matrix could be factored */
    bool saturated;    /* a column did not fit: no row of the window is used */
    int16_t gram_bits; /* format of the Gram matrix at p, even */
    int32_t combination[PVID_WEAK_GRAMS];
    int16_t exponent[PVID_MAX_FUNCTIONS];            /* of the rows of the Gram matrix */
    pvid_reciprocal_q31 inverse[PVID_MAX_FUNCTIONS]; /* of the factor's diagonal */
    int32_t factor[PVID_WEAK_FACTOR_Q31];            /* R0, then its Cholesky factor, Q30 */
    int32_t inverted[PVID_MAX_FUNCTIONS];            /* a row of the factor's inverse, Q15, then a block of it */
    int16_t inverted_exponent;
    pvid_scaled_q31 trace[PVID_NOISE_TRACES_Q31]; /* argument of the model's `noise`: see src/weak/whiten_f32.h */
    pvid_reciprocal_q31 length;                   /* of the column that is being projected out */
    int32_t direction[PVID_MAX_FUNCTIONS];        /* unit vector of this column, Q30; or 0 */
    int64_t along[PVID_WEAK_COLUMNS_Q31];         /* components of the columns along it, Q30 */
    pvid_reason reason;                           /* of the last solve, then of the window */
    int64_t size;                                 /* of the last step, relative, Q22 */
    int64_t rss; /* sum of e^2 of the window's rows: before they are added (only if the gate is enabled), then since */
    pvid_gate_q31 gate;
    pvid_scaled_q31 expected; /* variance of a row by the sensors' noise */
    int32_t fade_factor;      /* factor on the sums before this window's rows, Q31; 0: none */
    pvid_estimator_solve_q31 solve;
    pvid_estimate_q31 candidate; /* the assessed estimate, published if it is trusted */
} pvid_weak_finish_q31;

/* Only the functions of weak_q31.h write to it. */
struct pvid_weak_q31 {
    const pvid_weak_design_q31 *design;
    int32_t phi_offset;
    int32_t y_offset;
    int64_t drive_min; /* (W - 1)^2 times the variance of U below which a window is dropped */
    int8_t zero_bits;  /* format of c */
    bool zero_unknown;
    uint8_t iterations;
    uint8_t functions_per_tick; /* functions of a window to which a tick adds the present decimated sample */
    uint8_t stages_per_tick;    /* stages of a complete window per tick */
    uint8_t active;             /* window to which the present decimated sample is being added; 2: both are done */
    uint8_t function;           /* functions of that window that are done, 0..K-1 */
    bool warm;                  /* a window has been completed since the restart */
    bool frozen;                /* complete windows are dropped */
    int32_t f;                  /* the present decimated sample */
    int32_t u;
    pvid_scaled_q31 pivot_noise;
    pvid_weak_front_q31 front;
    pvid_weak_curvature_q31 curvature;
    pvid_weak_window_q31 window[2];
    pvid_weak_finish_q31 finish;
    int32_t term[PVID_WEAK_TERMS_Q31]; /* of the window in work */
    int32_t sums[3][PVID_MAX_FUNCTIONS][PVID_WEAK_TERMS_Q31];
    pvid_estimator_q31 estimator;
    pvid_trust_q31 trust;
};

#endif
