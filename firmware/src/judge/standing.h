/* The standing of a published estimate, and when p starts again, for both cores. Private to the core. */
#ifndef PVID_JUDGE_STANDING_H
#define PVID_JUDGE_STANDING_H

#include <stdbool.h>

#include "pvid/detail/standing_state.h"

/* An estimate contradicts the published one if it differs by more than so many joint standard errors. */
#define PVID_STANDING_AWAY 5

/* Its standard errors have grown if they are more than so many times those that were published. */
#define PVID_STANDING_GROWN 3

/* Largest variance ratio that counts, Q16: many windows that fit badly are a misfit, a few that do not fit at all are
 * outliers, which the scatter of the windows covers. */
#define PVID_STANDING_CLIP ((uint32_t)3 << 16)

/* What a window has shown, all of its rows and the solves behind it. */
typedef struct {
    bool published;
    bool solved;      /* its data determine p */
    bool arrived;     /* p has converged */
    bool judges;      /* there is a limit of misfit */
    bool errs;        /* the residuals were taken for a larger error of an equation than the design's */
    uint16_t freedom; /* rows less nuisances */
    uint16_t age_max; /* of the configuration */
    uint32_t own;     /* part of the expectation that is the equations' own errors, Q16, 0..1 */
    uint32_t ratio;   /* residual variance over its expectation, Q16, at most PVID_STANDING_CLIP */
} pvid_standing_window;

/* A window that is not used: all of its rows were rejected by the gate, or it was dropped. age_max: windows; 0: none.
 */
void pvid_standing_skip(pvid_standing_judge *self, bool rejected, uint16_t age_max);

/* Of the ticks since windows were counted last, those that are not in the age, behind a window of `window` ticks that
 * is, or that was published. */
static inline uint32_t pvid_standing_uncounted(const pvid_standing_judge *self, uint32_t ticks, uint32_t window)
{
    return ((self->now.age > 0u) && (ticks > window)) ? (ticks - window) : 0u;
}

/* Behind a window that is used, and was compared (contradicts, grew). Returns whether p is trusted as a start: eight
 * valid publications in a row. */
bool pvid_standing_take(pvid_standing_judge *self, const pvid_standing_window *window);

/* Whether p has to start again behind this window: the gate has opened, or twelve windows led to no publication
 * although p does not fit them or cannot be solved for. Then *number is that of the start. At most six starts in a row.
 */
bool pvid_standing_starts(pvid_standing_judge *self, bool solved, uint8_t *number);

/* x of start `number`, 0..2^16: the factor on positive parameter `a` of the trusted p is (2^16 + 3 x) / (2^18 - 3 x),
 * 1/4..4, spread evenly over the starts; 1 in the first and the last. */
uint32_t pvid_standing_spread(uint8_t number, uint32_t a);

#endif
