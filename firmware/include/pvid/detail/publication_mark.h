/* pvid/detail/publication_mark.h - version of a published estimate's two copies; see publication.h. Not API. */
#ifndef PVID_DETAIL_PUBLICATION_MARK_H
#define PVID_DETAIL_PUBLICATION_MARK_H

#include <stdint.h>

typedef struct {
    uint32_t version;   /* odd while `estimate` is being written; wraps at 2^32 */
    uint32_t number[2]; /* of estimates published so far, for `estimate` and for `copy`; stops at 2^32 - 1 */
} pvid_publication_mark;

#endif
