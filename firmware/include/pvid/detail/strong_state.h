/* pvid/detail/strong_state.h - the state behind strong.h. Not API: it may change with any release. */
#ifndef PVID_DETAIL_STRONG_STATE_H
#define PVID_DETAIL_STRONG_STATE_H

#include "pvid/strong.h"

struct pvid_strong_f32 {
    pvid_differentiator_f32 phi;
    pvid_differentiator_f32 y;
    float inverse_l1;       /* [1/m] */
    float drive;            /* mean square of u over about a second [1/s^4] */
    float drive_forgetting; /* share of a tick in this mean */
    float drive_min;        /* mean square of u below which no row is used */
    bool frozen;
    bool alarm; /* the last block of rows was a misfit: see misfit.h */
    pvid_gate_f32 gate;
    pvid_misfit_f32 misfit;
    pvid_estimator_f32 estimator;
};

#endif
