/* The frames of the fixed-point core: settings of the estimator, and an estimate. */
#ifndef FRAMES_Q31_H
#define FRAMES_Q31_H

#include <string.h>

#include "identifier.h"
#include "pvid/estimator_q31.h"
#include "pvid/little_endian.h"

static inline void get_integers(int32_t to[], const uint8_t from[])
{
    for (size_t i = 0; i < STREAM_N_P; i++) {
        to[i] = pvid_get_i32(&from[4u * i]);
    }
}

static inline void get_estimator_config(pvid_estimator_config_q31 *estimator,
                                        const uint8_t payload[PVID_CONFIGURE_Q31_BYTES])
{
    get_integers(estimator->start, &payload[PVID_CONFIGURE_Q31_START]);
    get_integers(estimator->start_sd, &payload[PVID_CONFIGURE_Q31_START_SD]);
    get_integers(estimator->lower, &payload[PVID_CONFIGURE_Q31_LOWER]);
    get_integers(estimator->upper, &payload[PVID_CONFIGURE_Q31_UPPER]);
    estimator->row_sd = pvid_get_i32(&payload[PVID_CONFIGURE_Q31_ROW_SD]);
    estimator->forgetting_groups = pvid_get_u32(&payload[PVID_CONFIGURE_Q31_FORGETTING_GROUPS]);
    estimator->gain = pvid_get_i32(&payload[PVID_CONFIGURE_Q31_GAIN]);
    estimator->divider = pvid_get_u16(&payload[PVID_CONFIGURE_Q31_DIVIDER]);
}

static inline void put_estimate(uint8_t payload[PVID_ESTIMATE_Q31_BYTES], const pvid_estimate_q31 *estimate,
                                uint32_t session, uint32_t updates, pvid_reason reason)
{
    memset(payload, 0, PVID_ESTIMATE_Q31_BYTES);
    pvid_put_u32(&payload[PVID_ESTIMATE_Q31_SESSION], session);
    pvid_put_u32(&payload[PVID_ESTIMATE_Q31_UPDATES], updates);
    size_t at = PVID_ESTIMATE_Q31_CORRELATION;
    for (size_t i = 0; i < PVID_LINK_P; i++) {
        for (size_t j = i; j < PVID_LINK_P; j++) {
            if (j < STREAM_N_P) {
                pvid_put_i32(&payload[at], estimate->correlation[i][j]);
            }
            at += 4u;
        }
        if (i < STREAM_N_P) {
            pvid_put_i32(&payload[PVID_ESTIMATE_Q31_P + (4u * i)], estimate->p[i]);
            pvid_put_i32(&payload[PVID_ESTIMATE_Q31_SE + (4u * i)], estimate->se[i]);
        }
    }
    pvid_put_i32(&payload[PVID_ESTIMATE_Q31_KAPPA], estimate->kappa);
    pvid_put_i32(&payload[PVID_ESTIMATE_Q31_RESIDUAL_SD], estimate->residual_sd);
    pvid_put_u32(&payload[PVID_ESTIMATE_Q31_WEIGHT], estimate->weight);
    payload[PVID_ESTIMATE_Q31_REASON] = (uint8_t)reason;
    pvid_put_u32(&payload[PVID_ESTIMATE_Q31_STANDING], pvid_standing_word(estimate->standing));
}

#endif
