/* pvid/weak_q31.h - the weak form of weak.h with integers only: its model and its tables.
 *
 * Formats. A value is its integer times 2^-bits, times a unit that only the factors of the terms contain. The design
 * tool computes all formats from the full scale of the sensors and the reach of each derivative, by interval
 * arithmetic: no sum or product exceeds its type for samples within full scale, and a jet beyond its reach is refused
 * (host/src/pvid/design/weak_q31.py, which also lists the proof's spare bits).
 *
 *   counts         x less the offset, |x| <= full_scale <= 2^24
 *   signals        exact: SAMPLED x,  HELD -x_(k-2) + 13 x_(k-1) + 13 x_k - x_(k+1),  JUMP x_k - x_(k-1),  LAST x_(k-1)
 *   block sums     exact: D^2 |signal| <= 2^31, then shifted to 28 bits
 *   jets           int32 in the formats of `prepare` and `values`: exact sums of weights times block sums, rounded
 *   integrals      int32 in dt/120 (once) and dt^2/240 (twice) of the integrand without its last bits
 *   time           the integrals of 1 in dt/2 and dt^2/48
 *   channels       int32 within +-2^28
 *   sums           of four steps exact: a cosine of 16 bits, or of 24 if the signals have many counts, times 29 bits;
 *                  then shifted to int32 and added
 *   S_h            int32; every integral starts at the start of the window
 */
#ifndef PVID_WEAK_Q31_H
#define PVID_WEAK_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/estimator_q31.h"
#include "pvid/gate_q31.h"
#include "pvid/layout.h"
#include "pvid/trust_q31.h"
#include "pvid/weak_parts.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Largest magnitude of a block sum and of a channel. */
#define PVID_WEAK_LIMIT_Q31 INT32_C(268435456) /* 2^28 */

/* ---- the model: generated, the same for every rig ---- */

/* A share of a column: += factor D^order[channel]; the design has the factors. */
typedef struct {
    uint8_t channel;
    uint8_t order;
    uint8_t column; /* of its kind: theta's in order, then Y, then the nuisances */
} pvid_weak_term_q31;

typedef struct {
    uint8_t samples;    /* entries of the argument of step */
    uint8_t signals;    /* samples, and signals made of them: weak_parts.h */
    uint8_t jets;       /* inputs of `prepare`, the first inputs of `values` */
    uint8_t runs;       /* integrals since the start of the run: inputs of `values` after the jets */
    uint8_t signs;      /* arguments of sgn: inputs of `values` after the runs */
    uint8_t gains;      /* first results of `values` */
    uint8_t integrands; /* results of `values` after the gains */
    uint8_t channels;
    uint8_t kinds;
    const pvid_weak_signal *signal;   /* [signals] */
    const pvid_weak_jet *jet;         /* [jets] */
    const pvid_weak_channel *channel; /* [channels] */
    const pvid_weak_term_q31 *term;   /* [kind[kinds - 1].end] */
    const pvid_weak_kind *kind;       /* [kinds] */
    /* From the jets: the derivatives of the runs [runs], then the arguments of sgn [signs]. NULL if there are none.
     * Returns false, and writes nothing, iff a jet is beyond its reach. */
    bool (*prepare)(const int32_t jet[], int32_t out[]);
    /* From jets, runs and signs (Q30): the gains, then the integrands. Returns false, and writes nothing, iff an input
     * is beyond its reach. */
    bool (*values)(const int32_t in[], int32_t out[]);
    const pvid_model_q31 *model; /* theta and C of all kinds */
} pvid_weak_model_q31;

/* ---- the design: tables and formats for a rig ---- */

/* Compensator that gives a jet at a step from the block sums at the steps around it (host/docs/firmware.md): the exact
 * sum of weights times block sums, 2^-down of it rounded half up. */
typedef struct {
    uint16_t half;                     /* 0: the block sum itself */
    uint8_t down;                      /* 0..62 */
    const PVID_TABLE int32_t *weights; /* [half + 1] within 2^30: of order 0 that of the block sum itself, else 0; then
                                          outwards */
} pvid_weak_filter_q31;

/* Shifts of an integrand, and of what a step adds to twice its integral. */
typedef struct {
    uint8_t down;
    uint8_t twice;
} pvid_weak_integral_q31;

/* Shifts of a channel. */
typedef struct {
    uint8_t value; /* of the upper half of gain times integral to the channel; without an integral: of the gain */
    uint8_t lift;  /* of an integral of 1 to the left */
    uint8_t own;   /* of A_h +- B_h to S_h */
    uint8_t plain; /* of an integral: of I^fold at the end of the first half times B_h of the channel `plain` */
    uint8_t ramp;  /* of fold 2: of I^1 at the end of the first half times B_h of the channel `ramp` */
} pvid_weak_format_q31;

/* A part of the variance D_h at harmonic h, in the rows of a kind, that the sensors' noise causes:
 * += W_h factor theta_a theta_b h^(2 power), with theta = -1 for the column of Y; W_h: 2 hop at h = 0, else hop. */
typedef struct {
    uint8_t kind;
    uint8_t power;
    uint8_t a; /* columns of the kind, a <= b; pairs with a < b are counted once, with twice the factor */
    uint8_t b;
    pvid_scaled_q31 factor;
} pvid_weak_noise_q31;

typedef struct {
    const pvid_weak_model_q31 *model;
    uint8_t functions;         /* K, 4..PVID_MAX_FUNCTIONS: the bell, then cosine and sine of each frequency */
    uint8_t power;             /* n of sin^n, even, at least 2 above the highest order of the terms, at most 8 */
    uint8_t decimation;        /* D, ticks a step, 1..PVID_MAX_DECIMATION */
    uint8_t sum_shift;         /* of four steps' products 2^-14 (fine: 2^-22) before they are added, 1..16 */
    uint16_t hop;              /* steps of half a window, a multiple of 4; H < hop */
    const int32_t *full_scale; /* [samples] of the counts about their offsets */
    const uint8_t *down;       /* [signals] shift of the block sums to 28 bits */
    const pvid_weak_filter_q31 *filter;     /* [jets] */
    const pvid_rescale_q31 *run;            /* [runs] from twice the sum over the steps to the input of `values` */
    const int32_t *sign_width;              /* [signs] of the soft sign tanh(v / width), in the format of its argument;
                                               0: the mean of sgn over a step */
    const pvid_weak_integral_q31 *integral; /* [integrands] */
    const pvid_weak_format_q31 *format;     /* [channels] */
    bool fine;                              /* the cosine has 24 bits; else 16 */
    const PVID_TABLE int32_t *circle;       /* [2 hop + 3 hop/2 + 3 H] cos(pi j / hop) times its first entry */
    const pvid_scaled_q31 *factor;    /* of each term, of h^order times a unit of S_h: [model->kind[kinds - 1].end] */
    const pvid_weak_noise_q31 *noise; /* [n_noise] */
    uint16_t n_noise;
    const uint8_t *error_order; /* [kinds] the equation error is the derivative of this order of white noise */
    const pvid_scaled_q31 *error_variance; /* [kinds] least one of that noise at a step, times W_h h^(2 order) the share
                                              in D_h; or 0; residuals raise it */
} pvid_weak_design_q31;

/* ---- the configuration ---- */

typedef struct {
    const pvid_weak_design_q31 *design; /* must outlive the identifier, with its tables */
    const int32_t *offset;              /* [samples] reading of each sensor at 0, within +-2^30 [counts] */
    const int32_t *drive_min; /* [samples] a window with a half in which a sample has a smaller standard deviation is
                                 dropped, 0..2^24 [counts]: its sensor stands still; NULL: no check */
    bool compensation;        /* corrects the bias by the sensors' noise (errors in variables), as in weak.h */
    uint8_t iterations; /* Gauss-Newton steps in each of the first eight windows, 1..PVID_MAX_ITERATIONS; then one.
                           Recommended: 2, as in weak.h */
    pvid_estimator_config_q31 estimator; /* row_sd 2^(8 + y_bits): rows are in standard deviations. init sets model and
                                            row_weight */
    pvid_trust_config_q31 trust;         /* conditions of publication */
    pvid_gate_config_q31 gate;           /* outlier gate on the residuals of a window, for each kind */
} pvid_weak_config_q31;

/* State: detail/weak_state_q31.h, not API. Only the functions below write to it. */
typedef struct pvid_weak_q31 pvid_weak_q31;

/* The init below, for an application with this word (layout.h). */
pvid_status pvid_weak_init_layout_q31(pvid_weak_q31 *self, const pvid_weak_config_q31 *config, uint32_t layout);

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - library and application were compiled with different sizes (PVID_BAD_LAYOUT; *self is unchanged),
 *   - a field of config, design or model is out of its range (the status names it), or
 *   - a window cannot be processed before the next one is complete (PVID_BAD_ITERATIONS).
 * The tables must come from the design tool, which proves that no sum overflows. */
static inline pvid_status pvid_weak_init_q31(pvid_weak_q31 *self, const pvid_weak_config_q31 *config)
{
    return pvid_weak_init_layout_q31(self, config, PVID_LAYOUT);
}

/* One tick: the readings [samples], taken at the same time. Returns as pvid_weak_step_f32. */
pvid_reason pvid_weak_step_q31(pvid_weak_q31 *self, const int32_t reading[]);

/* So many ticks at once: readings [count][samples], of which a DMA's counts are an example. The
 * state and the reason are as of pvid_weak_step_block_f32 (weak.h). */
pvid_reason pvid_weak_step_block_q31(pvid_weak_q31 *self, const int32_t readings[], uint32_t count);

/* The published estimate, for the context that calls step; the start before the first one. */
const pvid_estimate_q31 *pvid_weak_estimate_q31(const pvid_weak_q31 *self);

/* Copies the published estimate from any context; as pvid_weak_read_f32. */
bool pvid_weak_read_q31(const pvid_weak_q31 *self, pvid_estimate_q31 *estimate, uint32_t *number);

/* Call this when samples are missing: the windows restart, all other state is kept. */
void pvid_weak_gap_q31(pvid_weak_q31 *self);

/* Freezes the identifier (true) or resumes it (false); as pvid_weak_freeze_f32. */
void pvid_weak_freeze_q31(pvid_weak_q31 *self, bool frozen);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/weak_state_q31.h"

#endif
