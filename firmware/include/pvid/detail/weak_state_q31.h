/* pvid/detail/weak_state_q31.h - the state behind weak_q31.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_WEAK_STATE_Q31_H
#define PVID_DETAIL_WEAK_STATE_Q31_H

#include "pvid/detail/weak_counts.h"
#include "pvid/weak_q31.h"

/* Steps that are added to the sums together. */
#define PVID_WEAK_BLOCK_Q31 4

/* The front end: the block sums of the signals, and their outputs at the last steps. */
typedef struct {
    bool plain;    /* signal i is sample i */
    bool seen;     /* a sample since the restart */
    uint8_t needs; /* samples beside those of a tick */
    uint8_t signals;
    uint8_t decimation;                  /* D */
    uint16_t half;                       /* of the longest compensator */
    uint16_t missing;                    /* outputs until there is a step, this one included */
    uint16_t head;                       /* place of the next output */
    uint32_t wait;                       /* ticks until the block ends */
    const int32_t *offset;               /* of the configuration */
    int32_t line[PVID_MAX_RING];         /* [signals][2] sums, [signals] of the block before, 2 [2 half + 1][signals] */
    int32_t before[3][PVID_MAX_SAMPLES]; /* counts of the last three ticks, latest first */
} pvid_weak_front_q31;

/* From the jets of a step to the channels of the second one before it. */
typedef struct {
    int64_t run[PVID_WEAK_RUNS];       /* twice the sum of the derivatives of the runs up to `now`, by trapezoids */
    uint16_t index;                    /* of the step whose channels come next, in its half */
    uint16_t lead;                     /* ticks from the first sample to the first step */
    uint8_t known;                     /* steps since the restart, 0..4 */
    uint8_t half;                      /* that fills, 0 or 1 */
    bool ran;                          /* there was a step: the runs have begun */
    int32_t now[PVID_MAX_INPUTS];      /* inputs of `values` at the step before the newest; runs and signs last */
    int32_t rate[PVID_WEAK_RUNS];      /* derivatives of the runs there */
    int32_t v[2][PVID_WEAK_SIGNS];     /* arguments of sgn there and at the step before */
    int32_t gain[PVID_WEAK_GAINS];     /* at the step before that */
    int32_t f[3][PVID_MAX_INTEGRANDS]; /* integrands there and at the two steps before it, latest first */
    int32_t once[PVID_MAX_INTEGRANDS]; /* integrals since the start of the half [dt/24], [dt^2/48] */
    int32_t twice[PVID_MAX_INTEGRANDS];
    int32_t owed[PVID_MAX_INTEGRANDS]; /* what the shifts of the integrands took away and the next step gets back */
    int32_t edge[2][2][PVID_MAX_INTEGRANDS]; /* of each half: once and twice at its end */
} pvid_weak_values_q31;

/* A channel at a step. A core without a long multiplication takes it in halves, which it loads without a shift: the
 * value is (high - 2^14) 2^14 + low. */
#if defined(__ARM_ARCH_6M__)
#define PVID_WEAK_ENTRY_BITS_Q31 14u
typedef struct {
    uint16_t low;
    uint16_t high;
} pvid_weak_entry_q31;
#else
typedef int32_t pvid_weak_entry_q31;
#endif

/* The sums of the two halves of a window, and the block of steps that is being added to them. */
typedef struct {
    uint8_t filling; /* block that fills */
    uint8_t left;    /* items until the other one is added and joined; 0: it is */
    uint8_t item;    /* the next one */
    uint8_t target;  /* half to which it is added */
    bool joins;      /* it completes a window */
    uint8_t halves;  /* complete since the restart, 0..2 */
    uint16_t start;  /* of its first step in its half */
    uint16_t angle;  /* of the next harmonic at this step */
    pvid_weak_entry_q31 block[PVID_MAX_BLOCKS][PVID_MAX_CHANNELS][PVID_WEAK_BLOCK_Q31];
    int32_t sum[2][PVID_MAX_HARMONICS][PVID_MAX_CHANNELS][2]; /* A_h and B_h, real and imaginary part */
} pvid_weak_sums_q31;

/* S_h of a window, real and imaginary part. */
typedef struct {
    uint8_t half;                                          /* the older one */
    uint8_t length[PVID_MAX_HARMONICS][PVID_MAX_CHANNELS]; /* bits of the larger part */
#if PVID_MAX_WINDOWS > 0
    int32_t s[PVID_MAX_HARMONICS][PVID_MAX_CHANNELS][2]; /* else in the place of the older half's sums */
#endif
} pvid_weak_window_q31;

/* Most parts of the sums of a window: K + n. */
#define PVID_WEAK_ROWS_Q31 (PVID_MAX_FUNCTIONS + PVID_MAX_POWER)

/* The noise of a kind's sums, and the reflections that leave its white rows. */
typedef struct {
    uint8_t cosines;                                           /* real parts; the others are imaginary parts */
    uint8_t powers;                                            /* of h^2 in use */
    pvid_scaled_q31 scale[PVID_MAX_HARMONICS];                 /* D_h, then 1 / sqrt(D_h) */
    int32_t reflector[PVID_MAX_POWER / 2][PVID_WEAK_ROWS_Q31]; /* reflection k from the entry k of each family, Q30 */
} pvid_weak_white_q31;

/* White columns of a kind: theta's, Y, nuisances. A value is its integer times 2^exponent standard deviations. */
typedef struct {
    int32_t exponent[PVID_MAX_COLUMNS];
    int32_t x[PVID_MAX_COLUMNS][PVID_WEAK_ROWS_Q31];
} pvid_weak_columns_q31;

/* From counts to the S_h of windows. */
typedef struct {
    const pvid_weak_design_q31 *design;
    pvid_weak_front_q31 front;
    pvid_weak_values_q31 values;
    pvid_weak_sums_q31 sums;
    pvid_weak_window_q31 window;
    uint8_t items_per_tick; /* harmonics that a tick adds or joins */
} pvid_weak_accumulator_q31;

/* Sums of each sample over the steps of the half that fills [counts], if it has a least deviation. */
typedef struct {
    bool still[2]; /* of each half: a sample moved too little */
    int64_t sum[PVID_MAX_SAMPLES];
    int64_t square[PVID_MAX_SAMPLES];
} pvid_weak_drive_q31;

/* While the noise of a kind's rows is computed anew, before and behind its columns. */
typedef struct {
    int32_t u[PVID_WEAK_ROWS_Q31];                /* a direction that the test functions leave out, Q26 */
    int32_t leverage[PVID_WEAK_ROWS_Q31];         /* sum of the squares of all of them, Q30 */
    pvid_scaled_q31 weight[PVID_MAX_POWER];       /* c_j, variance at the power j of h^2 */
    pvid_scaled_q31 share[PVID_MAX_POWER];        /* Q_j */
    pvid_scaled_q31 of_theta[PVID_MAX_THETA_Q31]; /* theta of the kind */
    int32_t c[PVID_MAX_C_Q31];                    /* C at p: C_k = c_k 2^f_column */
    int16_t f[PVID_MAX_P];
} pvid_weak_noise_work_q31;

/* Each begins where the other one has ended.
 * MISRA deviation: 19.2; as of pvid_weak_work_q31. */
typedef union {
    pvid_weak_noise_work_q31 noise;
    pvid_weak_columns_q31 columns;
} pvid_weak_parts_q31;

/* The rows of a kind while they are made. */
typedef struct {
    pvid_scaled_q31 least;            /* D_h */
    uint64_t whole[PVID_MAX_COLUMNS]; /* square of each nuisance before those before it are off */
    pvid_weak_parts_q31 parts;
} pvid_weak_rows_q31;

/* The rows of all kinds are in the estimator before the solves begin: they use the same memory.
 * MISRA deviation: 19.2; what a stage reads, a stage of the same part has written. */
typedef union {
    pvid_weak_rows_q31 rows;
    pvid_estimator_solve_q31 solve;
} pvid_weak_work_q31;

/* What the sensors' noise does to the rows, at the p of one of the last windows. */
typedef struct {
    bool used;                 /* anything needs it */
    bool renewed;              /* it and the reflections are, in the present window */
    uint8_t age;               /* windows since they were computed */
    bool compensates;          /* `pull` is added to b */
    pvid_scaled_q31 sensors;   /* part of the rows' variance that the sensors explain, summed over kinds */
    pvid_scaled_q31 explained; /* that they and the design's errors of the equations explain, likewise */
    pvid_scaled_q31 pull[PVID_MAX_THETA_Q31]; /* what it takes from b in a window, in units of b */
} pvid_weak_known_q31;

/* Products of two parameters. */
#define PVID_WEAK_PAIRS_Q31 ((PVID_MAX_P * (PVID_MAX_P + 1)) / 2)

/* Mean products of two scores: of one window, and of neighbours both ways. */
typedef struct {
    int32_t same;
    int32_t neighbour;
} pvid_weak_pair_q31;

/* The scores C^T (sum N e) of windows, or of all windows between two solves: that of p[a] is an integer within 2^13
 * times 2^unit[a]. */
typedef struct {
    uint16_t windows; /* in the means */
    bool known;       /* the window before has a score */
    int16_t unit[PVID_MAX_P];
    int16_t before[PVID_MAX_P];
    int32_t residual;                             /* mean of their variance ratios, Q12 */
    pvid_weak_pair_q31 pair[PVID_WEAK_PAIRS_Q31]; /* upper triangle, row by row */
} pvid_weak_scores_q31;

/* Variance of an equation's own error. */
typedef struct {
    pvid_scaled_q31 variance; /* in use, of h^(2 order) at a step */
    int32_t mean;             /* mean square of the white rows of the last windows, Q8 */
    uint8_t windows;          /* in the mean */
} pvid_weak_error_q31;

/* Processing of a whole window: rows of each kind, then steps of p, then the assessment. */
typedef struct {
    uint8_t stage;
    uint8_t kind;
    uint8_t theta;            /* first one of the kind */
    uint8_t used;             /* kinds whose rows have been added */
    uint8_t live;             /* nuisances of the kind that are projected out */
    uint8_t iteration;        /* solves done for this window */
    uint8_t part;             /* of a column's stages */
    uint8_t exponent;         /* of the sums before the solves */
    bool kept;                /* the present nuisance is */
    bool saturated;           /* a row of the kind does not fit: none of them is used */
    bool rejected;            /* by the gate: no row of the kind is used */
    bool no_predecessor;      /* the next window has no neighbour before it */
    uint16_t index;           /* within the stage */
    uint16_t free;            /* rows less nuisances of the kinds that were added */
    pvid_reason reason;       /* of the last solve, then of the window */
    int64_t size;             /* of the last step, relative, Q22 */
    int64_t rss;              /* of the kind's rows before the steps; from MEAN on the window's variance ratio */
    int32_t fade_factor;      /* factor on the sums before this window's rows, Q31; 0: none */
    int32_t left;             /* of the older rows' information, behind this window, Q31: pvid_weak_error_change_q31 */
    pvid_scaled_q31 expected; /* variance of a row */
    int8_t n_bits[PVID_MAX_THETA_Q31]; /* formats of the rows */
    int8_t y_bits;
    pvid_gate_q31 gate[PVID_MAX_KINDS];
    pvid_weak_known_q31 known;
    pvid_weak_white_q31 white[PVID_MAX_KINDS]; /* at the p of one of the last windows */
    pvid_weak_scores_q31 scores;
    pvid_weak_error_q31 error[PVID_MAX_KINDS];
    pvid_weak_work_q31 work;
} pvid_weak_finish_q31;

/* Only the functions of weak_q31.h write to it. */
struct pvid_weak_q31 {
    const pvid_weak_design_q31 *design;
    const int32_t *drive_min;
    uint8_t task;  /* reason of a tick that ends no step and has no work; 255: there is work */
    uint8_t plain; /* samples, if each is a signal; else 0 */
    uint8_t iterations;
    uint8_t stages_per_tick; /* stages of a whole window per tick */
    uint8_t pace;            /* the `wait` of such a tick is a multiple of 2^pace */
    bool warm;               /* a window has been complete since the restart */
    bool frozen;             /* complete windows are dropped */
    uint32_t ticks;          /* since the publication, less those of the windows in its age */
    pvid_weak_drive_q31 drive;
    pvid_weak_accumulator_q31 accumulator;
    pvid_weak_finish_q31 finish;
    pvid_estimator_q31 estimator;
    pvid_trust_q31 trust;
};

#endif
