#include "judge/publication.h"

#include "number/count.h"
#include "pvid/publication.h"
#include "pvid/publication_q31.h"

/* Shared words are atomic if compiler and processor support it; other targets have one core, whose interrupts see
 * volatile accesses in source order. An estimate's floats are copied as words, which gcc and clang allow by an
 * attribute. */
#if defined(__GNUC__) && defined(__GCC_HAVE_SYNC_COMPARE_AND_SWAP_4) && !defined(__FRAMAC__)

typedef uint32_t __attribute__((may_alias)) word;

static inline uint32_t load(const word *place)
{
    return __atomic_load_n(place, __ATOMIC_RELAXED);
}

static inline void store(word *place, uint32_t value)
{
    __atomic_store_n(place, value, __ATOMIC_RELAXED);
}

/* A reader that sees a later write also sees all writes before this fence. */
static inline void written(void)
{
    __atomic_thread_fence(__ATOMIC_RELEASE);
}

/* Reads after this fence return values at least as new as those before it. */
static inline void read_so_far(void)
{
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
}

#else

#if defined(__GNUC__)
typedef uint32_t __attribute__((may_alias)) word;
#else
typedef uint32_t word;
#endif

static inline word load(const volatile word *place)
{
    return *place;
}

static inline void store(volatile word *place, word value)
{
    *place = value;
}

static inline void written(void)
{
}

static inline void read_so_far(void)
{
}

#endif

/* The version and the numbers, which are words as declared. */
static inline uint32_t load_number(const uint32_t *place)
{
    return load((const word *)place);
}

static inline void store_number(uint32_t *place, uint32_t value)
{
    store((word *)place, value);
}

static void share(void *to, const void *from, size_t bytes)
{
    word *place = to;
    const word *fresh = from;
    for (size_t i = 0; i < (bytes / sizeof *place); i++) {
        store(&place[i], fresh[i]);
    }
}

static void copy_out(void *to, const void *from, size_t bytes)
{
    word *own = to;
    const word *place = from;
    for (size_t i = 0; i < (bytes / sizeof *own); i++) {
        own[i] = load(&place[i]);
    }
}

void pvid_publication_write(pvid_publication_mark *mark, void *estimate, void *copy, const void *fresh, size_t bytes,
                            uint32_t number)
{
    const uint32_t version = mark->version;
    written(); /* the version, before the copy changes */
    share(copy, fresh, bytes);
    store_number(&mark->number[1], number);
    written();
    store_number(&mark->version, version + 1u);
    written();
    share(estimate, fresh, bytes);
    store_number(&mark->number[0], number);
    written();
    store_number(&mark->version, version + 2u);
}

bool pvid_publication_read(const pvid_publication_mark *mark, const void *estimate, const void *copy, void *out,
                           size_t bytes, uint32_t *number)
{
    for (uint8_t left = PVID_READ_ATTEMPTS; left > 0u; left--) {
        const uint32_t version = load_number(&mark->version);
        const uint32_t place = version % 2u;
        read_so_far();
        copy_out(out, (place == 0u) ? estimate : copy, bytes);
        const uint32_t count = load_number(&mark->number[place]);
        read_so_far();
        if (load_number(&mark->version) == version) {
            if (number != NULL) {
                *number = count;
            }
            return true;
        }
    }
    return false;
}

static uint32_t next_of(const pvid_publication_mark *mark)
{
    uint32_t number = mark->number[0];
    pvid_count_up(&number);
    return number;
}

void pvid_publication_put_f32(pvid_publication_f32 *self, const pvid_estimate_f32 *estimate)
{
    const bool given = (self != NULL) && (estimate != NULL);
    PVID_ASSERT(given);
    if (given) {
        pvid_publication_write(&self->mark, &self->estimate, &self->copy, estimate, sizeof *estimate,
                               next_of(&self->mark));
    }
}

bool pvid_publication_read_f32(const pvid_publication_f32 *self, pvid_estimate_f32 *estimate, uint32_t *number)
{
    const bool given = (self != NULL) && (estimate != NULL);
    PVID_ASSERT(given);
    return given &&
           pvid_publication_read(&self->mark, &self->estimate, &self->copy, estimate, sizeof *estimate, number);
}

void pvid_publication_put_q31(pvid_publication_q31 *self, const pvid_estimate_q31 *estimate)
{
    const bool given = (self != NULL) && (estimate != NULL);
    PVID_ASSERT(given);
    if (given) {
        pvid_publication_write(&self->mark, &self->estimate, &self->copy, estimate, sizeof *estimate,
                               next_of(&self->mark));
    }
}

bool pvid_publication_read_q31(const pvid_publication_q31 *self, pvid_estimate_q31 *estimate, uint32_t *number)
{
    const bool given = (self != NULL) && (estimate != NULL);
    PVID_ASSERT(given);
    return given &&
           pvid_publication_read(&self->mark, &self->estimate, &self->copy, estimate, sizeof *estimate, number);
}
