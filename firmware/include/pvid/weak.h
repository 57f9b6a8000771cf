/* pvid/weak.h - the weak form of the identifier: samples of a real encoder in, parameters out.
 *
 * The strong form differentiates the angle four times, which amplifies an encoder's noise too much. The weak form
 * multiplies the equation of motion by K test functions over a window of about a second and
 * integrates by parts (MATH.md 5): no derivative of the angle is left, only y_A'' of the pivot, and
 * each window gives K rows (Y, N) to the same estimator.
 *
 *   static pvid_weak_f32 identifier;
 *   pvid_weak_config_f32 config = { .sample_rate_hz = 1000.0f, .l1 = 0.3f, .design = &table,
 *                                   .zero_unknown = true, .iterations = 3,
 *                                   .estimator = pvid_estimator_defaults_f32,
 *                                   .trust = pvid_trust_defaults_f32 };
 *   if (pvid_weak_init_f32(&identifier, &config) != PVID_OK) ...
 *   each tick: reason = pvid_weak_step_f32(&identifier, phi, y);
 *   there:     estimate = pvid_weak_estimate_f32(&identifier);
 *   elsewhere: if (pvid_weak_read_f32(&identifier, &copy, &number) && (number > 0)) ...
 *
 * Schedule. Samples are smoothed over `taps` and decimated by D; two windows of W decimated
 * samples, half a window apart, add sums; every H = (W - 1) / 2 decimated samples one of them is
 * complete. Of D ticks the first half smooths, a slice of the taps in each; the second half adds the result
 * to the windows, a slice of the functions in each. The first half also turns a complete window
 * into rows and Gauss-Newton steps, one small stage in each tick, while the other window fills; then the estimate is
 * checked, and published or not. The longest tick costs about three times the mean tick up to K = 12, four
 * times at K = 16, if a hop (H decimated samples) has a free tick for every stage. (If it has fewer, a tick runs
 * `together` stages of the state, and the longest tick is longer by about this factor.) The work of a tick depends on
 * its place in this schedule, not on the data; only a window dropped for too little drive or for its angle skips it.
 *
 * The first window that is used sets c to the mean of phi over it: an encoder's offset may be far from 0.
 *
 * Never allocates. Defined for every input: a sample that is not finite is rejected and restarts the windows (its
 * neighbours are no longer equidistant); the sums are kept. Call all functions of an object from one context; only
 * pvid_weak_read_f32 may be called from other contexts at the same time (publication.h).
 * RAM: sizeof(pvid_weak_f32); the tables are read where they are.
 */
#ifndef PVID_WEAK_H
#define PVID_WEAK_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/estimator.h"
#include "pvid/gate.h"
#include "pvid/kapitza_weak.h"
#include "pvid/trust.h"
#include "pvid/weak_job.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The tables of a design: constant data, made on a PC, kept by reference.
 *
 * The test functions chi_k and their first three derivatives vanish at both ends of the window, so
 * the first and the last sample of a window have no weight: their rows of chi are not read. The
 * functions are combined such that their residual filters chi'''' + d1 w chi'' + d2 w^2 chi are
 * orthonormal at a nominal p; the Gram tables are what restores this at the p of the moment. */
typedef struct {
    uint16_t taps;       /* smoothing window [samples], odd, 5..PVID_MAX_TAPS */
    uint16_t decimation; /* D, 1..PVID_MAX_DECIMATION */
    uint16_t window;     /* W [decimated samples], odd, 9..PVID_MAX_WEAK_WINDOW */
    uint8_t functions;   /* K, 4..PVID_MAX_FUNCTIONS */
    const float *smooth; /* [(taps - 1) / 2] value, folded as in differentiator.h: x0 + sum w q_i */
    const float *second; /* [(taps - 1) / 2] second derivative per sample^2, folded: sum w q_i */
    const float *chi;    /* [W][3][K] chi, chi'' [1/s^2], chi'''' [1/s^4] at the window's samples */
    const float *gram;   /* [6][K (K + 1) / 2] lower triangles by rows: G44, G42 + G24, G40 + G04, G22,
                            G20 + G02, G00 with G_ij = sum over samples of chi^(i) chi^(j)^T */
    float overlap;       /* variance inflation because half-overlapping windows share noise, >= 1 */
    uint8_t lag;         /* decimated samples between the three that phi'' is taken from for the alarm, 1..255:
                            a sixth of the fast mode's period */
} pvid_weak_design_f32;

typedef struct pvid_weak_angle_f32 pvid_weak_angle_f32;

typedef struct {
    float sample_rate_hz; /* 1e-3..1e6 */
    float l1;             /* length of rod 1 [m], > 0 */
    float drive_min;      /* rms of u = y_A''/l1 about its mean [1/s^2] over a window, below which the pivot
                             counts as still and the window is dropped; some ten times the noise of u.
                             0: every window is taken in */
    float pivot_noise;    /* variance that the pivot sensor's noise gives a row, for each (rad/s^2)^2 of mean square
                             phi'' [s^4]; 0: an exact pivot. For the alarm only */
    float angle_limit;    /* largest |phi - c| [rad] that a window may hold; 0: no limit */
    const pvid_weak_design_f32 *design; /* must outlive the identifier, as must its tables */
    pvid_weak_angle_f32 *angle;         /* memory for full_angle and friction; must outlive the identifier. NULL if both
                                     are false */
    bool full_angle;    /* correct the rows for sines and cosines once the estimate has settled; set angle_limit
                           to 0.2 rad: the correction is not accurate beyond that */
    bool friction;      /* p = (w, d1, d2, c, c1, c2): two viscous frictions absorb what damps the motion. Needs
                           zero_unknown, PVID_MAX_P 6 and PVID_MAX_MOMENTS 55 */
    uint8_t passes;     /* of the correction, 1..PVID_MAX_PASSES; 3 is good */
    bool zero_unknown;  /* true: p = (w, d1, d2, c), c [rad] the encoder's reading at rest; false: c = 0 */
    uint8_t iterations; /* Gauss-Newton steps a window, 1..PVID_MAX_ITERATIONS; 3 is good. One where
                           the estimator's law is a rate (g < 1) */
    pvid_estimator_config_f32 estimator; /* model, update_rate_hz, row_weight and correlation are filled
                                            in by init. A group of rows is a window; row_sd [rad] is
                                            the noise of a decimated sample */
    pvid_trust_config_f32 trust;         /* which estimates are published */
    pvid_gate_config_f32 gate;           /* on the residuals of a window */
} pvid_weak_config_f32;

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

/* What a sample brings to these sums. */
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

typedef struct {
    float before; /* the integrand at the last sample */
    float once;
    float twice;
} pvid_weak_integral_f32;

/* What the rows lack: the remainder of Y, and the columns of c1 and c2. */
#define PVID_WEAK_REMAINDERS 3

/* The samples of the window in work, and what its rows lack. Only the identifier writes to it. */
struct pvid_weak_angle_f32 {
    uint16_t length; /* places of the ring in use: a window and a hop */
    uint16_t window; /* W */
    uint16_t head;   /* place of the next decimated sample */
    uint16_t first;  /* place of the window's first sample */
    uint16_t place;  /* of the sample in work */
    uint16_t index;  /* of it in the window, or of the function in work */
    uint8_t stage;
    uint8_t pass;
    uint8_t passes;
    uint8_t channels; /* 1, or 3 with friction */
    bool full_angle;
    bool on;       /* the estimate has settled: rows are corrected */
    bool physical; /* p is that of a pendulum */
    float dt;
    float inverse_l1_square; /* of rod 1 [1/m^2] */
    float p[PVID_KAPITZA_P];
    float zero;        /* c */
    float friction[2]; /* c1, c2 */
    float l1;          /* L1 and L2 of p */
    float l2;
    float a; /* of the window */
    float b;
    float normal[5]; /* A^T A, A^T B, B^T B, A^T e, B^T e */
    pvid_weak_integral_f32 motion;
    pvid_weak_integral_f32 remainder_integral[PVID_WEAK_REMAINDERS];
    float remainder[PVID_MAX_FUNCTIONS][PVID_WEAK_REMAINDERS];              /* by the last pass */
    float next[PVID_MAX_FUNCTIONS][PVID_WEAK_REMAINDERS];                   /* by this one */
    float ring[PVID_MAX_WEAK_WINDOW + ((PVID_MAX_WEAK_WINDOW + 1) / 2)][2]; /* phi [rad], u [1/s^2] */
};

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

/* State; only the functions below write to it. */
typedef struct {
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
} pvid_weak_f32;

/* Prepares `self`. Fails iff a field of config or of its design is out of its range (the status names it), a table is
 * missing or holds a number that is not finite (PVID_BAD_DESIGN), or a window cannot be worked off before the next one
 * is complete (PVID_BAD_ITERATIONS): H D / 2 ticks, one at least a sample, for less than
 * 10 K + 35 stages, 19 a Gauss-Newton step and K / 6 + W / 4 + 3 a pass of the correction. A tick takes as many stages
 * as that needs: one where the hop is long enough, 32 at most. */
pvid_status pvid_weak_init_f32(pvid_weak_f32 *self, const pvid_weak_config_f32 *config);

/* One tick: phi [rad] and y_A [m] sampled together. Returns PVID_WARMING_UP until the first window is
 * complete; at the tick that ends the work on a window what trust.h says of it; PVID_HELD_NOT_EXCITED or
 * PVID_HELD_OUT_OF_RANGE at once where a window was dropped for want of drive or for its angle, and
 * PVID_REJECTED_OUTLIER where the gate kept it out;
 * PVID_REJECTED_.. when the sample or a window's row was not usable; else PVID_ACCUMULATED. */
pvid_reason pvid_weak_step_f32(pvid_weak_f32 *self, float phi, float y);

/* The published estimate, for the context that calls step: the last trusted estimate, or the start as long as there is
 * none (then self->trust.published is false). Its age: time since step last returned PVID_UPDATED or PVID_MISFIT. */
const pvid_estimate_f32 *pvid_weak_estimate_f32(const pvid_weak_f32 *self);

/* Copies the published estimate consistently, from any context, while another context calls step (publication.h).
 * *number: estimates published so far; 0: none, and *estimate is the start; the pointer may be NULL. Returns false,
 * with *estimate undefined, iff an estimate was published during each of PVID_READ_ATTEMPTS tries, or before init. */
bool pvid_weak_read_f32(const pvid_weak_f32 *self, pvid_estimate_f32 *estimate, uint32_t *number);

/* Call this if samples are missing: the windows start again, all other state is kept. */
void pvid_weak_gap_f32(pvid_weak_f32 *self);

/* Freezes the identifier (true) or resumes it (false). While it is frozen every complete window is dropped with
 * PVID_HELD_FROZEN: p and the sums are kept, without forgetting. A window that is being processed is finished, in less
 * than half a window. Samples are still added to windows, so that it resumes bumplessly: the next window is complete
 * after at most half a window, and may have begun before the resumption. */
void pvid_weak_freeze_f32(pvid_weak_f32 *self, bool frozen);

#ifdef __cplusplus
}
#endif

#endif
