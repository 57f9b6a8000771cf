/* What pvid_to_block_q31 promises; apart from contracts.h, since its proof runs the functions below it themselves. */
#ifndef BLOCK_CONTRACT_H
#define BLOCK_CONTRACT_H

#include "solve/cholesky_q31.h"

/*@ requires 1 <= n <= PVID_MAX_FUNCTIONS && 1 <= bits <= 30;
    requires \valid(out + (0 .. n - 1)) && \valid_read(x + (0 .. n - 1));
    requires \subset(x[0 .. n - 1], (-0x7FFFFFFFFFFFFFFF .. 0x7FFFFFFFFFFFFFFE));
    assigns \result \from x[0 .. n - 1], bits, n;
    assigns out[0 .. n - 1] \from x[0 .. n - 1], bits, n;
    ensures -30 <= \result <= 62;
    ensures \initialized(out + (0 .. n - 1));
    ensures \subset(out[0 .. n - 1], (-0x40000000 .. 0x40000000));
    ensures bits <= 27 ==> \subset(out[0 .. n - 1], (-0x8000000 .. 0x8000000)); */
int32_t pvid_to_block_q31(uint32_t n, const int64_t x[], int32_t bits, int32_t out[]);

#endif
