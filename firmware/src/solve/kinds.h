/* Blocks of M by the kinds of rows (model.h), for both cores. A row of one kind has entries in one range of theta, so M
 * consists of a dense block a kind, stored as packed upper triangles behind each other. Private to the core. */
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

/* The block that contains entry i of theta, for several kinds. */
void pvid_block_among_kinds(size_t n_kinds, const uint8_t kind_end[], size_t i, pvid_block *block);

/* Number of moments of all blocks; 0 if kind_end is missing, does not ascend or does not end with n_theta. For one kind
 * kind_end is not read. */
size_t pvid_kinds_moments(size_t n_theta, size_t n_kinds, const uint8_t *kind_end);

/* Number of kinds: at least 1. */
static inline size_t pvid_kinds_count(size_t n_kinds)
{
    return (n_kinds > 1u) ? n_kinds : 1u;
}

/* First entry of theta of a kind that exists. */
static inline size_t pvid_kind_first(const uint8_t *kind_end, size_t kind)
{
    return (kind > 0u) ? kind_end[kind - 1u] : 0u;
}

#endif
