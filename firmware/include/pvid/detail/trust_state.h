/* pvid/detail/trust_state.h - the state behind trust.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_TRUST_STATE_H
#define PVID_DETAIL_TRUST_STATE_H

#include "pvid/trust.h"

/* Only the functions of trust.h write to it. */
struct pvid_trust_f32 {
    pvid_trust_config_f32 config;
    uint16_t groups;        /* groups judged; saturates */
    uint16_t uninformative; /* consecutive uninformative groups */
    uint16_t judged;        /* residuals in long_mean; stops at long_memory; none before p is near */
    uint16_t long_memory;
    uint8_t next;      /* place of the next residual in recent */
    bool errors_small; /* the present standard errors are small; otherwise nothing fades */
    bool converged;    /* whether p has settled with small standard errors yet */
    bool published;    /* whether an estimate has been trusted yet */
    bool misfit;
    uint8_t groups_to_fade;   /* groups before which the past is still to fade */
    float anchor[PVID_MAX_P]; /* p at the rows in the sums, or when they last agreed with p */
    float long_mean;          /* of residual variances over their expectation */
    float recent[PVID_TRUST_SHORT];
    pvid_publication_mark mark;
    pvid_estimate_f32 estimate; /* the published one, for the context that calls step */
    pvid_estimate_f32 copy;     /* its second copy, for other contexts: see publication.h */
};

#endif
