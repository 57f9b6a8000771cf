/* pvid/detail/weak_state.h - the state behind weak.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_WEAK_STATE_H
#define PVID_DETAIL_WEAK_STATE_H

#include "pvid/detail/weak_counts.h"
#include "pvid/weak.h"

/* Steps that are added to the sums together. */
#define PVID_WEAK_BLOCK 8u

/* The front end: block sums of the signals, and their outputs at the last steps. */
typedef struct {
    uint32_t wait;   /* ticks until the block is complete */
    uint8_t signals; /* of the model */
    bool plain;      /* signal i is sample i */
    uint8_t needs;   /* samples of other ticks that the signals need; with the next one all signals are those of the
                        tick before */
    bool seen;       /* there is a sample since the restart, and `before` contains it */
    uint8_t decimation;
    uint16_t half;                    /* of the longest compensator [steps] */
    uint16_t missing;                 /* outputs until the line is full, at least 1 */
    uint16_t head;                    /* place of the next outputs */
    float ticks;                      /* D */
    float scale;                      /* 1 / D^2 */
    float jump_scale;                 /* dt/12, dt the tick [s] */
    uint32_t limit[PVID_MAX_SAMPLES]; /* largest absolute value of each sample that needs no attention: its bits,
                                         shifted left by one, plus 1 */
#if !PVID_EXACT_PLAIN
    float before[3][PVID_MAX_SAMPLES]; /* samples of the last three ticks, latest first, if they are needed */
#endif
    float line[PVID_MAX_RING]; /* a and b of each signal; D a - b of the block before; outputs [2 half + 1][signals],
                                  twice */
} pvid_weak_front_f32;

/* From the jets of a step to the values of its channels, two steps later. */
typedef struct {
    uint8_t known;  /* steps since the restart, 0..4 */
    uint8_t latest; /* place in `out` of the step before the last one */
    bool ran;       /* the runs have begun */
    float lead;     /* from a run's first sample to its first step [s] */
    uint8_t newest; /* place in `inputs` of the newest step; the other is of the last step before it */
    float inputs[2][PVID_MAX_INPUTS]; /* of `values` */
    float rate[PVID_WEAK_RUNS];       /* derivatives of the runs there */
    float v[2][PVID_WEAK_SIGNS];      /* arguments of sgn at that step and the one before it */
    uint16_t doubts;                  /* steps of the half so far in which a sign is in doubt */
    float run[PVID_WEAK_RUNS];        /* integrals since the start of the run, and what rounding took off */
    float run_low[PVID_WEAK_RUNS];
    float out[2][PVID_WEAK_VALUES];          /* results of `values` at the step before that, and place for
                                                                       the next ones */
    float f[2][PVID_MAX_INTEGRANDS];         /* integrands at the two steps before that one, latest first */
    float integral[2 * PVID_MAX_INTEGRANDS]; /* I^1 and I^2 of each since the start of the half */
    float edge[2][PVID_MAX_INTEGRANDS];      /* I^1 and I^2 of the half before, at its end */
} pvid_weak_history_f32;

/* A sample in the half window that fills. */
typedef struct {
    float reference; /* the half's first sample */
    float sum;       /* of the samples less that, one a step */
    float square;    /* of their squares */
} pvid_weak_spread_f32;

/* Whether a window is to be used. */
typedef struct {
    const float *range; /* of the configuration; NULL: no check */
    const float *drive_min;
    uint32_t moves;                                /* bit i set: sample i has a least deviation */
    uint16_t delay;                                /* steps from a sample to the last step that it is part of */
    uint16_t beyond;                               /* steps that may yet contain a sample beyond its range */
    bool out[2];                                   /* of each half: contains such a step */
    bool still[2];                                 /* of each half: a sample moved too little */
    bool doubt[2];                                 /* of each half: a sign was in doubt for too long */
    pvid_weak_spread_f32 spread[PVID_MAX_SAMPLES]; /* of samples with a least deviation */
} pvid_weak_limits_f32;

/* The sums of the two halves of a window, and the block of steps that is being added to them. */
typedef struct {
    uint8_t half;                       /* that fills, 0 or 1 */
    uint8_t halves;                     /* complete since the restart, 0..2 */
    uint8_t filling;                    /* block that fills */
    uint8_t target;                     /* half to which the other block is being added */
    uint8_t harmonic;                   /* next one to which it is added; all: none */
    uint8_t joined;                     /* next one to be joined; all: none */
    uint16_t index;                     /* of the next step in its half */
    uint16_t start;                     /* of the first step of that block in its half */
    float edge[2][PVID_MAX_INTEGRANDS]; /* I^1 and I^2 of the window's first half at its end */
    float block[PVID_MAX_BLOCKS][PVID_WEAK_BLOCK][PVID_MAX_CHANNELS]; /* steps, then their sums and differences:
                                                                           sums_f32.c */
    float sum[2][PVID_MAX_HARMONICS][PVID_MAX_CHANNELS][2];           /* A_h and B_h, real and imaginary part */
} pvid_weak_sums_f32;

/* The noise of a kind's rows: D_h, the directions that the test functions leave out, and what follows from the inverse.
 */
typedef struct {
    uint8_t powers;                  /* of omega^2 in use */
    float omega;                     /* 2 pi / T [rad/s] */
    float weight[PVID_MAX_POWER];    /* c_j of the sensors, variance at the power j of omega^2 */
    float floor;                     /* least D_h */
    float scale[PVID_MAX_HARMONICS]; /* D_h, then 1 / sqrt(D_h) */
    float reflection[PVID_MAX_POWER / 2][2][PVID_MAX_HARMONICS]; /* v of I - v v^T, of each family */
    float share[PVID_MAX_POWER];                                 /* Q_j = tr(R^-1 dR/dc_j) */
} pvid_weak_white_f32;

/* Products of two parameters. */
#define PVID_WEAK_PAIRS ((PVID_MAX_P * (PVID_MAX_P + 1)) / 2)

/* Mean products of the windows' scores s = C^T (sum N e), of a window with itself and with the one before. */
typedef struct {
    uint16_t windows; /* in the means */
    bool known;       /* the window before has a score */
    float memory;     /* windows in the means; 0: all */
    float residual;   /* mean square of their residuals */
    float own[PVID_MAX_P];
    float before[PVID_MAX_P];
    float same[PVID_WEAK_PAIRS]; /* upper triangle, row by row */
    float neighbour[PVID_WEAK_PAIRS];
} pvid_weak_scores_f32;

/* Variance of an equation's own error. */
typedef struct {
    float variance;  /* in use */
    float mean;      /* mean square of the white rows of the last windows */
    uint8_t windows; /* in the mean */
} pvid_weak_error_f32;

/* Orthonormal directions that the test functions leave out, of each family. */
typedef struct {
    float norm[2];                          /* of the present direction, before it was divided by it */
    float slope[2];                         /* mean of (h/H)^2 over its squares */
    float direction[2][PVID_MAX_HARMONICS]; /* the present one */
    float before[2][PVID_MAX_HARMONICS];
    float leverage[2][PVID_MAX_HARMONICS]; /* sum of the squares of all */
} pvid_weak_basis_f32;

/* C at p, and of a kind: one of its columns, and the covariance of the noise in N times that; of Y too. */
typedef struct {
    float c[PVID_MAX_C];
    float column[PVID_MAX_THETA + 1];
    float product[PVID_MAX_THETA + 1];
} pvid_weak_slopes_f32;

/* What the columns of a kind need before they are formed, one after the other, and they themselves. */
typedef union {
    pvid_weak_basis_f32 basis;
    pvid_weak_slopes_f32 slopes;
    float column[PVID_MAX_COLUMNS][PVID_MAX_FUNCTIONS]; /* white rows: theta's, Y and then e, nuisances */
} pvid_weak_columns_f32;

/* What the rows of a window need until the last of them is added. */
typedef struct {
    pvid_reason reason; /* of the solve, with its pointers: they keep their place (pvid/snapshot_weak.h) */
    const void *pointer[3];
#if PVID_MAX_WINDOWS > 0
    float window[PVID_MAX_HARMONICS][PVID_MAX_CHANNELS][2]; /* S_h: real and imaginary part */
#endif
    float own[PVID_MAX_COLUMNS];       /* square of each nuisance before projection, then inverse of what remains; then
                                          squares of theta's columns */
    float pull[PVID_MAX_THETA + 1];    /* g: what the sensors' noise takes from B; and place for Y's */
    float score[PVID_MAX_THETA];       /* sum N e + g of the window */
    float theta[PVID_MAX_THETA + 1];   /* of the kind, -1 for Y; then sum N e of the kind */
    float part[2][PVID_MAX_HARMONICS]; /* of the present column: real parts, imaginary parts */
    pvid_weak_columns_f32 of_kind;
} pvid_weak_rows_f32;

/* The rows of a window, and behind them the solve and the assessment. */
typedef union {
    pvid_weak_rows_f32 rows;
    pvid_estimator_solve_f32 solve;
} pvid_weak_work_f32;

/* Processing of a whole window: rows of each kind, then steps of p, then the assessment. */
typedef struct {
    bool compensation;
    bool no_predecessor; /* the next window has no neighbour before it */
    uint8_t stage;
    uint8_t kind;
    uint8_t theta;      /* first one of the kind */
    uint8_t used;       /* kinds whose rows have been added */
    uint8_t live;       /* nuisances of the kind that are projected out */
    uint8_t iteration;  /* solves done for this window */
    uint8_t verdict;    /* of trust.h on the candidate, a pvid_reason */
    uint8_t report;     /* reason of the tick, if a stage sets one; else PVID_ACCUMULATED */
    uint8_t other;      /* column of the next product */
    uint16_t index;     /* within the stage */
    uint16_t phase;     /* of a column's stages */
    uint16_t term;      /* next one of the kind */
    uint16_t moment;    /* next one of the kind */
    pvid_reason reason; /* of the last solve, then of the window */
    float size;         /* of the last step, relative */
    float rss;          /* of the kind's rows before the steps */
    float expected;     /* sum over the kinds of the rows' variance by the sensors alone */
    float explained;    /* likewise, by the design's errors of the equations too */
    float free;         /* rows less nuisances of the kinds that were added */
    float square;       /* sum of squares of their residuals before the steps */
    float left;         /* of the older rows' information, behind this window: pvid_weak_error_take_f32 */
    pvid_gate_f32 gate[PVID_MAX_KINDS];
    pvid_weak_error_f32 error[PVID_MAX_KINDS];
    pvid_weak_white_f32 white;
    pvid_weak_scores_f32 scores;
    pvid_weak_work_f32 work;
    pvid_estimate_f32 candidate; /* the assessed estimate, published if it is trusted */
} pvid_weak_finish_f32;

/* Only the functions of weak.h write to it. */
struct pvid_weak_f32 {
    const pvid_weak_design_f32 *design;
    const pvid_weak_refine_f32 *refine; /* second stage; NULL: none */
    uint8_t samples;                    /* of a tick; 0: `self` is not initialised */
    uint8_t task_after_step;            /* `task` behind the channels of a step */
    uint8_t task;                       /* of a tick that ends no step, weak_f32.c; or its reason if it has none */
    bool warm;                          /* a window has been complete since the restart */
    bool frozen;                        /* complete windows are dropped */
    bool busy;                          /* the last tick did more than to take its samples; with a second stage alone */
    bool has_limits;   /* samples are compared with their range, or their deviation with the least one */
    uint8_t harmonics; /* H + 1 */
    uint8_t channels;  /* that are summed */
    uint8_t iterations;
    uint8_t items_per_tick;  /* harmonics that a tick adds or joins */
    uint8_t stages_per_tick; /* stages of a whole window per tick */
    uint8_t pace;            /* the `wait` of such a tick is a multiple of 2^pace */
    uint32_t ticks;          /* since the publication, less those of the windows in its age */
    float dt;                /* between steps [s] */
    pvid_weak_front_f32 front;
    pvid_weak_history_f32 history;
    pvid_weak_limits_f32 limits;
    pvid_weak_sums_f32 sums;
    pvid_weak_finish_f32 finish;
    pvid_estimator_f32 estimator;
    pvid_trust_f32 trust;
};

#endif
