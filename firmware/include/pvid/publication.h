/* pvid/publication.h - an estimate that others read while a tick runs: whole, and without a lock.
 *
 * One context writes (the one that calls step), any number read: an interrupt, the main loop, a thread, another core.
 * There are two copies and a version. A put writes `copy`, makes the version odd, writes `estimate`, makes the version
 * even again; a read takes `copy` while the version is odd and `estimate` while it is even, and begins again if the
 * version has changed meanwhile. So one copy is whole at every instant:
 *
 *   - step in an interrupt, read in the main loop: the read is begun again if an estimate was published meanwhile;
 *   - step in the main loop, read in an interrupt: the read succeeds at once, wherever the put stands;
 *   - threads, several cores: neither waits for the other. With gcc and clang every word is an atomic one, with the
 *     fences between them that other cores need; no data race in the sense of C11.
 *
 * The weak form has this built in (pvid_weak_read_f32). For the strong form, whose estimate is assessed only when asked:
 *
 *   static pvid_publication_f32 shared;                     (all zeros: nothing has been published)
 *   where step is called, every so many ticks:
 *       pvid_estimator_assess_f32(&identifier.estimator, &estimate);
 *       pvid_publication_put_f32(&shared, &estimate);
 *   anywhere:
 *       if (pvid_publication_read_f32(&shared, &estimate, &number) && (number > 0)) ...
 *
 * Compilers other than gcc and clang get volatile accesses, which are enough for one core: an interrupt sees them in
 * the order of the source. So do cores without atomic instructions (Cortex-M0, AVR), which are single ones.
 * RAM: two estimates and 12 bytes.
 */
#ifndef PVID_PUBLICATION_H
#define PVID_PUBLICATION_H

#include <stdbool.h>
#include <stdint.h>

#include "pvid/estimator.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Copies that a read makes before it gives up. Each is lost only to a publication during the copy itself. */
#define PVID_READ_ATTEMPTS 8

/* Only the functions below write to it. */
typedef struct {
    uint32_t version;   /* odd while `estimate` is being written; comes round */
    uint32_t number[2]; /* estimates published so far, as of `estimate` and of `copy`; stops at 2^32 - 1 */
} pvid_publication_mark;

typedef struct {
    pvid_publication_mark mark;
    pvid_estimate_f32 estimate;
    pvid_estimate_f32 copy;
} pvid_publication_f32;

/* Publishes an estimate. For one context alone. Costs two copies of it. */
void pvid_publication_put_f32(pvid_publication_f32 *self, const pvid_estimate_f32 *estimate);

/* Copies the published estimate, whole; *number (or NULL, where nobody asks): how many have been published, 0: none, and
 * the estimate is all zeros. Returns false, with *estimate of no use, iff something was published during each of
 * PVID_READ_ATTEMPTS copies, or a pointer is NULL: try again later. */
bool pvid_publication_read_f32(const pvid_publication_f32 *self, pvid_estimate_f32 *estimate, uint32_t *number);

#ifdef __cplusplus
}
#endif

#endif
