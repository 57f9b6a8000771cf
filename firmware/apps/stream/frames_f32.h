/* What the Configure and Estimate frames of both float32 identifiers hold: the settings of the estimator, an estimate.
 */
#ifndef FRAMES_F32_H
#define FRAMES_F32_H

#include <string.h>

#include "identifier.h"
#include "pvid/estimator.h"
#include "pvid/little_endian.h"

static inline void get_floats(float to[], const uint8_t from[], size_t count)
{
    for (size_t i = 0; i < count; i++) {
        to[i] = pvid_get_f32(&from[4u * i]);
    }
}

/* Replaces the settings that a Configure frame holds. */
static inline void get_estimator_config(pvid_estimator_config_f32 *estimator,
                                        const uint8_t payload[PVID_CONFIGURE_BYTES])
{
    get_floats(estimator->start, &payload[PVID_CONFIGURE_START], STREAM_N_P);
    get_floats(estimator->start_sd, &payload[PVID_CONFIGURE_START_SD], STREAM_N_P);
    get_floats(estimator->lower, &payload[PVID_CONFIGURE_LOWER], STREAM_N_P);
    get_floats(estimator->upper, &payload[PVID_CONFIGURE_UPPER], STREAM_N_P);
    estimator->row_sd = pvid_get_f32(&payload[PVID_CONFIGURE_ROW_SD]);
    estimator->forgetting_s = pvid_get_f32(&payload[PVID_CONFIGURE_FORGETTING_S]);
    estimator->feedback_hz = pvid_get_f32(&payload[PVID_CONFIGURE_FEEDBACK_HZ]);
    estimator->law = (pvid_law)payload[PVID_CONFIGURE_LAW]; /* any value: init checks it */
    estimator->divider = pvid_get_u16(&payload[PVID_CONFIGURE_DIVIDER]);
}

/* Writes p and the upper triangle of its covariance. */
static inline void put_p(uint8_t p[4u * PVID_LINK_P], uint8_t covariance[], const pvid_estimate_f32 *estimate)
{
    size_t at = 0;
    for (size_t i = 0; i < PVID_LINK_P; i++) {
        for (size_t j = i; j < PVID_LINK_P; j++) {
            if (j < STREAM_N_P) {
                pvid_put_f32(&covariance[at], estimate->covariance[i][j]);
            }
            at += 4u;
        }
        if (i < STREAM_N_P) {
            pvid_put_f32(&p[4u * i], estimate->p[i]);
        }
    }
}

/* Writes an Estimate frame without the upper bits of its tick. */
static inline void put_estimate(uint8_t payload[PVID_ESTIMATE_BYTES], const pvid_estimate_f32 *estimate,
                                uint32_t session, uint32_t updates, pvid_reason reason)
{
    memset(payload, 0, PVID_ESTIMATE_BYTES);
    pvid_put_u32(&payload[PVID_ESTIMATE_SESSION], session);
    pvid_put_u32(&payload[PVID_ESTIMATE_UPDATES], updates);
    put_p(&payload[PVID_ESTIMATE_P], &payload[PVID_ESTIMATE_COVARIANCE], estimate);
    pvid_put_f32(&payload[PVID_ESTIMATE_KAPPA], estimate->kappa);
    pvid_put_f32(&payload[PVID_ESTIMATE_RESIDUAL_SD], estimate->residual_sd);
    pvid_put_f32(&payload[PVID_ESTIMATE_WEIGHT], estimate->weight);
    payload[PVID_ESTIMATE_REASON] = (uint8_t)reason;
    pvid_put_u32(&payload[PVID_ESTIMATE_STANDING], pvid_standing_word(estimate->standing));
}

#endif
