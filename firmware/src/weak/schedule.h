/* The schedule of the weak form: the work of a tick by its place in a block, for both cores. Private to the core.
 *
 * A block has D ticks. Its first half runs the front end's FIR job; its second half adds the result to the two
 * windows. The stages of a complete window run in the ticks that add nothing.
 */
#ifndef PVID_WEAK_SCHEDULE_H
#define PVID_WEAK_SCHEDULE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/config.h"
#include "pvid/status.h"
#include "pvid/detail/weak_job.h"

/* Largest number of stages per tick. One is the rule. More are needed only if a hop has fewer free ticks than a window
 * has stages: short windows, low decimation, the correction for large angles. The longest tick grows with them. */
#define PVID_STAGES_PER_TICK_MAX 32u

static inline bool pvid_is_odd_within(uint16_t n, uint16_t low, uint16_t high)
{
    return ((n % 2u) == 1u) && (n >= low) && (n <= high);
}

/* Checks the sizes of a design: the status names the first one out of range. */
static inline pvid_status pvid_weak_sizes(uint16_t taps, uint16_t decimation, uint16_t window, uint8_t functions,
                                          uint8_t most_functions, uint8_t lag)
{
    if (!pvid_is_odd_within(taps, 5, PVID_MAX_TAPS)) {
        return PVID_BAD_TAPS;
    }
    if ((decimation < 1u) || (decimation > PVID_MAX_DECIMATION)) {
        return PVID_BAD_DECIMATION;
    }
    if (!pvid_is_odd_within(window, 9, PVID_MAX_WEAK_WINDOW)) {
        return PVID_BAD_WINDOW;
    }
    if ((functions < 4u) || (functions > most_functions)) {
        return PVID_BAD_FUNCTIONS;
    }
    return (lag < 1u) ? PVID_BAD_LAG : PVID_OK;
}

/* Decimated samples from the start of a window to the start of the next. */
static inline uint16_t pvid_weak_hop(uint16_t window)
{
    return (uint16_t)((window - 1u) / 2u);
}

/* Functions of a window to which a tick adds the present decimated sample. Two windows share the second half of a
 * block. At D = 2 one tick adds to both windows; at D = 1 the tick of the front end does. */
static inline uint8_t pvid_weak_functions_per_tick(uint32_t decimation, uint32_t functions)
{
    const uint32_t second_half = decimation - (decimation / 2u);
    const uint32_t ticks = (second_half > 1u) ? (second_half / 2u) : 1u;
    return (uint8_t)((functions + (ticks - 1u)) / ticks);
}

/* Ticks of a block that are free for a window's stages. */
static inline uint32_t pvid_weak_free_ticks(uint32_t decimation, uint32_t functions)
{
    if (decimation <= 2u) {
        return 1u;
    }
    const uint32_t functions_per_tick = pvid_weak_functions_per_tick(decimation, functions);
    return decimation - (2u * ((functions + (functions_per_tick - 1u)) / functions_per_tick));
}

/* Fewest stages per tick that finish a window before the next one is complete; 0: more than PVID_STAGES_PER_TICK_MAX.
 */
static inline uint8_t pvid_weak_stages_per_tick(uint32_t stages, uint16_t window, uint32_t decimation,
                                                uint32_t functions)
{
    const uint32_t free = pvid_weak_hop(window) * pvid_weak_free_ticks(decimation, functions);
    const uint32_t stages_per_tick = (stages + (free - 1u)) / free;
    return (uint8_t)((stages_per_tick <= PVID_STAGES_PER_TICK_MAX) ? stages_per_tick : 0u);
}

/* ---- the front end's job ---- */

/* Empty ring, no job. */
static inline void pvid_weak_job_reset(pvid_weak_job *self)
{
    self->head = 0;
    self->wait = (uint16_t)((2u * self->half) + 1u);
    self->pair = self->half;
}

static inline void pvid_weak_job_init(pvid_weak_job *self, uint16_t taps, uint16_t decimation)
{
    self->half = (uint16_t)((taps - 1u) / 2u);
    self->length = (uint16_t)((taps + decimation) - 1u);
    self->decimation = decimation;
    const uint32_t ticks = (decimation > 1u) ? (decimation / 2u) : 1u;
    self->pairs_per_tick = (uint16_t)((self->half + (ticks - 1u)) / ticks);
    self->newer = 0;
    self->older = 0;
    pvid_weak_job_reset(self);
}

/* Ticks that a job takes. */
static inline uint16_t pvid_weak_job_ticks(const pvid_weak_job *self)
{
    return (uint16_t)((self->half + (self->pairs_per_tick - 1u)) / self->pairs_per_tick);
}

/* Counts the sample at place `head` of the ring. Returns true if it completes a block: then a job begins, and `newer`
 * and `older` are the place of the block's centre. */
static inline bool pvid_weak_job_begins(pvid_weak_job *self)
{
    self->head = (uint16_t)((self->head + 1u == self->length) ? 0u : (self->head + 1u));
    self->wait--;
    if (self->wait > 0u) {
        return false;
    }
    self->wait = self->decimation;
    /* the newest sample is before head, the centre `half` before that */
    const uint16_t back = (uint16_t)(self->half + 1u);
    const uint16_t centre =
        (uint16_t)((self->head >= back) ? (self->head - back) : ((self->head + self->length) - back));
    self->pair = 0;
    self->newer = centre;
    self->older = centre;
    return true;
}

/* One past the last pair of this tick. */
static inline size_t pvid_weak_job_end(const pvid_weak_job *self)
{
    const size_t left = (size_t)self->half - self->pair;
    return self->pair + ((left < self->pairs_per_tick) ? left : self->pairs_per_tick);
}

/* Most contiguous runs of a tick's pairs. The ring is longer than both halves of the filter together: at most one of
 * `newer` and `older` crosses an end of the ring, and only once. */
#define PVID_WEAK_JOB_RUNS 2u

/* Moves to the next pair outwards. Returns the number of pairs from there on, at most `left`, that are contiguous in
 * the ring. */
static inline size_t pvid_weak_job_outwards(const pvid_weak_job *self, size_t left, size_t *newer, size_t *older)
{
    const size_t length = self->length;
    *newer = (*newer + 1u == length) ? 0u : (*newer + 1u);
    *older = (*older == 0u) ? (length - 1u) : (*older - 1u);
    const size_t ahead = length - *newer;
    const size_t behind = *older + 1u;
    const size_t room = (ahead < behind) ? ahead : behind;
    return (left < room) ? left : room;
}

#endif
