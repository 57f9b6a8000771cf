/* pvid/detail/refine_state.h - the state behind refine.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_REFINE_STATE_H
#define PVID_DETAIL_REFINE_STATE_H

#include "pvid/detail/publication_mark.h"
#include "pvid/refine.h"

#define PVID_REFINE_AB 7   /* order of the Adams-Bashforth formula */
#define PVID_REFINE_SUB 4  /* steps of the motion in a big step: of the columns and of a row of each output */
#define PVID_REFINE_PAST 6 /* of the differences of a signal's means */
#define PVID_REFINE_SIGNALS (PVID_REFINE_INPUTS + PVID_REFINE_OUTPUTS)
#if PVID_REFINE_INPUTS > 0
#define PVID_REFINE_ROOM_U PVID_REFINE_INPUTS
#define PVID_REFINE_IS_INPUT(i) ((i) < (size_t)PVID_REFINE_INPUTS)
#else
#define PVID_REFINE_ROOM_U 1 /* C has no array without elements */
#define PVID_REFINE_IS_INPUT(i) false
#endif
#define PVID_REFINE_COLUMNS (PVID_REFINE_STATES + PVID_REFINE_MOVING)                      /* that are integrated */
#define PVID_REFINE_STILL (PVID_REFINE_PARAMETERS - PVID_REFINE_MOVING - PVID_REFINE_SKEW) /* of the outputs alone */
#define PVID_REFINE_UNKNOWNS (PVID_REFINE_STATES + PVID_REFINE_PARAMETERS)                 /* of a block */
#define PVID_REFINE_WIDTH (PVID_REFINE_UNKNOWNS + 1)                                       /* and the residual */
#define PVID_REFINE_SUMS ((PVID_REFINE_WIDTH * (PVID_REFINE_WIDTH + 1)) / 2)
#define PVID_REFINE_TRIANGLE ((PVID_REFINE_PARAMETERS * (PVID_REFINE_PARAMETERS + 1)) / 2)
#if PVID_REFINE_OUTPUTS < 3
#define PVID_REFINE_ROWS 2 /* that are added to the sums together */
#else
#define PVID_REFINE_ROWS PVID_REFINE_OUTPUTS
#endif

/* The front end: means of blocks of samples, their droop undone, second derivatives; then the ring, in units of range /
 * 32767. The derivatives are behind by `half` entries. */
typedef struct {
    uint8_t wait;                        /* samples that the block needs yet */
    uint8_t means;                       /* since the restart, up to 2 */
    bool referred;                       /* there is a first sample */
    bool postponed;                      /* the end of the present period of `peak` */
    uint8_t sample[PVID_REFINE_SIGNALS]; /* places in the argument of step */
    bool derived[PVID_REFINE_SIGNALS];   /* of order 2 */
#if PVID_REFINE_RUNGE_KUTTA
    bool held_between[PVID_REFINE_ROOM_U]; /* held from tick to tick: an entry is the mean from it to the next one */
    bool flat;                             /* a step is one tick */
    bool between;                          /* the middle of a block is between two ticks */
    uint8_t middle;                        /* `wait` before the sample in the middle of a block, or before it */
    float ahead[PVID_REFINE_ROOM_U];       /* of held ones: the part of the sum before that middle */
#endif
    uint8_t behind;                         /* entries by which the slowest signal is behind */
    uint16_t place;                         /* of the newest entry of `line` */
    uint32_t next;                          /* entry of the ring that is written next */
    float share;                            /* 1 / ratio */
    float droop[PVID_REFINE_SIGNALS];       /* (1 - 1 / ratio^2) / 24; held (1 + 1 / ratio^2) / 24 */
    float to_counts[PVID_REFINE_SIGNALS];   /* 32767 / range, with the scale of the signal */
    float from_counts[PVID_REFINE_SIGNALS]; /* range / 32767 */
#if PVID_REFINE_INTEGRALS
    float half_tick[PVID_REFINE_ROOM_U]; /* [s]; 0: no integral is taken */
    float before[PVID_REFINE_ROOM_U];    /* the last sample */
    float integral[PVID_REFINE_ROOM_U];
#endif
#if PVID_REFINE_TURNING
    float turn[PVID_REFINE_OUTPUTS]; /* 65536 counts of a turning output, else 0 */
#endif
    float sum[PVID_REFINE_SIGNALS];                      /* of the block */
    float rest[PVID_REFINE_SIGNALS];                     /* what rounding left of the last entry [counts] */
    float reference[PVID_REFINE_ROOM_U];                 /* the first sample since the restart */
    float held[PVID_REFINE_ROOM_U];                      /* the last sample of the block before, less the reference */
    float past[PVID_REFINE_SIGNALS][PVID_REFINE_PAST];   /* the last mean, its differences of orders 1 to 4, the
                                                            fourth difference before */
    float peak[PVID_REFINE_SIGNALS];                     /* largest fourth difference of the present period */
    float usual[PVID_REFINE_SIGNALS];                    /* of the period before */
    float line[PVID_REFINE_ROOM_U][PVID_REFINE_LINE];    /* means of inputs of order 2, circular, twice */
    int16_t ring[PVID_REFINE_RING][PVID_REFINE_SIGNALS]; /* INT16_MIN: missing or beyond its range */
} pvid_refine_front_f32;

/* Sums of a pass, then of its solution; behind the end of a block its estimate. */
typedef union {
    float sum[PVID_REFINE_SUMS]; /* of the products of the rows' entries, upper triangle */
    pvid_refine_estimate_f32 candidate;
} pvid_refine_sums_f32;

/* One pass over one block: the motion from a start, the derivatives of the motion, and the sums of the rows. */
typedef struct {
    float h;    /* a step [s] */
    float gate; /* largest |residual| that is used */
#if PVID_REFINE_TURNING
    float turn[PVID_REFINE_OUTPUTS]; /* as of the front */
#endif
#if PVID_REFINE_OBSERVER
    float observer[PVID_REFINE_OUTPUTS * PVID_REFINE_STATES]; /* as configured */
#endif
#if PVID_REFINE_SKEW
    float skew[3];                   /* of the outputs on the inputs: s, s^2/2, s^3/(6 h) */
    float slip[PVID_REFINE_OUTPUTS]; /* dz/ds at the middle of the big step */
#endif
    float constants[PVID_REFINE_CONSTANTS];
    float state[PVID_REFINE_STATES];                           /* q, then v */
    float difference[PVID_REFINE_COORDINATES][PVID_REFINE_AB]; /* backward ones of the highest derivatives, from 0 */
    float column[PVID_REFINE_COLUMNS][PVID_REFINE_STATES];     /* d state / d (start, moving parameters) */
    float kick[PVID_REFINE_COORDINATES *
               (PVID_REFINE_STATES + PVID_REFINE_MOVING)]; /* K, D, B at the middle of the big step; then the change of
                                                              the columns by it */
#if PVID_REFINE_RUNGE_KUTTA
    float factor[PVID_REFINE_COORDINATES][PVID_REFINE_COORDINATES]; /* between the jobs of a kick */
    float part_s;                                                   /* h over the parts of the present step */
#if PVID_REFINE_SIGNS > 0
    float argument[PVID_REFINE_SIGNS]; /* of the signs, at the beginning of the step */
#endif
    uint16_t doubled;   /* by how much the factor's time is yet to grow */
    uint8_t some_parts; /* of a step */
    uint8_t fine_parts; /* of one in which a sign may change */
    uint8_t parts;      /* of the present one */
    uint8_t part;       /* of the step, that is next */
#endif
    float scratch[2][PVID_REFINE_STATES]; /* between the jobs of a step of Runge-Kutta */
    float slope[PVID_REFINE_COORDINATES]; /* likewise */
#if !PVID_REFINE_OUTPUT_LINEAR
    float output_column[PVID_REFINE_OUTPUTS *
                        (PVID_REFINE_STATES + PVID_REFINE_STILL)]; /* dz/dq, dz/dv, dz/dr at that middle */
#endif
    float last[PVID_REFINE_OUTPUTS];                /* residuals at the last step; NaN: missing */
    float mean[PVID_REFINE_OUTPUTS];                /* their sum over the big step, by trapezoids */
    float row[PVID_REFINE_ROWS][PVID_REFINE_WIDTH]; /* after the pass row[0] is the diagonal of the sums */
    pvid_refine_sums_f32 sums;
    uint8_t job;
    uint8_t at;     /* steps of the big step that are done */
    uint8_t rows;   /* in `row` */
    uint8_t starts; /* double steps that are still Runge-Kutta's */
    uint16_t step;  /* big steps that are done */
    uint16_t used;  /* rows in the sums but those of the gate */
} pvid_refine_pass_f32;

/* Between the jobs of a solution, beside the sums of the pass. */
typedef struct {
    float triangle[PVID_REFINE_TRIANGLE];
    float right[PVID_REFINE_PARAMETERS];
    float step[PVID_REFINE_PARAMETERS]; /* of r */
    float shift[PVID_REFINE_STATES];    /* of the block's start */
    float size;                         /* of the step before it is shortened [prior_sd] */
    float bend;                         /* likewise of its logarithms, on which the motion depends least linearly */
#if PVID_REFINE_SIGNS > 0
    float reduction; /* of the sum of squares, which the linearized step predicts */
#endif
    float residual; /* sum of squares of the block after its own fit */
    float clash;    /* what the block and the past cannot both have, squared */
    uint8_t job;
    uint8_t row;      /* of the block, that joins the triangle */
    uint8_t rotation; /* its next one */
    uint8_t halvings;
    uint32_t dropped; /* columns without information in a pass of this block: one bit each */
} pvid_refine_solve_f32;

/* Only the functions of refine.h write to it. */
struct pvid_refine_f32 {
    pvid_refine_config_f32 config;
    const float *shared; /* of trust.h; NULL: none */
    float h;             /* a step of the motion [s] */
    float fade;          /* forgetting of a full block, on the triangle */
    float kept;          /* part of the triangle behind the last block that was taken, beside forgetting */
    float weight[PVID_REFINE_OUTPUTS]; /* of the rows of an output, relative to the first one */
    bool renewed;                      /* the weak form has given an estimate since the search began from one */
    bool frozen;
    bool solved;         /* the last solution exists */
    bool restarted;      /* the block's start is not known from the one before */
    bool busy;           /* the weak form was at the last tick that could have had jobs */
    bool plain;          /* the next tick has a sample alone */
    bool waiting;        /* the next job needs an entry of the ring that is not there */
    bool sane;           /* the block */
    bool again;          /* the block begins before the end of the last one */
    bool same_start;     /* where that one began */
    pvid_reason verdict; /* on the block */
    pvid_reason told;    /* of the last block that ended */
    uint8_t phase;
    uint8_t rested;                       /* ticks without jobs that the weak form was busy at, in a row */
    uint8_t pass;                         /* of the block */
    uint8_t taken;                        /* blocks in a row since the search began or the past was given up, up to 2 */
    uint8_t refused;                      /* in a row */
    uint8_t lost;                         /* in the search */
    uint16_t length;                      /* of the block in big steps */
    uint32_t begin;                       /* entry of the ring */
    uint32_t origin;                      /* the first one that a longer block may begin with */
    uint32_t due;                         /* end of the ring at which it is there */
    float level;                          /* mean square of residuals of the last blocks over the sensors' */
    float clash;                          /* mean square of what the last blocks and their past cannot both have */
    float scatter;                        /* the same of all blocks, weighted by what they add to the information */
    float r[PVID_REFINE_PARAMETERS];      /* of the last block that was taken, or the weak form's */
    float next[PVID_REFINE_PARAMETERS];   /* where the next block starts its linearisation */
    float linear[PVID_REFINE_PARAMETERS]; /* point of linearisation */
    float weak[PVID_REFINE_PARAMETERS];   /* newest estimate of the weak form */
    float weak_se[PVID_REFINE_P];
    float triangle[PVID_REFINE_TRIANGLE]; /* square root of the information of the steps of r, in residuals */
#if PVID_REFINE_SIGNS == 0
    float diagonal[PVID_REFINE_PARAMETERS]; /* of solve.triangle after the block's first pass */
#endif
    float start[PVID_REFINE_STATES];    /* of the pass */
    float expected[PVID_REFINE_STATES]; /* start of the block, from the one before */
    pvid_refine_front_f32 front;
    pvid_refine_pass_f32 work;
    pvid_refine_solve_f32 solve;
    uint32_t published;         /* estimates so far */
    pvid_publication_mark mark; /* with 0 while there is none */
    pvid_refine_estimate_f32 estimate;
    pvid_refine_estimate_f32 copy;
};

#endif
