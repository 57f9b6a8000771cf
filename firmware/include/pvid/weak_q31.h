/* pvid/weak_q31.h - identifies a pendulum by the weak form with integers only: sensor counts in, parameters out.
 *
 * The identifier of weak.h, with the same stages and schedule, for cores without a floating-point unit:
 *
 *   static pvid_weak_q31 identifier;
 *   (config from the header that `pvid tables --core q31` writes)
 *   if (pvid_weak_init_q31(&identifier, &config) != PVID_OK) ...
 *   each tick: reason = pvid_weak_step_q31(&identifier, phi_counts, y_counts);
 *
 * Formats. Every number is an integer times a power of two that the design tool computes from the sensors' full
 * scale by interval analysis: no product or sum exceeds its type for any sample. Angles F are in fractions of the
 * encoder's LSB, times in decimated samples dt; u and w are in 1/dt^2. The inner loop multiplies a test function
 * of 11 bits by a term of 21 bits: one 32-bit multiplication.
 *
 * Never allocates. A sample beyond full scale and a pivot acceleration beyond u_max are counted as saturated and
 * restart the windows; the sums are kept. Call all functions of an object from one context, except
 * pvid_weak_read_q31 (publication.h).
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

/* Integrated twice from a window's start: U F, F and U. */
#define PVID_WEAK_INTEGRALS_Q31 3

/* Sums per test function: ten with chi'', four with chi, one with chi''''. */
#define PVID_WEAK_TERMS_Q31 15

#define PVID_WEAK_GRAMS 6

/* State: detail/weak_state_q31.h, not API. Only the functions below write to it. */
typedef struct pvid_weak_q31 pvid_weak_q31;

/* Tables and formats of a design: constant data from `pvid tables --core q31`, kept by reference. Meaning of the
 * tables: weak.h. */
typedef struct {
    uint16_t taps;       /* smoothing window [samples], odd, 5..PVID_MAX_TAPS */
    uint16_t decimation; /* D, 1..PVID_MAX_DECIMATION */
    uint16_t window;     /* W [decimated samples], odd, 9..PVID_MAX_WEAK_WINDOW */
    uint8_t functions;   /* K, 4..PVID_MAX_FUNCTIONS, at most 32: their forms are summed in 32 bits */
    uint8_t lag;         /* decimated samples between the three samples of the curvature for the misfit alarm, 1..255 */
    uint8_t smooth_bits; /* format of smooth */
    uint8_t phi_shift;   /* F = (centre 2^smooth_bits + sum smooth q) 2^-phi_shift */
    uint8_t u_shift;     /* U = (sum second q) 2^-u_shift */
    uint8_t uf_shift;    /* of the term U F */
    uint8_t integral_shift[PVID_WEAK_INTEGRALS_Q31]; /* of the integrals in dt^2/12 */
    uint8_t high_shift[2];                           /* of the high parts of U I2(U F), U I2(F) */
    uint8_t product_shift[5];                        /* of their low parts, and of U I2(U), U I2(1), U t */
    uint8_t sum_shift;                               /* of chi times a term before it is added, >= 1 */
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
    const pvid_weak_design_q31 *design; /* must outlive the identifier, with its tables */
    int32_t phi_offset;                 /* reading of the encoder near rest [counts]; c is relative to it */
    int32_t y_offset;                   /* reading of the pivot's sensor at mid-travel [counts] */
    int32_t drive_min;  /* least rms of U in a window, 0..2^18: a window with less drive is dropped; 0: every window is
                           used */
    bool zero_unknown;  /* true: p = (w, d1, d2, c); false: p = (w, d1, d2), c = 0 */
    uint8_t iterations; /* Gauss-Newton steps per window, 1..PVID_MAX_ITERATIONS; 1 if gain < 1 */
    pvid_scaled_q31 pivot_noise; /* variance of a row by the pivot sensor's noise [Y's integer^2] per mean square of a
                                    second difference of F, m 2^e; used by the misfit alarm. 0: exact pivot */
    pvid_estimator_config_q31 estimator; /* init sets model */
    pvid_trust_config_q31 trust;         /* conditions of publication */
    pvid_gate_config_q31 gate;           /* outlier gate on the residuals of a window */
} pvid_weak_config_q31;

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - a field of config or design is out of its range (the status names it),
 *   - a table is NULL or could overflow (PVID_BAD_DESIGN; PVID_BAD_SHIFT if fewer bits would fit), or
 *   - a window cannot be processed before the next one is complete (PVID_BAD_ITERATIONS, as in weak.h).
 *
 * init checks in one pass: a weight of `smooth` or `second` times four full scales fits 32 bits; F and U F fit 21
 * bits for every count within full scale; an entry of chi times a term of 21 bits fits 32 bits with its rounding;
 * no entry of gram exceeds 2^30 (any gram_bits). The design tool proves the rest by interval analysis
 * (host/src/pvid/design/weak_q31.py) and prints the spare bits: for every sample with |U| <= u_max the double
 * integrals fit 63 bits, each shifted one 32, each term 21, the sum of a window's products 32, and a column of
 * terms 31. Your own tables need this proof; otherwise sums may wrap. */
pvid_status pvid_weak_init_q31(pvid_weak_q31 *self, const pvid_weak_config_q31 *config);

/* One tick: phi and y_A [counts], sampled at the same time. Returns as pvid_weak_step_f32, with
 * PVID_REJECTED_SATURATED for a sample beyond full scale. */
pvid_reason pvid_weak_step_q31(pvid_weak_q31 *self, int32_t phi, int32_t y);

/* The published estimate, for the context that calls step: the last trusted estimate, or the start before the
 * first one (then self->trust.published is false). */
const pvid_estimate_q31 *pvid_weak_estimate_q31(const pvid_weak_q31 *self);

/* Copies the published estimate from any context, also while another one calls step; arguments and failures:
 * pvid_weak_read_f32. */
bool pvid_weak_read_q31(const pvid_weak_q31 *self, pvid_estimate_q31 *estimate, uint32_t *number);

/* Call this when samples are missing: the windows restart, all other state is kept. */
void pvid_weak_gap_q31(pvid_weak_q31 *self);

/* Freezes the identifier (true) or resumes it (false), as pvid_weak_freeze_f32. */
void pvid_weak_freeze_q31(pvid_weak_q31 *self, bool frozen);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/weak_state_q31.h"

#endif
