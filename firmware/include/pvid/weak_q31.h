/* pvid/weak_q31.h - the weak form in integers alone: counts of the sensors in, parameters out.
 *
 * The same identifier as weak.h, in the same stages and the same schedule, for cores without a floating-point unit:
 *
 *   static pvid_weak_q31 identifier;
 *   (config from the header that `pvid tables --core q31` writes)
 *   if (pvid_weak_init_q31(&identifier, &config) != PVID_OK) ...
 *   each tick: reason = pvid_weak_step_q31(&identifier, phi_counts, y_counts);
 *
 * Formats. Every number is an integer times a power of two that the design tool chose from the sensors' full scale, by
 * interval analysis: no product or sum can exceed its type, whatever the samples. Angles are counted in fractions of
 * the encoder's LSB (F), times in decimated samples dt, so that u and w are numbers of 1/dt^2. The inner loop
 * multiplies a test function of 11 bits with a term of 21: one 32-bit multiplication on any core.
 *
 * Never allocates, never wraps, never divides by 0. A sample beyond full scale, or a pivot's acceleration beyond u_max,
 * is counted as saturated and restarts the windows; the sums are kept. Call all functions of an object from one
 * context; only pvid_weak_read_q31 may be called from other contexts at the same time (publication.h).
 */
#ifndef PVID_WEAK_Q31_H
#define PVID_WEAK_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/estimator_q31.h"
#include "pvid/gate_q31.h"
#include "pvid/mechanism_q31.h"
#include "pvid/trust_q31.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What is integrated twice from a window's start: U F, F and U. */
#define PVID_WEAK_INTEGRALS_Q31 3

/* What a window gathers for each test function: ten sums with chi'', four with chi, one with chi''''. */
#define PVID_WEAK_TERMS_Q31 15

#define PVID_WEAK_GRAMS 6

/* State: detail/weak_state_q31.h. Only the functions below write to it. */
typedef struct pvid_weak_q31 pvid_weak_q31;

/* Tables and formats of a design: constant data, made by `pvid tables --core q31`, kept by reference. See weak.h
 * for what the tables are. */
typedef struct {
    uint16_t taps;       /* smoothing window [samples], odd, 5..PVID_MAX_TAPS */
    uint16_t decimation; /* D, 1..PVID_MAX_DECIMATION */
    uint16_t window;     /* W [decimated samples], odd, 9..PVID_MAX_WEAK_WINDOW */
    uint8_t functions;   /* K, 4..PVID_MAX_FUNCTIONS, 32 at most: their forms are added up in 32 bits */
    uint8_t lag;         /* decimated samples between the three that F'' is taken from for the alarm, 1..255 */
    uint8_t smooth_bits; /* format of smooth */
    uint8_t phi_shift;   /* F = (centre 2^smooth_bits + sum smooth q) 2^-phi_shift */
    uint8_t u_shift;     /* U = (sum second q) 2^-u_shift */
    uint8_t uf_shift;    /* of the term U F */
    uint8_t integral_shift[PVID_WEAK_INTEGRALS_Q31]; /* of the integrals in dt^2/12 */
    uint8_t high_shift[2];                           /* of the parts of U I2(U F), U I2(F) that go beyond a term */
    uint8_t product_shift[5];                        /* of what they leave, and of U I2(U), U I2(1), U t */
    uint8_t sum_shift;                               /* of chi times a term before it is added, 1.. */
    uint8_t shift[PVID_WEAK_TERMS_Q31];              /* a term's share of its column: sum multiplier 2^-shift */
    int8_t gram_bits[PVID_WEAK_GRAMS];
    int32_t phi_max; /* full scale of the counts about phi_offset, y_offset */
    int32_t y_max;
    int32_t u_max;                        /* largest |U|, below 2^18 */
    const PVID_TABLE int32_t *smooth;     /* [(taps - 1) / 2] */
    const PVID_TABLE int32_t *second;     /* [(taps - 1) / 2] */
    const PVID_TABLE int16_t *chi;        /* [W][3][K] */
    const PVID_TABLE int32_t *multiplier; /* [PVID_WEAK_TERMS_Q31] */
    const PVID_TABLE int32_t *gram;       /* [6][K (K + 1) / 2] */
} pvid_weak_design_q31;

typedef struct {
    const pvid_weak_design_q31 *design; /* must outlive the identifier, as must its tables */
    int32_t phi_offset;          /* reading of the encoder near rest [counts]; the estimated zero c is relative to it */
    int32_t y_offset;            /* reading of the pivot's sensor in the middle of its travel [counts] */
    int32_t drive_min;           /* rms of U over a window below which it is dropped, 0..2^18; 0: none is */
    bool zero_unknown;           /* true: p = (w, d1, d2, c); false: p = (w, d1, d2), c = 0 */
    uint8_t iterations;          /* Gauss-Newton steps a window, 1..PVID_MAX_ITERATIONS; one where gain < 1 */
    pvid_scaled_q31 pivot_noise; /* variance that the pivot sensor's noise gives a row [Y's integer^2] for each mean
                                    square of a second difference of F, m 2^e; 0: an exact pivot. For the alarm only */
    pvid_estimator_config_q31 estimator; /* model is filled in by init */
    pvid_trust_config_q31 trust;         /* which estimates are published */
    pvid_gate_config_q31 gate;           /* on the residuals of a window */
} pvid_weak_config_q31;

/* Prepares `self`. Fails iff a field of config or of its design is out of its range (the status names it), a table is
 * missing or would overflow (PVID_BAD_DESIGN, and PVID_BAD_SHIFT where fewer bits would do), or a window cannot be
 * worked off before the next one is complete (PVID_BAD_ITERATIONS, as in weak.h).
 *
 * Of the tables it checks, in one walk, what it costs no analysis to know: a weight of `smooth` or `second` times four
 * full scales fits 32 bits; F and U F fit 21 bits for every count within full scale; an entry of chi times a term of 21
 * bits fits 32 bits with its rounding; no entry of gram is beyond 2^30 (gram_bits may be any). The rest is the design
 * tool's word, which proves it by interval analysis before it writes a table (host/src/pvid/design/weak_q31.py) and
 * tells the bits left free, `margins`: for every sample with |U| <= u_max the double integrals fit 63 bits, each
 * shifted one 32, each term 21, the sum of a window's products 32, and a column of terms 31. Tables of your own need
 * that proof: with others, sums wrap. */
pvid_status pvid_weak_init_q31(pvid_weak_q31 *self, const pvid_weak_config_q31 *config);

/* One tick: phi and y_A sampled together [counts]. Answers as pvid_weak_step_f32, but for a sample beyond full scale:
 * PVID_REJECTED_SATURATED. (A window that the gate keeps out: PVID_REJECTED_OUTLIER.) */
pvid_reason pvid_weak_step_q31(pvid_weak_q31 *self, int32_t phi, int32_t y);

/* The published estimate, for the context that calls step: the last trusted estimate, or the start as long as there is
 * none (then self->trust.published is false). */
const pvid_estimate_q31 *pvid_weak_estimate_q31(const pvid_weak_q31 *self);

/* Copies the published estimate consistently, from any context, while another context calls step (publication.h).
 * *number: estimates published so far; 0: none, and *estimate is the start; the pointer may be NULL. Returns false,
 * with *estimate undefined, iff an estimate was published during each of PVID_READ_ATTEMPTS tries, or before init. */
bool pvid_weak_read_q31(const pvid_weak_q31 *self, pvid_estimate_q31 *estimate, uint32_t *number);

/* Tells the identifier that samples are missing: the windows start again, nothing else is lost. */
void pvid_weak_gap_q31(pvid_weak_q31 *self);

/* Freezes the identifier, or lets it go on, as pvid_weak_freeze_f32: while it is frozen every window that is completed
 * is dropped with PVID_HELD_FROZEN, and p and the sums stay. */
void pvid_weak_freeze_q31(pvid_weak_q31 *self, bool frozen);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/weak_state_q31.h"

#endif
