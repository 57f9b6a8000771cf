/* pvid/detail/kapitza_strong_state_q31.h - the state behind kapitza_strong_q31.h. Not API: it may change with any
 * release. */
#ifndef PVID_DETAIL_KAPITZA_STRONG_STATE_Q31_H
#define PVID_DETAIL_KAPITZA_STRONG_STATE_Q31_H

#include "pvid/kapitza_strong_q31.h"

/* 57 moments and the weight of the rows (Q16). */
#define PVID_KAPITZA_SUMS_Q31 58

/* Only the functions of kapitza_strong_q31.h write to it. */
struct pvid_kapitza_estimator_q31 {
    int64_t sums[PVID_KAPITZA_SUMS_Q31]; /* the moments are divided by 4^exponent */
    int64_t fresh[PVID_KAPITZA_P];       /* sum of gradient times e since the last solve; only while g < 1 */
    int32_t p[PVID_KAPITZA_P];
    int32_t reference; /* w_r in the format of w */
    int32_t retention; /* factor on the past, Q31; 2^31 - 1: everything is kept */
    uint16_t block;    /* rows between two forgettings */
    uint16_t age;      /* rows since the last one */
    uint16_t divider;
    uint16_t phase; /* rows since the last solve */
    uint8_t exponent;
    int8_t bits[2]; /* of d1 and d2, so that a product with -G^k phi'' or -G^k phi is in units of Y */
    bool ready;     /* init has accepted a configuration */
    pvid_solve_settings_q31 settings;
    pvid_counters counters;
};

#endif
