/* Fields of a configuration and what they may hold: both ends of a range are accepted, and the next value beyond either
 * end is refused with the status that names the field. */
#ifndef BOUNDS_H
#define BOUNDS_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "pvid/status.h"

typedef enum { KIND_FLOAT, KIND_INT32, KIND_UINT32, KIND_UINT16, KIND_UINT8, KIND_INT8 } bound_kind;

typedef struct {
    const char *name;
    size_t at; /* offset in the configuration */
    bound_kind kind;
    double low; /* exact: 53 bits hold every value of these kinds */
    double high;
    pvid_status status;
    pvid_status also; /* what an end may be answered with instead, as it contradicts another field; else PVID_OK */
} bound;

/* Calls init with the configuration as it stands. */
typedef pvid_status (*bound_init)(void);

static void bound_put(void *config, const bound *field, double value)
{
    uint8_t *place = (uint8_t *)config + field->at;
    const float number = (float)value;
    const int64_t integer = (field->kind == KIND_FLOAT) ? 0 : (int64_t)value;
    switch (field->kind) {
    case KIND_FLOAT:
        memcpy(place, &number, sizeof number);
        break;
    case KIND_INT32:
    case KIND_UINT32: {
        const uint32_t word = (uint32_t)integer;
        memcpy(place, &word, sizeof word);
        break;
    }
    case KIND_UINT16: {
        const uint16_t half = (uint16_t)integer;
        memcpy(place, &half, sizeof half);
        break;
    }
    default:
        *place = (uint8_t)integer;
        break;
    }
}

/* The value next to an end of the range, outwards; false where the type ends there. */
static bool bound_beyond(const bound *field, bool upwards, double *value)
{
    static const double least[6] = {-INFINITY, -2147483648.0, 0.0, 0.0, 0.0, -128.0};
    static const double most[6] = {INFINITY, 2147483647.0, 4294967295.0, 65535.0, 255.0, 127.0};
    const double end = upwards ? field->high : field->low;
    if (field->kind == KIND_FLOAT) {
        *value = (double)nextafterf((float)end, upwards ? INFINITY : -INFINITY);
        return true;
    }
    *value = upwards ? (end + 1.0) : (end - 1.0);
    return (*value >= least[field->kind]) && (*value <= most[field->kind]);
}

static void bound_expect(const bound *field, double value, pvid_status got, pvid_status wanted)
{
    if ((got != wanted) && ((wanted != PVID_OK) || (got != field->also))) {
        fail_msg("%s = %.9g: status %d, not %d", field->name, value, (int)got, (int)wanted);
    }
}

/* Tries every field's ends, what lies beyond, and, for a float, what is no number. `config` is as it was afterwards. */
static void check_bounds(const bound fields[], size_t n, void *config, size_t size, bound_init init)
{
    static uint8_t good[8192];
    assert_true(size <= sizeof good);
    memcpy(good, config, size);
    for (size_t i = 0; i < n; i++) {
        const bound *field = &fields[i];
        const double ends[2] = {field->low, field->high};
        const double strange[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
        for (int end = 0; end < 2; end++) {
            double beyond;
            bound_put(config, field, ends[end]);
            bound_expect(field, ends[end], init(), PVID_OK);
            if (bound_beyond(field, end == 1, &beyond)) {
                bound_put(config, field, beyond);
                bound_expect(field, beyond, init(), field->status);
            }
            memcpy(config, good, size);
        }
        for (int k = 0; (k < 3) && (field->kind == KIND_FLOAT); k++) {
            bound_put(config, field, strange[k]);
            bound_expect(field, strange[k], init(), field->status);
            memcpy(config, good, size);
        }
    }
    assert_int_equal(init(), PVID_OK);
}

/* Puts another value into every field: the configuration's fingerprint has to change. */
static void check_fingerprints(const bound fields[], size_t n, void *config, size_t size, uint32_t (*of)(void))
{
    static uint8_t good[8192];
    assert_true(size <= sizeof good);
    memcpy(good, config, size);
    const uint32_t before = of();
    for (size_t i = 0; i < n; i++) {
        bound_put(config, &fields[i], (fields[i].low + fields[i].high) / 2.0);
        if (memcmp(config, good, size) == 0) {
            bound_put(config, &fields[i], fields[i].high);
        }
        assert_memory_not_equal(config, good, size);
        if (of() == before) {
            fail_msg("%s is not in the fingerprint", fields[i].name);
        }
        memcpy(config, good, size);
        assert_int_equal(of(), before);
    }
}

#endif
