#include "solve/kinds.h"

/* Entries of the upper triangle of a block. */
static size_t moments_of(size_t n)
{
    return (n * (n + 1u)) / 2u;
}

void pvid_block_among_kinds(size_t n_kinds, const uint8_t kind_end[], size_t i, pvid_block *block)
{
    size_t first = 0;
    size_t moment = 0;
    size_t kind = 0;
    while (((kind + 1u) < n_kinds) && (i >= kind_end[kind])) {
        moment += moments_of(kind_end[kind] - first);
        first = kind_end[kind];
        kind++;
    }
    block->first = first;
    block->n = kind_end[kind] - first;
    block->moment = moment;
}

size_t pvid_kinds_moments(size_t n_theta, size_t n_kinds, const uint8_t *kind_end)
{
    if (n_kinds <= 1u) {
        return moments_of(n_theta);
    }
    size_t moments = 0;
    size_t first = 0;
    bool ascends = kind_end != NULL;
    for (size_t kind = 0; (kind < n_kinds) && ascends; kind++) {
        ascends = kind_end[kind] > first;
        moments += ascends ? moments_of(kind_end[kind] - first) : 0u;
        first = kind_end[kind];
    }
    return (ascends && (first == n_theta)) ? moments : 0u;
}
