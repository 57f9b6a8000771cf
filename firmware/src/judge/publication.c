#include "judge/publication.h"

#include "number/count.h"
#include "number/shared_word.h"
#include "pvid/publication.h"
#include "pvid/publication_q31.h"

static void share(void *to, const void *from, size_t bytes)
{
    pvid_shared_word *place = to;
    const pvid_shared_word *fresh = from;
    for (size_t i = 0; i < (bytes / sizeof *place); i++) {
        pvid_shared_store(&place[i], fresh[i]);
    }
}

static void copy_out(void *to, const void *from, size_t bytes)
{
    pvid_shared_word *own = to;
    const pvid_shared_word *place = from;
    for (size_t i = 0; i < (bytes / sizeof *own); i++) {
        own[i] = pvid_shared_load(&place[i]);
    }
}

void pvid_publication_write(pvid_publication_mark *mark, void *estimate, void *copy, const void *fresh, size_t bytes,
                            uint32_t number)
{
    const uint32_t version = mark->version;
    pvid_shared_written(); /* the version, before the copy changes */
    share(copy, fresh, bytes);
    pvid_shared_store_number(&mark->number[1], number);
    pvid_shared_written();
    pvid_shared_store_number(&mark->version, version + 1u);
    pvid_shared_written();
    share(estimate, fresh, bytes);
    pvid_shared_store_number(&mark->number[0], number);
    pvid_shared_written();
    pvid_shared_store_number(&mark->version, version + 2u);
}

bool pvid_publication_read(const pvid_publication_mark *mark, const void *estimate, const void *copy, void *out,
                           size_t bytes, uint32_t *number)
{
    for (uint8_t left = PVID_READ_ATTEMPTS; left > 0u; left--) {
        const uint32_t version = pvid_shared_load_number(&mark->version);
        const uint32_t place = version % 2u;
        pvid_shared_read_so_far();
        copy_out(out, (place == 0u) ? estimate : copy, bytes);
        const uint32_t count = pvid_shared_load_number(&mark->number[place]);
        pvid_shared_read_so_far();
        if (pvid_shared_load_number(&mark->version) == version) {
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
