/* pvid/detail/trust_state.h - the state behind trust.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_TRUST_STATE_H
#define PVID_DETAIL_TRUST_STATE_H

#include "pvid/trust.h"
#include "pvid/detail/standing_state.h"

/* Only the functions of trust.h write to it. */
struct pvid_trust_f32 {
    pvid_trust_config_f32 config;
    uint16_t groups;                /* groups judged; saturates */
    uint16_t uninformative;         /* consecutive uninformative groups */
    uint16_t judged;                /* groups in long_mean; stops at long_memory; 0 until p has converged */
    uint16_t long_memory;           /* most groups in long_mean */
    uint8_t next;                   /* place of the next group in `recent` */
    bool errors_small;              /* the present standard errors are small; otherwise a renewal waits */
    bool converged;                 /* p has once settled with small standard errors */
    bool published;                 /* an estimate has been published */
    bool misfit;                    /* the alarm is raised */
    uint8_t groups_to_fade;         /* remaining groups of a renewal: before each the sums are multiplied by a factor */
    bool anew;                      /* the sums begin anew with the next group */
    bool arrived;                   /* the last step of p was small beside its standard error */
    float anchor[PVID_MAX_P];       /* p at which the rows in the sums last agreed with p, or at the last renewal */
    float long_mean;                /* of the variance ratios (residual variance over its expectation) of the groups */
    float recent[PVID_TRUST_SHORT]; /* variance ratios of the last groups */
    float trusted[PVID_MAX_P];      /* p behind several valid publications in a row; the start before */
    float own[PVID_MAX_P];          /* standard errors of the published estimate without the shared ones */
    pvid_standing_judge standing;
    pvid_publication_mark mark;
    pvid_estimate_f32 estimate; /* the published one, for the context that calls step */
    pvid_estimate_f32 copy;     /* its second copy, for other contexts: see publication.h */
};

#endif
