/* pvid_to_block_q31: blocks of two numbers, of p, of the test functions; any number of bits, any entries: one of them,
 * the first or the last (the loop treats all alike), is of the greatest length, which is each in turn. */
#include "prove.h"

#include "block_contract.h"

static void any_block(uint32_t n, uint32_t place, uint32_t length, bool negative)
{
    int64_t x[PVID_MAX_FUNCTIONS];
    int32_t out[PVID_MAX_FUNCTIONS];
    const int64_t low = (length == 0u) ? 0 : ((int64_t)1 << (length - 1u));
    const int64_t end = (length == 0u) ? 0 : (low + (low - 1));
    const int64_t high = (length == 63u) ? (end - 1) : end;
    for (uint32_t i = 0; i < n; i++) {
        x[i] = any_i64(-high, high);
    }
    const int64_t longest = any_i64(low, high);
    x[place] = negative ? -longest : longest;
    (void)pvid_to_block_q31(n, x, any_i32(1, 27), out);
    (void)pvid_to_block_q31(n, x, any_i32(28, 30), out);
}

void main(void)
{
    static const uint32_t sizes[] = {2, PVID_MAX_P, PVID_MAX_FUNCTIONS};
    for (size_t k = 0; k < (sizeof sizes / sizeof sizes[0]); k++) {
        for (uint32_t length = 0; length <= 63u; length++) {
            for (uint32_t negative = 0; negative < 2u; negative++) {
                any_block(sizes[k], 0, length, negative == 1u);
                any_block(sizes[k], sizes[k] - 1u, length, negative == 1u);
            }
        }
    }
}
