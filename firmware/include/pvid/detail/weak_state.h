/* pvid/detail/weak_state.h - the state behind weak.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_WEAK_STATE_H
#define PVID_DETAIL_WEAK_STATE_H

#include "pvid/detail/weak_job.h"
#include "pvid/weak.h"

/* The front end: a ring of samples, and the FIR job of the last complete block in slices. */
typedef struct {
    pvid_weak_job job;
    const float *smooth;
    const float *second;
    float u_scale;                                          /* sample rate^2 / l1 [1/(m s^2)] */
    float middle[2];                                        /* centre samples of phi and y */
    float sum[2];                                           /* sum smooth q(phi), sum second q(y) */
    float ring[PVID_MAX_TAPS + PVID_MAX_DECIMATION - 1][2]; /* phi [rad], y [m] */
} pvid_weak_front_f32;

/* Signals that are integrated twice from a window's start: u phi, phi and u. */
#define PVID_WEAK_INTEGRALS 3

/* Sums of a window for each test function: eight with chi'', four with chi, one with chi''''. Their order is in
 * src/weak/window_f32.h. */
#define PVID_WEAK_TERMS 13

/* Products of a sample that these sums contain. */
#define PVID_WEAK_SAMPLE_TERMS 8

/* One of the two windows. */
typedef struct {
    uint16_t index;                    /* of the present decimated sample in the window, 0..W-2 */
    bool whole;                        /* the window has been filling from its first sample */
    uint8_t buffer;                    /* index in pvid_weak_f32.sums of the sums that the window fills */
    float before[PVID_WEAK_INTEGRALS]; /* the integrands at the last sample */
    float once[PVID_WEAK_INTEGRALS];   /* their integrals */
    float twice[PVID_WEAK_INTEGRALS];  /* their double integrals */
    float u_sum;                       /* of the window's samples so far */
    float u_square_sum;
    float phi_sum;
    float lowest; /* phi */
    float highest;
    float curvature_square_sum; /* sum of the squared second differences of phi */
    uint16_t curvatures;        /* number of second differences in this sum */
} pvid_weak_window_f32;

/* Second differences phi(t) - 2 phi(t - lag) + phi(t - 2 lag), one every `lag` decimated samples. */
typedef struct {
    uint8_t wait;    /* decimated samples until the next second difference */
    uint8_t known;   /* samples in `before`, 0..2 */
    bool due;        /* the present sample completes a second difference */
    float before[2]; /* phi one lag and two lags ago */
    float square;    /* the squared second difference; valid if due */
} pvid_weak_curvature_f32;

#define PVID_WEAK_FACTOR ((PVID_MAX_FUNCTIONS * (PVID_MAX_FUNCTIONS + 1)) / 2)

/* Columns of a row. They replace the 13 sums of its function in place: N1..N8, Y, the regressors of the window's
 * unknowns a and b (theory.md 5), and those of friction. */
#define PVID_WEAK_COLUMNS 13
enum {
    PVID_WEAK_COLUMN_N = 0,
    PVID_WEAK_COLUMN_Y = 8,
    PVID_WEAK_COLUMN_A = 9,
    PVID_WEAK_COLUMN_B = 10,
    PVID_WEAK_COLUMN_C1 = 11,
    PVID_WEAK_COLUMN_C2 = 12
};

typedef struct {
    bool whitened;                  /* the Gram matrix could be factored */
    float combination[5];           /* factors of the Gram tables in R0, without the first, 1 */
    float trace[PVID_NOISE_TRACES]; /* argument of the model's `noise`: see src/weak/whiten_f32.h */
    float factor[PVID_WEAK_FACTOR]; /* R0, the covariance of the rows; then its Cholesky factor with inverted
                                       diagonal */
} pvid_weak_whiten_f32;

/* Processing of a complete window: rows, then steps of p, then the assessment. */
typedef struct {
    uint8_t stage;
    uint16_t index;     /* of the function within the stage */
    uint8_t iteration;  /* solves done for this window */
    uint8_t buffer;     /* index in pvid_weak_f32.sums of the window's sums */
    pvid_reason reason; /* of the last solve, then of the window */
    float size;         /* of the last step, relative */
    float expected;     /* variance of a row by the sensors' noise */
    float rss;          /* sum of e^2 of the window's rows before its steps; only if the gate is enabled */
    pvid_gate_f32 gate;
    pvid_weak_angle_f32 *angle;          /* NULL: linear rows */
    float direction[PVID_MAX_FUNCTIONS]; /* unit vector that is projected out, first a, then b; or 0 */
    float along[PVID_WEAK_COLUMNS];      /* components of the columns along it */
    pvid_weak_whiten_f32 whiten;
    pvid_estimator_solve_f32 solve;
    pvid_estimate_f32 candidate; /* the assessed estimate, published if it is trusted */
} pvid_weak_finish_f32;

/* Only the functions of weak.h write to it. */
struct pvid_weak_f32 {
    const pvid_weak_design_f32 *design;
    pvid_weak_angle_f32 *angle; /* NULL: linear rows */
    float dt;                   /* between decimated samples [s] */
    float drive_min;            /* variance of u below which a window is dropped [1/s^4] */
    float row_variance;         /* variance of a row by the encoder's noise [rad^2] */
    float pivot_noise;          /* variance of a row by the pivot sensor's noise, per mean square second difference */
    float angle_limit;          /* [rad]; 0: none */
    uint8_t iterations;
    uint8_t functions_per_tick; /* functions of a window to which a tick adds the present decimated sample */
    uint8_t stages_per_tick;    /* stages of a complete window per tick */
    uint8_t active;             /* window to which the present decimated sample is being added; 2: both are done */
    uint8_t function;           /* functions of that window that are done, 0..K-1 */
    bool warm;                  /* a window has been completed since the restart */
    bool frozen;                /* complete windows are dropped */
    float phi;                  /* the present decimated sample [rad] */
    float u;                    /* y_A''/l1 at its instant [1/s^2] */
    pvid_weak_front_f32 front;
    pvid_weak_curvature_f32 curvature;
    pvid_weak_window_f32 window[2];
    pvid_weak_finish_f32 finish;
    float term[2][2][PVID_WEAK_SAMPLE_TERMS];           /* [window][index % 2]: terms of its last two samples */
    float sums[3][PVID_MAX_FUNCTIONS][PVID_WEAK_TERMS]; /* of the two windows and of `finish`, by their `buffer` */
    pvid_estimator_f32 estimator;
    pvid_trust_f32 trust;
};

#endif
