/* pvid/detail/strong_state.h - the state behind strong.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_STRONG_STATE_H
#define PVID_DETAIL_STRONG_STATE_H

#include "pvid/strong.h"

#define PVID_STRONG_SUMS 58 /* distinct entries of M, B, sum Y^2 and the weight */
#define PVID_STRONG_ROWS 4  /* rows of a block, the last of which is not kept */

/* Places in pvid_strong_row_f32.x. */
enum { PVID_ROW_A = 0, PVID_ROW_E = 1, PVID_ROW_Y = 2 };

/* A row of the strong form by its factors (theory.md 2). */
typedef struct {
    float x[3]; /* A = N_1, E = N_2 = -phi'''', Y */
    float f2;   /* -phi'' */
    float f0;   /* -phi */
    float u;
} pvid_strong_row_f32;

/* The sums at two levels (information.h); the value of a sum is high + low. */
typedef struct {
    float retention; /* factor on the past at a fold, in (0, 1]; 1 keeps everything */
    float high[PVID_STRONG_SUMS];
    float low[PVID_STRONG_SUMS];
} pvid_strong_sums_f32;

/* The estimator of the strong form: sums, parameters, the equations of the next step. */
struct pvid_strong_estimator_f32 {
    const pvid_strong_config_f32 *config; /* NULL before init has accepted one */
    float p[PVID_KAPITZA_P];
    float s[6];                  /* C^T M C at the last exact projection and the rows since, upper triangle */
    float force[PVID_KAPITZA_P]; /* with a divider above 1, from a projection to its solve: the right-hand side of the
                                    step; else, while gain < 1, sum C^T N e since the last projection */
    float prior[PVID_KAPITZA_P]; /* diagonal of H0 */
    float gain;                  /* g of a step with an exact projection */
    uint16_t phase;      /* rows since the last solve was due, or with divider 1 since the last exact projection */
    uint8_t exact_every; /* rows from one exact projection to the next, with divider 1 */
    uint8_t staged;      /* 1: projection, solve and fold at rows of their own; the projection at the first of them */
    uint8_t fold_every;  /* rows between folds */
    uint8_t age;         /* rows in the sums since the last fold */
    uint8_t in_block;    /* rows in `block` */
    bool mixes;          /* gain < 1 */
    pvid_counters counters;
    pvid_strong_row_f32 block[PVID_STRONG_ROWS - 1]; /* rows that are not in the sums yet */
    pvid_strong_sums_f32 sums;
};

/* The last samples of both channels, for a bank of derivative filters (differentiator.h). */
typedef struct {
    float phi_scale[4];                /* factors of the filters' sums for orders 0, 2, 3, 4 of phi [1/s^k] */
    float u_scale[3];                  /* the same for u, u', u'', over l1 */
    uint16_t length;                   /* places of the ring */
    uint16_t stride;                   /* places from tap to tap */
    uint16_t head;                     /* place of the oldest point, and of the sums of a block until they replace it */
    uint16_t at;                       /* samples in these sums */
    uint16_t missing;                  /* points until the window is full */
    uint8_t five_points;               /* 1: the bank is pvid_five_points_f32, whose sums are written out; 2: and the
                                          window is full */
    float samples[PVID_MAX_WINDOW][2]; /* the ring of points, phi and y */
} pvid_strong_window_f32;

struct pvid_strong_f32 {
    pvid_strong_window_f32 window;
    float drive;            /* mean square of u over about a second [1/s^4] */
    float drive_forgetting; /* share of a tick in this mean */
    float drive_min;        /* mean square of u below which no row is used */
    bool frozen;
    bool alarm; /* the last block of rows was a misfit: see misfit.h */
    pvid_gate_f32 gate;
    pvid_misfit_f32 misfit;
    pvid_strong_estimator_f32 estimator;
};

#endif
