/* pvid/strong_q31.h - identifies a pendulum by the paper's strong form with integers only: sensor counts in,
 * parameters out.
 *
 * The identifier of strong.h for cores without a floating-point unit; it needs an encoder of about 20 bits that
 * reads 0 at the equilibrium:
 *
 *   static pvid_strong_q31 identifier;
 *   (config from the header that `pvid tables --form strong --core q31` writes)
 *   if (pvid_strong_init_q31(&identifier, &config) != PVID_OK) ...
 *   each tick: reason = pvid_strong_step_q31(&identifier, phi_counts, y_counts);
 *
 * Formats. Derivatives are exact sums of counts, shifted once; the design tool chooses the formats of rows and
 * parameters from the sensors' full scale, the time unit and the nominal p. Nothing wraps: a sample beyond full
 * scale, a pivot acceleration beyond the expected range and a row that does not fit its formats are counted as
 * saturated and change no sum.
 *
 * Never allocates. Call all functions of an object from one context; publication_q31.h passes estimates to other
 * contexts.
 */
#ifndef PVID_STRONG_Q31_H
#define PVID_STRONG_Q31_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/differentiator_q31.h"
#include "pvid/estimator_q31.h"
#include "pvid/gate_q31.h"
#include "pvid/mechanism_q31.h"
#include "pvid/misfit_q31.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    pvid_fir_bank_q31 bank;                  /* filters of both channels; the weights must outlive the identifier */
    pvid_strong_row_q31 row;                 /* formats of a row: kapitza_strong_q31.h */
    int32_t u_multiplier[PVID_Y_ORDERS_Q31]; /* u, u', u'' = (derivative of y) u_multiplier 2^-u_shift; > 0 */
    uint8_t u_shift[PVID_Y_ORDERS_Q31];      /* each 0..62 */
    int32_t phi_offset;                      /* reading of the encoder at the equilibrium [counts] */
    int32_t y_offset;                        /* reading of the pivot's sensor at mid-travel [counts] */
    int32_t drive_min;    /* least rms of u over drive_ticks, 0..PVID_DERIVATIVE_LIMIT_Q31 in the format of u: with less
                             drive no row is used. 0: every row is used */
    uint32_t drive_ticks; /* rows in about one second, 1..2^30: those of samples, or of blocks of them */
    pvid_gate_config_q31 gate; /* outlier gate on the innovation of a row; its scale averages over drive_ticks / 4 */
    pvid_estimator_config_q31 estimator; /* see pvid_kapitza_estimator_init_q31 */
} pvid_strong_config_q31;

/* State: detail/strong_state_q31.h, not API. Only the functions below write to it. */
typedef struct pvid_strong_q31 pvid_strong_q31;

/* Initialises `self`. Fails iff
 *   - a pointer is NULL (PVID_BAD_POINTER),
 *   - a field of config is out of its range (the status names it; PVID_BAD_SHIFT: row or u_shift), or
 *   - counts within full scale could overflow the bank (differentiator_q31.h). */
pvid_status pvid_strong_init_q31(pvid_strong_q31 *self, const pvid_strong_config_q31 *config);

/* One tick: phi and y_A [counts], sampled at the same time. Returns as pvid_strong_step_f32, and
 * PVID_REJECTED_SATURATED for a sample beyond full scale (the window restarts) or a row that does not fit (the
 * window continues). */
pvid_reason pvid_strong_step_q31(pvid_strong_q31 *self, int32_t phi, int32_t y);

/* Call this when samples are missing: the window restarts, all other state is kept. */
void pvid_strong_gap_q31(pvid_strong_q31 *self);

/* Freezes the identifier (true) or resumes it (false), as pvid_strong_freeze_f32. */
void pvid_strong_freeze_q31(pvid_strong_q31 *self, bool frozen);

/* The running hash of fnv.h for this estimator: continues hash over p, the sums (low word first), their exponent and
 * the reason, after a tick with this reason. */
uint32_t pvid_fnv_strong_q31(uint32_t hash, const pvid_kapitza_estimator_q31 *estimator, pvid_reason reason);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/strong_state_q31.h"

#endif
