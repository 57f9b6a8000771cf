/* pvid/strong_q31.h - the paper's identifier in integers alone: counts of the sensors in, parameters out.
 *
 * The same identifier as strong.h for cores without a floating-point unit:
 *
 *   static pvid_strong_q31 identifier;
 *   (config from the header that `pvid tables --form strong` writes)
 *   if (pvid_strong_init_q31(&identifier, &config) != PVID_OK) ...
 *   each tick: reason = pvid_strong_step_q31(&identifier, phi_counts, y_counts);
 *
 * Formats. Derivatives are exact sums of counts, shifted once; rows and parameters stand in formats that the design
 * tool chose from the sensors' full scale, the time unit and the nominal p. Nothing wraps whatever the samples: a
 * sample beyond full scale, a pivot's acceleration beyond the expected range, or a row that does not fit its formats is
 * counted as saturated and changes no sum.
 *
 * The strong form differentiates the angle four times: it needs a sensor of about 20 bits whose zero is the
 * equilibrium. Never allocates, never divides by 0. Call all functions of an object from one context;
 * publication_q31.h passes an estimate to other contexts.
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
    pvid_fir_bank_q31 bank;  /* of both channels; its weights must outlive the identifier */
    pvid_strong_row_q31 row; /* shifts, each 0..62 */
    int32_t u_multiplier;    /* u = (derivative of y) u_multiplier 2^-u_shift; > 0 */
    uint8_t u_shift;         /* 0..62 */
    int32_t phi_offset;      /* reading of the encoder at the equilibrium [counts] */
    int32_t y_offset;        /* reading of the pivot's sensor in the middle of its travel [counts] */
    int32_t drive_min;       /* rms of u over drive_ticks below which the pivot counts as still and no row is taken in,
                                0..PVID_DERIVATIVE_LIMIT_Q31 in the format of u. 0: every row is taken in */
    uint32_t drive_ticks;    /* 1..2^30: ticks in about a second */
    pvid_gate_config_q31 gate;           /* on the innovation of a row; its scale remembers a quarter of drive_ticks */
    pvid_estimator_config_q31 estimator; /* model is filled in by init */
} pvid_strong_config_q31;

/* State: detail/strong_state_q31.h. Only the functions below write to it. */
typedef struct pvid_strong_q31 pvid_strong_q31;

/* Prepares `self`. Fails iff a field of config is out of its range or counts within full scale could overflow the bank
 * (differentiator_q31.h); the status names the field: PVID_BAD_SHIFT for those of the row and u_shift. */
pvid_status pvid_strong_init_q31(pvid_strong_q31 *self, const pvid_strong_config_q31 *config);

/* One tick: phi and y_A sampled together [counts]. Answers as pvid_strong_step_f32; PVID_REJECTED_SATURATED for a
 * sample beyond full scale, which empties the window, and for a row that does not fit, which does not;
 * PVID_REJECTED_OUTLIER for a row that the gate kept out; PVID_MISFIT in place of PVID_UPDATED while the rows that fit
 * leave more unexplained than they should. */
pvid_reason pvid_strong_step_q31(pvid_strong_q31 *self, int32_t phi, int32_t y);

/* Tells the identifier that samples are missing: the window starts again, nothing else is lost. */
void pvid_strong_gap_q31(pvid_strong_q31 *self);

/* Freezes the identifier, or lets it go on, as pvid_strong_freeze_f32: ticks that would have given a row return
 * PVID_HELD_FROZEN while it is frozen, and p and the sums stay. */
void pvid_strong_freeze_q31(pvid_strong_q31 *self, bool frozen);

#ifdef __cplusplus
}
#endif

#include "pvid/detail/strong_state_q31.h"

#endif
