/* Words that two contexts share without a lock: one writes, others read. Private to the core, inlined. */
#ifndef PVID_SHARED_WORD_H
#define PVID_SHARED_WORD_H

#include <stdint.h>

/* Shared words are atomic if compiler and processor support it; other targets have one core, whose interrupts see
 * volatile accesses in source order. Floats may be copied as words, which gcc and clang allow by an
 * attribute. */
#if defined(__GNUC__) && defined(__GCC_HAVE_SYNC_COMPARE_AND_SWAP_4) && !defined(__FRAMAC__)

typedef uint32_t __attribute__((may_alias)) pvid_shared_word;

static inline uint32_t pvid_shared_load(const pvid_shared_word *place)
{
    return __atomic_load_n(place, __ATOMIC_RELAXED);
}

static inline void pvid_shared_store(pvid_shared_word *place, uint32_t value)
{
    __atomic_store_n(place, value, __ATOMIC_RELAXED);
}

/* A reader that sees a later write also sees all writes before this fence. */
static inline void pvid_shared_written(void)
{
    __atomic_thread_fence(__ATOMIC_RELEASE);
}

/* Reads after this fence return values at least as new as those before it. */
static inline void pvid_shared_read_so_far(void)
{
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
}

#else

#if defined(__GNUC__)
typedef uint32_t __attribute__((may_alias)) pvid_shared_word;
#else
typedef uint32_t pvid_shared_word;
#endif

static inline pvid_shared_word pvid_shared_load(const volatile pvid_shared_word *place)
{
    return *place;
}

static inline void pvid_shared_store(volatile pvid_shared_word *place, pvid_shared_word value)
{
    *place = value;
}

static inline void pvid_shared_written(void)
{
}

static inline void pvid_shared_read_so_far(void)
{
}

#endif

/* The same of numbers that are declared as uint32_t. */
static inline uint32_t pvid_shared_load_number(const uint32_t *place)
{
    return pvid_shared_load((const pvid_shared_word *)place);
}

static inline void pvid_shared_store_number(uint32_t *place, uint32_t value)
{
    pvid_shared_store((pvid_shared_word *)place, value);
}

#endif
