#include "pvid/counter.h"

#include <stdbool.h>

int32_t pvid_counter_difference(uint32_t before, uint32_t now, uint32_t modulus)
{
    const uint32_t from = (modulus != 0u) ? (before % modulus) : before;
    const uint32_t to = (modulus != 0u) ? (now % modulus) : now;
    const uint32_t up = (to >= from) ? (to - from) : ((modulus - from) + to);
    const uint32_t down = modulus - up; /* of 2^32 too */
    const bool forwards = (up == 0u) || (up <= down);
    const uint32_t size = (forwards ? up : down) & 0x7FFFFFFFu;
    const int32_t counts = (int32_t)size;
    return forwards ? counts : -counts;
}
