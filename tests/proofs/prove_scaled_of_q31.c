/* pvid_scaled_of_q31: every number within PVID_WIDE, an octave at a time. */
#include "prove.h"

#include "contracts.h"

/* Both signs of all numbers of `bits` bits. */
static void any_number(uint32_t bits)
{
    const int64_t low = (bits == 0u) ? 0 : ((int64_t)1 << (bits - 1u));
    const int64_t high = (bits == 0u) ? 0 : (low + (low - 1));
    const int64_t x = (bits > 62u) ? PVID_WIDE : any_i64(low, high);
    (void)pvid_scaled_of_q31(x, any_i32(-20000, 20000));
    (void)pvid_scaled_of_q31(-x, any_i32(-20000, 20000));
}

void main(void)
{
    for (uint32_t bits = 0; bits <= 63u; bits++) {
        any_number(bits);
    }
}
