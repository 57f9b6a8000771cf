/* pvid/detail/standing_state.h - the state behind standing.h, of both cores. Not API. */
#ifndef PVID_DETAIL_STANDING_STATE_H
#define PVID_DETAIL_STANDING_STATE_H

#include <stdbool.h>

#include "pvid/standing.h"

/* Only the functions of src/judge/standing.h write to it. */
typedef struct {
    uint32_t fit;         /* mean of the windows' residual variances over their expectation, each at most 3, Q16 */
    uint32_t square;      /* mean of their squares, Q16 */
    pvid_standing now;    /* of the published estimate */
    uint16_t history;     /* a bit for each of the last 16 windows: rows were rejected */
    uint8_t fits;         /* windows in `fit`, since p arrived */
    uint8_t contradicted; /* windows in a row */
    uint8_t valid;        /* valid publications in a row */
    uint8_t silent;       /* windows without a publication since the last one, or the last start */
    uint8_t windows;      /* since the last start */
    uint8_t starts;       /* since p was trusted, or the last 64 windows without one */
    bool contradicts;     /* the candidate of the last solve the published estimate */
    bool grew;            /* its standard errors */
    bool misfit;          /* `fit` is above its limit */
    bool rejects;         /* rows of the present window were rejected */
    bool opened;          /* the gate has opened in the present window */
} pvid_standing_judge;

#endif
