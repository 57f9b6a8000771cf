/* Blocks of M by the kinds of rows (model.h), for both cores. A row of one kind has entries in one range of theta, so M
 * consists of a dense block a kind, stored as packed upper triangles behind each other. Private to the core, inlined.
 */
#ifndef PVID_SOLVE_KINDS_H
#define PVID_SOLVE_KINDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The block of a kind: its first entry of theta, its number of entries and the place of its first moment. */
typedef struct {
    size_t first;
    size_t n;
    size_t moment;
} pvid_block;

/* Number of entries of the upper triangle of a block. */
static inline size_t pvid_block_moments(size_t n)
{
    return (n * (n + 1u)) / 2u;
}

/* The block that contains entry i of theta. n_kinds and kind_end: model.h. */
static inline pvid_block pvid_block_of_entry(size_t n_theta, size_t n_kinds, const uint8_t kind_end[], size_t i)
{
    pvid_block block = {0, n_theta, 0};
    if (n_kinds > 1u) {
        block.n = kind_end[0];
        for (size_t kind = 1; (kind < n_kinds) && (i >= kind_end[kind - 1u]); kind++) {
            block.moment += pvid_block_moments(block.n);
            block.first += block.n;
            block.n = (size_t)kind_end[kind] - block.first;
        }
    }
    return block;
}

/* The block of a kind, kind < n_kinds or 0. */
static inline pvid_block pvid_block_of_kind(size_t n_theta, size_t n_kinds, const uint8_t kind_end[], size_t kind)
{
    return pvid_block_of_entry(n_theta, n_kinds, kind_end, (kind > 0u) ? kind_end[kind - 1u] : 0u);
}

/* Whether a row may be of this kind. */
static inline bool pvid_kind_exists(size_t n_kinds, size_t kind)
{
    return kind < ((n_kinds > 1u) ? n_kinds : 1u);
}

/* Number of moments of all blocks; 0 if kind_end is missing, does not ascend or does not end with n_theta. */
static inline size_t pvid_kinds_moments(size_t n_theta, size_t n_kinds, const uint8_t *kind_end)
{
    if (n_kinds <= 1u) {
        return pvid_block_moments(n_theta);
    }
    size_t moments = 0;
    size_t first = 0;
    if (kind_end == NULL) {
        return 0;
    }
    for (size_t kind = 0; kind < n_kinds; kind++) {
        if (kind_end[kind] <= first) {
            return 0;
        }
        moments += pvid_block_moments(kind_end[kind] - first);
        first = kind_end[kind];
    }
    return (first == n_theta) ? moments : 0u;
}

#endif
