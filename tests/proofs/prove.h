/* What the proofs share: arbitrary values within bounds, for Eva. Included by the programs of this folder only. */
#ifndef PROVE_H
#define PROVE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "__fc_builtin.h"

/* Any whole number of lowest..highest, each time another. */
static inline int64_t any_i64(int64_t lowest, int64_t highest)
{
    return (int64_t)Frama_C_long_long_interval(lowest, highest);
}

static inline int32_t any_i32(int32_t lowest, int32_t highest)
{
    return (int32_t)Frama_C_interval(lowest, highest);
}

static inline uint32_t any_u32(uint32_t lowest, uint32_t highest)
{
    return Frama_C_unsigned_int_interval(lowest, highest);
}

static inline bool any_bool(void)
{
    return Frama_C_interval(0, 1) != 0;
}

#endif
