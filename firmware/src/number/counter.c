#include "pvid/counter.h"

#include <stdbool.h>

/* modulus - part, of 2^32 too; part is above 0. */
static uint32_t rest_of(uint32_t part, uint32_t modulus)
{
    return (modulus != 0u) ? (modulus - part) : (~part + 1u);
}

int32_t pvid_counter_difference(uint32_t before, uint32_t now, uint32_t modulus)
{
    const uint32_t from = (modulus != 0u) ? (before % modulus) : before;
    const uint32_t to = (modulus != 0u) ? (now % modulus) : now;
    const uint32_t up = (to >= from) ? (to - from) : rest_of(from - to, modulus);
    const uint32_t down = (up > 0u) ? rest_of(up, modulus) : 0u;
    const bool forwards = up <= down;
    const uint32_t size = (forwards ? up : down) & 0x7FFFFFFFu;
    const int32_t counts = (int32_t)size;
    return forwards ? counts : -counts;
}
