/* pvid/detail/weak_job.h - position of the weak form's front end, for both cores.
 *
 * Samples are in a ring; every `decimation` samples a block is complete, and its FIR job runs in parts, outwards
 * from the centre, while the next samples arrive.
 */
#ifndef PVID_DETAIL_WEAK_JOB_H
#define PVID_DETAIL_WEAK_JOB_H

#include <stdint.h>

typedef struct {
    uint16_t half;   /* pairs of taps */
    uint16_t length; /* places of the ring in use, taps + decimation - 1: a job may last a whole block */
    uint16_t decimation;
    uint16_t pairs_per_tick; /* pairs per tick, such that a job lasts half a block */
    uint16_t head;           /* place of the next sample */
    uint16_t wait;           /* samples until the next block is complete */
    uint16_t pair;           /* pairs done; half: the job is done */
    uint16_t newer;          /* places of the last pair */
    uint16_t older;
} pvid_weak_job;

#endif
