/* The encoder of the frame codec: any frame, any room. Proved by deduction from the contracts in link.c and
 * little_endian.h, for its place in `out` is bounded by a count of groups of 254, which intervals do not see. That the
 * CRC keeps its contract shows Eva in prove_link.c. */
#include "pvid/crc32.h"

/*@ requires \valid_read(bytes + (0 .. n - 1));
    assigns \result \from crc, bytes[0 .. n - 1]; */
uint32_t pvid_crc32(uint32_t crc, const uint8_t bytes[], size_t n);
