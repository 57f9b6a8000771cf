/* Asks for a loop of constant length to be written out, also at -O2 where gcc would not: there the
 * loop's own bookkeeping costs more than the two operations inside. Changes no result. */
#ifndef PVID_UNROLL_H
#define PVID_UNROLL_H

#if defined(__clang__)
#define PVID_UNROLL _Pragma("clang loop unroll(full)")
#elif defined(__GNUC__) && (__GNUC__ >= 8)
#define PVID_UNROLL _Pragma("GCC unroll 16")
#else
#define PVID_UNROLL
#endif

#endif
