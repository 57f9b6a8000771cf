/* pvid_scaled_of_q31: every number within PVID_WIDE, an octave at a time; the exponent, which is but added to, at its
 * ends and in the middle. */
#include "prove.h"

#include "contracts.h"

/* Both signs of all numbers of `bits` bits. */
static void any_number(uint32_t bits, int32_t exponent)
{
    const int64_t low = (bits == 0u) ? 0 : ((int64_t)1 << (bits - 1u));
    const int64_t high = (bits == 0u) ? 0 : (low + (low - 1));
    const int64_t x = (bits > 62u) ? PVID_WIDE : any_i64(low, high);
    (void)pvid_scaled_of_q31(x, exponent);
    (void)pvid_scaled_of_q31(-x, exponent);
}

void main(void)
{
    for (uint32_t bits = 0; bits <= 63u; bits++) {
        any_number(bits, -1000000);
        any_number(bits, 0);
        any_number(bits, 1000000);
    }
}
