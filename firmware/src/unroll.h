/* Asks gcc to write out a loop of constant length at -O2 too: the loop's own bookkeeping costs more
 * than the two operations inside. clang does so unasked. Changes no result. */
#ifndef PVID_UNROLL_H
#define PVID_UNROLL_H

#if defined(__GNUC__) && (__GNUC__ >= 8) && !defined(__clang__)
#define PVID_UNROLL _Pragma("GCC unroll 16")
#else
#define PVID_UNROLL
#endif

#endif
