/* pvid/publication.h - passes estimates from the context of step to other contexts, consistently and without a
 * lock.
 *
 * One context writes (the one that calls step). Any number of contexts read: interrupts, main loop, threads,
 * cores. There are two copies and a version number. A put writes `copy`, makes the version odd, writes `estimate`
 * and makes the version even again. A read copies `copy` while the version is odd and `estimate` while it is even,
 * and repeats if the version has changed meanwhile. One of the two copies is consistent at every instant:
 *
 *   - step in an interrupt, read in the main loop: the read repeats if an estimate was published meanwhile;
 *   - step in the main loop, read in an interrupt: the read succeeds at the first attempt, even in the middle of a
 *     put;
 *   - threads, several cores: neither blocks the other. With gcc and clang every access to a word is atomic, with
 *     memory fences for other cores; there is no data race in the sense of C11.
 *
 * The weak form contains a publication (pvid_weak_read_f32). The estimator computes an estimate only on request:
 *
 *   static pvid_publication_f32 shared;                     (all zeros: nothing has been published)
 *   in the context that calls step, every N ticks:
 *       pvid_estimator_assess_f32(&estimator, &estimate);       (of a strong form NAME_strong_assess_f32)
 *       pvid_publication_put_f32(&shared, &estimate);
 *   in any context:
 *       if (pvid_publication_read_f32(&shared, &estimate, &number) && (number > 0)) ...
 *
 * Other compilers use volatile accesses, which suffice on one core: an interrupt sees them in source order. Cores
 * without atomic instructions (Cortex-M0, AVR) use them too. RAM: two estimates and 12 bytes.
 */
#ifndef PVID_PUBLICATION_H
#define PVID_PUBLICATION_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/detail/publication_mark.h"
#include "pvid/estimator.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Only the functions below write to it. */
typedef struct {
    pvid_publication_mark mark;
    pvid_estimate_f32 estimate;
    pvid_estimate_f32 copy;
} pvid_publication_f32;

/* Publishes an estimate. Call it from one context only. Cost: two copies of the estimate. */
void pvid_publication_put_f32(pvid_publication_f32 *self, const pvid_estimate_f32 *estimate);

/* Copies the published estimate consistently. *number: estimates published so far, 0: none, *estimate is zero; may
 * be NULL. Fails iff
 *   - an estimate was published during each of PVID_READ_ATTEMPTS attempts (call it again later), or
 *   - `self` or `estimate` is NULL.
 *
 * On failure *estimate is undefined. */
bool pvid_publication_read_f32(const pvid_publication_f32 *self, pvid_estimate_f32 *estimate, uint32_t *number);

#ifdef __cplusplus
}
#endif

#endif
