/* What functions of the fixed-point core promise, as contracts. A proof of a module above them takes them for granted
 * and shows that their conditions are met; the proof of their own module shows that they keep them. */
#ifndef CONTRACTS_H
#define CONTRACTS_H

#include "cholesky_q31.h"
#include "integer_q31.h"
#include "scaled_q31.h"

/*@ requires -0x4000000000000000 <= x <= 0x4000000000000000;
    assigns \result \from x, s;
    ensures -0x4000000000000000 <= \result <= 0x4000000000000000; */
int64_t pvid_scale_q31(int64_t x, int32_t s);

/*@ assigns \result \from x;
    ensures 0 <= \result <= 64;
    ensures x <= 0x4000000000000000 ==> \result <= 63; */
uint32_t pvid_bit_length_q31(uint64_t x);

/*@ requires x <= 0x4000000000000000;
    assigns \result \from x;
    ensures \result <= 0x80000000; */
uint32_t pvid_square_root_q31(uint64_t x);

/*@ requires 1 <= x <= 0x7FFFFFFF;
    assigns \result \from x;
    ensures 0x3FFFFFFF <= \result.m <= 0x7FFFFFFF;
    ensures 0 <= \result.k <= 30; */
pvid_reciprocal_q31 pvid_reciprocal_of_q31(uint32_t x);

/*@ requires 0 <= m <= 0x4000000000000000;
    requires -100000 <= exponent <= 100000;
    assigns \result \from m, exponent;
    ensures 0 <= \result.r <= 0x7FFFFFFF;
    ensures -50032 <= \result.e <= 50001; */
pvid_root_q31 pvid_root_of_q31(int64_t m, int32_t exponent);

/*@ requires -0x4000000000000000 <= x <= 0x4000000000000000;
    requires -1000000 <= exponent <= 1000000;
    assigns \result \from x, exponent;
    ensures -0x40000000 <= \result.m <= 0x40000000;
    ensures x >= 1 ==> \result.m >= 0x20000000;
    ensures x >= 0 ==> \result.m >= 0;
    ensures exponent - 30 <= \result.e <= exponent + 34; */
pvid_scaled_q31 pvid_scaled_of_q31(int64_t x, int32_t exponent);

/*@ requires 1 <= n <= PVID_MAX_P && 1 <= bits <= 30;
    requires \valid(out + (0 .. n - 1)) && \valid_read(x + (0 .. n - 1));
    requires \forall integer i; 0 <= i < n ==> -0x4000000000000000 <= x[i] <= 0x4000000000000000;
    assigns \result \from x[0 .. n - 1], bits, n;
    assigns out[0 .. n - 1] \from x[0 .. n - 1], bits, n;
    ensures -30 <= \result <= 62;
    ensures \initialized(out + (0 .. n - 1));
    ensures \forall integer i; 0 <= i < n ==> -0x40000000 <= out[i] <= 0x40000000; */
int32_t pvid_to_block_q31(uint32_t n, const int64_t x[], int32_t bits, int32_t out[]);

#endif
