/* What publications of both cores share: two copies of an object and a mark. Private to the core. */
#ifndef PVID_PUBLICATION_WORDS_H
#define PVID_PUBLICATION_WORDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pvid/publication.h"

/* Writes the `bytes` bytes of `fresh` to both places, in the order that readers rely on. bytes: whole words of 32 bits.
 * number: of estimates published with it. */
void pvid_publication_write(pvid_publication_mark *mark, void *estimate, void *copy, const void *fresh, size_t bytes,
                            uint32_t number);

/* Reads the one that is whole into `out`; false: PVID_READ_ATTEMPTS copies were overtaken. number may be NULL. */
bool pvid_publication_read(const pvid_publication_mark *mark, const void *estimate, const void *copy, void *out,
                           size_t bytes, uint32_t *number);

#endif
