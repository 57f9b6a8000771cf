/* pvid/detail/trust_state_q31.h - the state behind trust_q31.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_TRUST_STATE_Q31_H
#define PVID_DETAIL_TRUST_STATE_Q31_H

#include "pvid/trust_q31.h"
#include "pvid/detail/standing_state.h"

/* Only the functions of trust_q31.h write to it. */
struct pvid_trust_q31 {
    int64_t long_mean; /* of the variance ratios of the groups, PVID_VARIANCE_RATIO_BITS */
    pvid_trust_config_q31 config;
    uint16_t groups;        /* groups judged; saturates */
    uint16_t uninformative; /* consecutive uninformative groups */
    uint16_t judged;        /* groups in long_mean; stops at long_memory; 0 until p has converged */
    uint16_t long_memory;
    uint8_t next;           /* place of the next group in `recent` */
    uint8_t groups_to_fade; /* remaining groups of a renewal: before each the sums are multiplied by a factor */
    bool anew;              /* the sums begin anew with the next group */
    bool arrived;           /* the last step of p was small beside its standard error */
    bool errors_small;      /* the present standard errors are small; otherwise a renewal waits */
    bool converged;         /* p has once settled with small standard errors */
    bool published;         /* an estimate has been published */
    bool misfit;
    int32_t anchor[PVID_MAX_P];       /* p at which the rows in the sums last agreed with p, or at the last renewal */
    int32_t recent[PVID_TRUST_SHORT]; /* those of the last groups, rounded to 2^-10 */
    int32_t trusted[PVID_MAX_P];      /* p behind several valid publications in a row; the start before */
    int32_t own[PVID_MAX_P];          /* standard errors of the published estimate without the shared ones */
    pvid_standing_judge standing;
    pvid_publication_mark mark;
    pvid_estimate_q31 estimate; /* the published one, for the context that calls step */
    pvid_estimate_q31 copy;     /* its second copy, for other contexts: see publication.h */
};

#endif
