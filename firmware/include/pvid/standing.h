/* pvid/standing.h - whether a published estimate still holds.
 *
 * trust.h decides what is published; what has been published stays until the next one. Behind every window the core
 * compares it with what the data show now:
 *
 *   PVID_STANDING_NONE       no estimate that has been compared with PVID_STANDING_WINDOWS windows
 *   PVID_STANDING_VALID      use it with its standard errors
 *   PVID_STANDING_DOUBTED    something speaks against it: `causes`
 *   PVID_STANDING_WITHDRAWN  do not use it: the data contradict it, or the mechanism has changed
 *
 * A publication without a cause makes it valid again. The estimate contains its standing (`estimate.standing`), which
 * is new behind every window, also without a publication; in float32 one stage behind the estimate itself:
 *
 *   if (pvid_weak_read_f32(&identifier, &estimate, NULL) && (estimate.standing.state == PVID_STANDING_VALID)) ...
 */
#ifndef PVID_STANDING_H
#define PVID_STANDING_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Windows that an estimate is compared with before it is valid. */
#define PVID_STANDING_WINDOWS 8u

typedef enum {
    PVID_STANDING_NONE = 0,
    PVID_STANDING_VALID = 1,
    PVID_STANDING_DOUBTED = 2,
    PVID_STANDING_WITHDRAWN = 3
} pvid_standing_state;

/* Causes, one bit each. */
typedef enum {
    PVID_DOUBT_CONTRADICTED = 1, /* the present estimate is more than 5 joint standard errors away, twice in a row */
    PVID_DOUBT_GREW = 2,         /* its standard errors are more than 3 times those that were published */
    PVID_DOUBT_MISFIT = 4,       /* the residuals of most windows are larger than the sensors' noise explains */
    PVID_DOUBT_REJECTS = 8,      /* the gate rejected rows of the last 3 windows, or of 6 of the last 16 */
    PVID_DOUBT_CHANGED = 16,     /* the gate has opened to a changed mechanism: p starts again */
    PVID_DOUBT_AGED = 32         /* no publication in the last `age_max` windows (trust.h) */
} pvid_doubt;

typedef struct {
    uint16_t age;   /* windows since the publication, whether they counted or not; where rejected samples and gaps cut
                       them, as many as their ticks make; stops at 65535 */
    uint8_t state;  /* pvid_standing_state */
    uint8_t causes; /* of pvid_doubt, while it is doubted or withdrawn; 0: none */
} pvid_standing;

/* The standing as one word of a log: age + 2^16 state + 2^24 causes. */
static inline uint32_t pvid_standing_word(pvid_standing standing)
{
    return standing.age | ((uint32_t)standing.state << 16u) | ((uint32_t)standing.causes << 24u);
}

#ifdef __cplusplus
}
#endif

#endif
