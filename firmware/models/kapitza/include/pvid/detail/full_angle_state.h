/* pvid/detail/full_angle_state.h - samples and sums of the full-angle correction. Not API: it may change with any
 * release. */
#ifndef PVID_DETAIL_FULL_ANGLE_STATE_H
#define PVID_DETAIL_FULL_ANGLE_STATE_H

#include "pvid/weak.h"

typedef struct {
    float before; /* the integrand at the last sample */
    float once;
    float twice;
} pvid_weak_integral_f32;

/* The remainder of Y, and the columns of c1 and c2. */
#define PVID_WEAK_REMAINDERS 3

/* Samples of the last windows, and the remainder of the window that is being processed. Only the identifier writes to
 * it. */
struct pvid_weak_angle_f32 {
    uint16_t length; /* places of the ring in use: a window and a hop */
    uint16_t window; /* W */
    uint16_t head;   /* place of the next decimated sample */
    uint16_t first;  /* place of the window's first sample */
    uint16_t place;  /* place of the present sample */
    uint16_t index;  /* index of the present sample in the window, or of the present function */
    uint8_t stage;
    uint8_t pass;
    uint8_t passes;
    uint8_t channels; /* 1, or 3 with friction */
    bool full_angle;
    bool on;       /* the estimate has settled: rows are corrected */
    bool physical; /* p is that of a pendulum */
    float dt;
    float inverse_l1_square; /* of rod 1 [1/m^2] */
    float p[PVID_KAPITZA_P];
    float offset;      /* c */
    float friction[2]; /* c1, c2 */
    float l1;          /* L1 and L2 of p (theory.md 1), not lengths */
    float l2;
    float a; /* unknowns of the window: q = a + b t - ... */
    float b;
    float normal[5]; /* A^T A, A^T B, B^T B, A^T e, B^T e */
    pvid_weak_integral_f32 motion;
    pvid_weak_integral_f32 remainder_integral[PVID_WEAK_REMAINDERS];
    float remainder[PVID_MAX_FUNCTIONS][PVID_WEAK_REMAINDERS];              /* of the last pass */
    float next[PVID_MAX_FUNCTIONS][PVID_WEAK_REMAINDERS];                   /* of this pass */
    float ring[PVID_MAX_WEAK_WINDOW + ((PVID_MAX_WEAK_WINDOW + 1) / 2)][2]; /* phi [rad], u [1/s^2] */
};

#endif
