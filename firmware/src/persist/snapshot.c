#include "persist/snapshot.h"

#include <stdbool.h>
#include <string.h>

#include "pvid/crc32.h"
#include "pvid/fnv_word.h"
#include "pvid/little_endian.h"
#include "pvid/version.h"

#define MAGIC 0x53535650u /* "PVSS" */
#define VERSION                                                                                                        \
    (((uint32_t)PVID_VERSION_MAJOR << 24) | ((uint32_t)PVID_VERSION_MINOR << 16) | (uint32_t)PVID_VERSION_PATCH)
#define CRC_BYTES 4u
#define BYTE_ORDER 0x01020304u

/* Places of the header. */
enum {
    AT_MAGIC = 0,
    AT_LENGTH = 4,
    AT_VERSION = 8,
    AT_KIND = 12,
    AT_LAYOUT = 16,
    AT_MODEL = 20,
    AT_DESIGN = 24,
    AT_CONFIG = 28,
    AT_GENERATION = 32
};

/* Complete and undamaged, of any identity. */
static pvid_snapshot_status soundness(const uint8_t image[], size_t length)
{
    if ((image == NULL) || (length < PVID_SNAPSHOT_HEADER + CRC_BYTES) || (pvid_get_u32(&image[AT_MAGIC]) != MAGIC)) {
        return PVID_SNAPSHOT_NONE;
    }
    const uint32_t stated = pvid_get_u32(&image[AT_LENGTH]);
    if (stated > length) {
        return PVID_SNAPSHOT_CUT_SHORT;
    }
    if (stated < PVID_SNAPSHOT_HEADER + CRC_BYTES) {
        return PVID_SNAPSHOT_DAMAGED;
    }
    const size_t sealed = (size_t)stated - CRC_BYTES;
    return (pvid_crc32(0u, image, sealed) == pvid_get_u32(&image[sealed])) ? PVID_SNAPSHOT_RESTORED
                                                                           : PVID_SNAPSHOT_DAMAGED;
}

/* Whether image[] holds an undamaged snapshot of this identity. */
static pvid_snapshot_status inspect(const uint8_t image[], size_t length, const pvid_snapshot_identity *identity)
{
    const pvid_snapshot_status sound = soundness(image, length);
    if (sound != PVID_SNAPSHOT_RESTORED) {
        return sound;
    }
    if (pvid_get_u32(&image[AT_VERSION]) != VERSION) {
        return PVID_SNAPSHOT_OTHER_VERSION;
    }
    if (pvid_get_u32(&image[AT_KIND]) != (uint32_t)identity->kind) {
        return PVID_SNAPSHOT_OTHER_KIND;
    }
    if (pvid_get_u32(&image[AT_LAYOUT]) != identity->layout) {
        return PVID_SNAPSHOT_OTHER_LAYOUT;
    }
    if (pvid_get_u32(&image[AT_MODEL]) != identity->model) {
        return PVID_SNAPSHOT_OTHER_MODEL;
    }
    if (pvid_get_u32(&image[AT_DESIGN]) != identity->design) {
        return PVID_SNAPSHOT_OTHER_DESIGN;
    }
    if ((pvid_get_u32(&image[AT_CONFIG]) != identity->config) ||
        (pvid_get_u32(&image[AT_LENGTH]) != PVID_SNAPSHOT_BYTES(identity->bytes))) {
        return PVID_SNAPSHOT_OTHER_CONFIG;
    }
    return PVID_SNAPSHOT_RESTORED;
}

/* ---- the object, its pointers and the memory after it ---- */

/* In the place of a pointer, so that equal states have equal snapshots and no address gets into flash. */
static void put_pointers(uint8_t copy[], const pvid_snapshot_shape *shape)
{
    for (size_t i = 0; i < shape->n_pointers; i++) {
        const void *pointer;
        uint8_t *place = &copy[shape->pointers[i].place];
        memcpy(&pointer, place, sizeof pointer);
        memset(place, 0, sizeof pointer);
        place[0] = (pointer != NULL) ? 1u : 0u;
    }
}

static void take_all_but_pointers(uint8_t object[], const uint8_t copy[], const pvid_snapshot_shape *shape)
{
    size_t from = 0;
    for (size_t i = 0; i < shape->n_pointers; i++) {
        const size_t place = (size_t)shape->pointers[i].place;
        memcpy(&object[from], &copy[from], place - from);
        from = place + sizeof(void *);
    }
    memcpy(&object[from], &copy[from], shape->bytes - from);
}

/* Pointers into the object point into this one, where they were not NULL. */
static void point_into(uint8_t object[], const uint8_t copy[], const pvid_snapshot_shape *shape)
{
    for (size_t i = 0; i < shape->n_pointers; i++) {
        const pvid_snapshot_pointer *one = &shape->pointers[i];
        if (one->target != PVID_SNAPSHOT_OF_INIT) {
            const void *pointer = (copy[one->place] != 0u) ? &object[one->target] : NULL;
            memcpy(&object[one->place], &pointer, sizeof pointer);
        }
    }
}

/* Adds header and checksum to the bytes at PVID_SNAPSHOT_HEADER; returns the length of the snapshot. */
static size_t seal(uint8_t image[], const pvid_snapshot_identity *identity, uint32_t generation)
{
    const size_t sealed = PVID_SNAPSHOT_HEADER + identity->bytes;
    pvid_put_u32(&image[AT_MAGIC], MAGIC);
    pvid_put_u32(&image[AT_LENGTH], (uint32_t)(sealed + CRC_BYTES));
    pvid_put_u32(&image[AT_VERSION], VERSION);
    pvid_put_u32(&image[AT_KIND], (uint32_t)identity->kind);
    pvid_put_u32(&image[AT_LAYOUT], identity->layout);
    pvid_put_u32(&image[AT_MODEL], identity->model);
    pvid_put_u32(&image[AT_DESIGN], identity->design);
    pvid_put_u32(&image[AT_CONFIG], identity->config);
    pvid_put_u32(&image[AT_GENERATION], generation);
    pvid_put_u32(&image[sealed], pvid_crc32(0u, image, sealed));
    return sealed + CRC_BYTES;
}

size_t pvid_snapshot_save(uint8_t image[], size_t room, const pvid_snapshot_identity *identity, uint32_t generation,
                          const void *object, const pvid_snapshot_shape *shape, const void *behind)
{
    if (room < PVID_SNAPSHOT_BYTES(identity->bytes)) {
        return 0;
    }
    uint8_t *copy = &image[PVID_SNAPSHOT_HEADER];
    memcpy(copy, object, shape->bytes);
    put_pointers(copy, shape);
    if (behind != NULL) {
        memcpy(&copy[shape->bytes], behind, identity->bytes - shape->bytes);
    }
    return seal(image, identity, generation);
}

pvid_snapshot_status pvid_snapshot_restore(const uint8_t image[], size_t length, const pvid_snapshot_identity *identity,
                                           uint8_t object[], const pvid_snapshot_shape *shape, void *behind)
{
    const pvid_snapshot_status status = inspect(image, length, identity);
    if (status == PVID_SNAPSHOT_RESTORED) {
        const uint8_t *copy = &image[PVID_SNAPSHOT_HEADER];
        take_all_but_pointers(object, copy, shape);
        point_into(object, copy, shape);
        if (behind != NULL) {
            memcpy(behind, &copy[shape->bytes], identity->bytes - shape->bytes);
        }
    }
    return status;
}

uint32_t pvid_snapshot_layout(const uint32_t words[], size_t n)
{
    const uint32_t word = BYTE_ORDER;
    uint8_t bytes[sizeof word];
    memcpy(bytes, &word, sizeof word);
    uint32_t hash = pvid_fnv_word(PVID_FNV_START, pvid_get_u32(bytes));
    for (size_t i = 0; i < n; i++) {
        hash = pvid_fnv_word(hash, words[i]);
    }
    return hash;
}

pvid_snapshot_choice pvid_snapshot_choose(const uint8_t slot_0[], const uint8_t slot_1[], size_t size)
{
    const bool sound_0 = soundness(slot_0, size) == PVID_SNAPSHOT_RESTORED;
    const bool sound_1 = soundness(slot_1, size) == PVID_SNAPSHOT_RESTORED;
    pvid_snapshot_choice choice = {.newest = -1, .next = 0u, .generation = 1u};
    if (!sound_0 && !sound_1) {
        return choice;
    }
    const uint32_t generation_0 = sound_0 ? pvid_get_u32(&slot_0[AT_GENERATION]) : 0u;
    const uint32_t generation_1 = sound_1 ? pvid_get_u32(&slot_1[AT_GENERATION]) : 0u;
    const bool second = sound_1 && (!sound_0 || ((uint32_t)(generation_1 - generation_0) < ((uint32_t)1 << 31)));
    choice.newest = (int8_t)(second ? 1 : 0);
    choice.next = (uint8_t)(second ? 0u : 1u);
    choice.generation = (second ? generation_1 : generation_0) + 1u;
    return choice;
}
