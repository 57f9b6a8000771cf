/* pvid/detail/strong_state.h - the state behind strong.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_STRONG_STATE_H
#define PVID_DETAIL_STRONG_STATE_H

#include "pvid/strong.h"

#define PVID_STRONG_SUMS 58 /* distinct entries of M, B, sum Y^2 and the weight */
#define PVID_STRONG_ROWS 4  /* rows of a block */

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
    float p[PVID_KAPITZA_P];
    float s[6];                       /* C^T M C at the last exact projection and the rows since, upper triangle */
    float force[PVID_KAPITZA_P];      /* right-hand side of a step that is projected and not yet solved */
    float innovation[PVID_KAPITZA_P]; /* sum C^T N e since the last projection; only while gain < 1 and divider > 1 */
    float prior[PVID_KAPITZA_P];      /* diagonal of H0 */
    float lower[PVID_KAPITZA_P];
    float upper[PVID_KAPITZA_P];
    float row_variance; /* row_sd^2 [units of Y^2] */
    float gain;         /* g of a step with an exact projection */
    float correlation;
    float step_limit;
    float kappa_min;
    float dead_zone;     /* square of the configured one */
    uint16_t divider;    /* rows per solve */
    uint16_t phase;      /* rows since the last solve was due, or with divider 1 since the last exact projection */
    uint8_t exact_every; /* rows from one exact projection to the next, with divider 1 */
    uint8_t staged;      /* 1: projection, solve and fold at rows of their own */
    uint8_t fold_every;  /* rows between folds */
    uint8_t age;         /* rows in the sums since the last fold */
    uint8_t in_block;    /* rows in `block` */
    uint8_t projects_at; /* phase of the projection, with a divider above 1 */
    bool mixes;          /* gain < 1 */
    pvid_counters counters;
    pvid_strong_row_f32 block[PVID_STRONG_ROWS]; /* rows that are not in the sums yet */
    pvid_strong_sums_f32 sums;
};

/* The last samples of both channels, for a bank of derivative filters (differentiator.h). */
typedef struct {
    pvid_fir_bank_f32 bank;
    float phi_scale[4];                /* factors of the filters' sums for orders 0, 2, 3, 4 of phi [1/s^k] */
    float u_scale[3];                  /* the same for u, u', u'', over l1 */
    uint16_t length;                   /* places of the ring; 0 before init has accepted a configuration */
    uint16_t head;                     /* place of the oldest point */
    uint16_t at;                       /* place of the oldest sample of a block */
    uint16_t missing;                  /* samples until the window is full */
    bool five_points;                  /* the bank is pvid_five_points_f32: its sums are written out */
    float samples[PVID_MAX_WINDOW][2]; /* the ring of points, phi and y; behind it the sums of blocks
                                          (differentiator_f32.h) */
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
