/* The code shared by the publications of both cores: two copies of an object and a mark. Private to the core. */
#ifndef PVID_PUBLICATION_WORDS_H
#define PVID_PUBLICATION_WORDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/detail/publication_mark.h"

/* Writes `bytes` bytes of `fresh` to both copies, in the order that readers need. bytes: a multiple of 4.
 * number: estimates published so far, this one included. */
void pvid_publication_write(pvid_publication_mark *mark, void *estimate, void *copy, const void *fresh, size_t bytes,
                            uint32_t number);

/* Reads the consistent copy into `out`. False iff a put happened during each of PVID_READ_ATTEMPTS attempts. number
 * may be NULL. */
bool pvid_publication_read(const pvid_publication_mark *mark, const void *estimate, const void *copy, void *out,
                           size_t bytes, uint32_t *number);

#endif
