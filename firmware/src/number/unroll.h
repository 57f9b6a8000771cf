/* Loop unrolling, which gcc does at -O2 only on request, functions that are not inlined or for little flash, likely
 * conditions. Changes no result. */
#ifndef PVID_UNROLL_H
#define PVID_UNROLL_H

/* Before a loop of constant length: writes it out, where the loop's own bookkeeping costs more than the two
 * operations inside. */
#if defined(__GNUC__) && (__GNUC__ >= 8) && !defined(__clang__)
#define PVID_UNROLL _Pragma("GCC unroll 16")
#define PVID_UNROLL_BY_TWO _Pragma("GCC unroll 2")
#define PVID_UNROLL_BY_FOUR _Pragma("GCC unroll 4")
#else
#define PVID_UNROLL
#define PVID_UNROLL_BY_TWO
#define PVID_UNROLL_BY_FOUR
#endif

/* Instead of `static inline`, for a function that is called with constants for which it becomes short, but looks long
 * before: gcc's estimate does not see that. */
#if defined(__GNUC__)
#define PVID_ALWAYS_INLINE static inline __attribute__((always_inline))
#else
#define PVID_ALWAYS_INLINE static inline
#endif

/* Before a function that few ticks need: kept out of its caller, whose other ticks would pay for its registers. And
 * before one that stores 32-bit results: inlined, gcc holds them in 64 bits and multiplies 64 by 64. */
#if defined(__GNUC__)
#define PVID_NOINLINE __attribute__((noinline))
#else
#define PVID_NOINLINE
#endif

/* A condition that nearly every tick meets: gcc keeps the other case out of its way. */
#if defined(__GNUC__)
#define PVID_LIKELY(condition) (__builtin_expect((condition), true) != 0)
#else
#define PVID_LIKELY(condition) (condition)
#endif

/* Before a function that runs once, or at one tick of hundreds: compiled for little flash. */
#if defined(__GNUC__)
#define PVID_COLD __attribute__((noinline, cold))
#else
#define PVID_COLD
#endif

#endif
