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

/* What is integrated twice from a window's start: u phi, phi and u. */
#define PVID_WEAK_INTEGRALS 3

/* What a window gathers for each test function: eight sums with chi'', four with chi, one with chi''''. */
#define PVID_WEAK_TERMS 13

/* Terms of a sample in these sums. */
#define PVID_WEAK_SAMPLE_TERMS 8

/* One of the two windows. */
typedef struct {
    uint16_t index;                    /* of the present decimated sample in the window, 0..W-2 */
    bool whole;                        /* the window has been filling from its first sample */
    uint8_t buffer;                    /* which of the three it fills */
    float before[PVID_WEAK_INTEGRALS]; /* the integrands at the last sample */
    float once[PVID_WEAK_INTEGRALS];   /* their integrals */
    float twice[PVID_WEAK_INTEGRALS];  /* the integrals of these */
    float u_sum;                       /* of the window's samples */
    float u_square_sum;
    float phi_sum;
    float lowest; /* phi */
    float highest;
    float curvature_square_sum; /* of the second differences of phi that fell into the window */
    uint16_t curvatures;        /* how many did */
} pvid_weak_window_f32;

/* Second differences phi(t) - 2 phi(t - lag) + phi(t - 2 lag), one every `lag` decimated samples. */
typedef struct {
    uint8_t wait;    /* samples until the next */
    uint8_t known;   /* samples in `before`, 0..2 */
    bool due;        /* the present sample ends one */
    float before[2]; /* phi one lag and two lags ago */
    float square;    /* of the one that is due */
} pvid_weak_curvature_f32;

#define PVID_WEAK_FACTOR ((PVID_MAX_FUNCTIONS * (PVID_MAX_FUNCTIONS + 1)) / 2)

/* Columns of a row once it is assembled, in the place of its terms: N1..N8, Y, a, b, and friction. */
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
    float combination[5];           /* of the Gram tables but the first */
    float trace[PVID_NOISE_TRACES]; /* noise in the columns, a row of unit noise variance */
    float factor[PVID_WEAK_FACTOR]; /* R0, then its Cholesky factor with inverted diagonal */
} pvid_weak_whiten_f32;

/* The complete window that is being turned into rows and steps. */
typedef struct {
    uint8_t stage;
    uint16_t index; /* of the function, or of its part, within the stage */
    uint8_t iteration;
    uint8_t buffer;
    pvid_reason reason; /* of the last solve, then of the window */
    float size;         /* of the last step, relative */
    float expected;     /* variance of a row's noise */
    float energy;       /* of the window's rows at the p that they meet, where the gate looks at it */
    pvid_gate_f32 gate;
    pvid_weak_angle_f32 *angle;          /* NULL: linear rows */
    float direction[PVID_MAX_FUNCTIONS]; /* the one that is being projected out, of length 1 or 0 */
    float along[PVID_WEAK_COLUMNS];      /* the columns' components along it */
    pvid_weak_whiten_f32 whiten;
    pvid_estimator_solve_f32 solve;
    pvid_estimate_f32 candidate; /* for publication */
} pvid_weak_finish_f32;

/* Only the functions of weak.h write to it. */
struct pvid_weak_f32 {
    const pvid_weak_design_f32 *design;
    pvid_weak_angle_f32 *angle; /* NULL: linear rows */
    float dt;                   /* between decimated samples [s] */
    float drive_min;            /* variance of u below which a window is dropped [1/s^4] */
    float row_variance;         /* that the encoder's noise gives a row [rad^2] */
    float pivot_noise;          /* that the pivot's gives it, for each mean square of a second difference */
    float angle_limit;          /* [rad]; 0: none */
    uint8_t iterations;
    uint8_t functions_per_tick; /* functions a tick */
    uint8_t stages_per_tick;    /* stages of a complete window a tick */
    uint8_t active;             /* the window that takes the present decimated sample in; 2: both have */
    uint8_t function;           /* functions of that window that have, 0..K-1 */
    bool warm;                  /* a window has been completed since the restart */
    bool frozen;                /* windows are gathered and dropped */
    float phi;                  /* the present decimated sample [rad] */
    float u;                    /* [1/s^2] */
    pvid_weak_front_f32 front;
    pvid_weak_curvature_f32 curvature;
    pvid_weak_window_f32 window[2];
    pvid_weak_finish_f32 finish;
    float term[2][2][PVID_WEAK_SAMPLE_TERMS]; /* of each window: of its last even and of its last odd sample */
    float sums[3][PVID_MAX_FUNCTIONS][PVID_WEAK_TERMS];
    pvid_estimator_f32 estimator;
    pvid_trust_f32 trust;
};

#endif
