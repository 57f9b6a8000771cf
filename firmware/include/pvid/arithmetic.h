/* pvid/arithmetic.h - tests whether this build computes the promised bits.
 *
 * Equal bits need IEEE-754 binary32, round to nearest even, no fused multiply-add, no reordered sums, no flushing
 * of subnormals. Compiler flags can silently break each of these; a board can test them at start-up. The sources
 * themselves disable fusing, which is gcc's default without -std=c99.
 */
#ifndef PVID_ARITHMETIC_H
#define PVID_ARITHMETIC_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* 0 when float32 behaves as promised, else the sum of:
 *   1 products and sums are fused   2 subnormals are flushed   4 not rounding to nearest even
 *   8 sqrtf is not correctly rounded   16 division is not correctly rounded
 *   32 sums are reordered (-fassociative-math, which -funsafe-math-optimizations brings)
 * The result is valid for the compiler options of the library's sources. */
uint32_t pvid_arithmetic_faults_f32(void);

#ifdef __cplusplus
}
#endif

#endif
