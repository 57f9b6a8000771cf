/* The record of the parameters: its bytes, that the next life takes them, and that everything else is refused and
 * changes nothing. Whole lives with other settings are in tests/core/test_record.py. */
#include "test.h"

#include "kapitza_plant_q31.h"
#include "first_order.h"
#include "pvid/pvid.h"
#include "persist/record.h"
#include "pvid/pvid_q31.h"

#define MECHANISM 0x12345678u
#define LENGTH PVID_RECORD_BYTES(4u)

static pvid_weak_f32 identifier;
static pvid_weak_f32 next;
static pvid_weak_f32 before;
static pvid_weak_q31 fixed;
static pvid_weak_q31 next_fixed;
static pvid_weak_design_f32 design;
static pvid_weak_config_f32 config;
static uint8_t record[LENGTH];
static uint8_t damaged[LENGTH];

/* A life of the identifier in which its estimate becomes valid. */
static int live(void **state)
{
    design = design_of(&mechanism);
    config = config_of(&design);
    first_order rig = {.generator = 1u};
    assert_int_equal(pvid_weak_init_f32(&identifier, &config), PVID_OK);
    for (int i = 0; (i < 60 * HOP) && (identifier.trust.estimate.standing.state != PVID_STANDING_VALID); i++) {
        float sample[2];
        next_sample(&rig, sample);
        (void)pvid_weak_step_f32(&identifier, sample);
    }
    assert_int_equal(identifier.trust.estimate.standing.state, PVID_STANDING_VALID);
    return 0;
}

/* All pieces; returns their number. */
static int save(uint8_t to[])
{
    pvid_record_writer writer = {0, 0, 0};
    int pieces = 1;
    while (pvid_record_save_weak_f32(&identifier, &writer, MECHANISM, to, LENGTH) == PVID_RECORD_MORE) {
        pieces++;
    }
    assert_int_equal(pvid_record_inspect(to, LENGTH, 4u, MECHANISM), PVID_RECORD_DONE);
    return pieces;
}

static pvid_record_status load(const uint8_t from[], size_t length)
{
    return pvid_record_load_weak_f32(&next, &config, MECHANISM, from, length);
}

/* Writes a word and the checksum that goes with it to a copy of the record. */
static void forge(size_t at, uint32_t word)
{
    memcpy(damaged, record, LENGTH);
    pvid_put_u32(&damaged[at], word);
    pvid_put_u32(&damaged[LENGTH - 4u], pvid_crc32(0u, damaged, LENGTH - 4u));
}

/* ---- writing ---- */

static void the_layout_is_that_of_the_header(void **state)
{
    assert_int_equal(LENGTH, 60u);
    assert_int_equal(save(record), 4);
    const uint8_t head[12] = {'P', 'V', 'R', 'C', 1, 4, 60, 0, 0x78, 0x56, 0x34, 0x12};
    assert_memory_equal(record, head, sizeof head);
    const pvid_estimate_f32 *estimate = pvid_weak_estimate_f32(&identifier);
    size_t at = 12;
    for (size_t a = 0; a < 4u; a++) {
        assert_true(pvid_get_f32(&record[at]) == estimate->p[a]);
        assert_true(pvid_get_f32(&record[at + 4u]) == estimate->se[a]);
        at += 8u;
        for (size_t b = a + 1u; b < 4u; b++) {
            const double exact =
                (double)estimate->covariance[a][b] / ((double)estimate->se[a] * (double)estimate->se[b]);
            const double stored = (double)(int16_t)pvid_get_u16(&record[at]) / 32768.0;
            assert_true(fabs(exact - stored) < 1.6e-5); /* half of 2^-15, and the rounding of float32 */
            at += 2u;
        }
    }
    assert_int_equal(at, LENGTH - 4u);
    assert_int_equal(pvid_get_u32(&record[at]), pvid_crc32(0u, record, at));
}

static void a_publication_between_two_pieces_begins_again(void **state)
{
    pvid_record_writer writer = {0, 0, 0};
    (void)save(damaged);
    assert_int_equal(pvid_record_save_weak_f32(&identifier, &writer, MECHANISM, record, LENGTH), PVID_RECORD_MORE);
    assert_int_equal(pvid_record_save_weak_f32(&identifier, &writer, MECHANISM, record, LENGTH), PVID_RECORD_MORE);
    identifier.trust.mark.number[0]++;
    identifier.trust.mark.number[1]++;
    for (int left = 3; left > 0; left--) {
        assert_int_equal(pvid_record_save_weak_f32(&identifier, &writer, MECHANISM, record, LENGTH), PVID_RECORD_MORE);
    }
    assert_int_equal(pvid_record_save_weak_f32(&identifier, &writer, MECHANISM, record, LENGTH), PVID_RECORD_DONE);
    assert_memory_equal(record, damaged, LENGTH);
}

static void only_what_is_published_and_valid_is_saved(void **state)
{
    static const uint8_t none[LENGTH];
    pvid_record_writer writer = {0, 0, 0};
    memset(record, 0, LENGTH);
    assert_int_equal(pvid_record_save_weak_f32(&identifier, &writer, MECHANISM, record, LENGTH - 1u),
                     PVID_RECORD_NO_ROOM);
    for (uint8_t standing = 0; standing < 4u; standing++) {
        identifier.trust.estimate.standing.state = standing;
        if (standing != (uint8_t)PVID_STANDING_VALID) {
            assert_int_equal(pvid_record_save_weak_f32(&identifier, &writer, MECHANISM, record, LENGTH),
                             PVID_RECORD_NOT_VALID);
        }
    }
    assert_int_equal(pvid_weak_init_f32(&identifier, &config), PVID_OK);
    identifier.trust.estimate.standing.state = PVID_STANDING_VALID; /* not published */
    assert_int_equal(pvid_record_save_weak_f32(&identifier, &writer, MECHANISM, record, LENGTH), PVID_RECORD_NOT_VALID);
    assert_memory_equal(record, none, LENGTH);
}

/* ---- the next life ---- */

static void the_values_are_the_start_of_the_next_life(void **state)
{
    (void)save(record);
    const pvid_estimate_f32 *estimate = pvid_weak_estimate_f32(&identifier);
    config.trust.se_max = 1.0f; /* other settings */
    config.estimator.forgetting_s = 100.0f;
    assert_int_equal(pvid_weak_init_f32(&next, &config), PVID_OK);
    assert_int_equal(load(record, LENGTH), PVID_RECORD_DONE);
    const pvid_estimate_f32 *start = pvid_weak_estimate_f32(&next);
    for (size_t a = 0; a < 4u; a++) {
        config.estimator.start[a] = estimate->p[a];
        assert_true((start->p[a] == estimate->p[a]) && (start->se[a] == estimate->se[a]));
        for (size_t b = 0; b < 4u; b++) {
            const float unit = estimate->se[a] * estimate->se[b];
            const float error = start->covariance[a][b] - estimate->covariance[a][b];
            assert_true(fabsf(error) < 2.0e-5f * unit); /* half of 2^-15, and float32 */
            assert_true(start->covariance[a][b] == start->covariance[b][a]);
        }
    }
    assert_int_equal(start->standing.state, PVID_STANDING_NONE);
    uint32_t number = 1u;
    pvid_estimate_f32 copy;
    assert_true(pvid_weak_read_f32(&next, &copy, &number) && (number == 0u));
    assert_memory_equal(&copy, start, sizeof copy);
    /* Of these settings, with this start and nothing else. */
    assert_int_equal(pvid_weak_init_f32(&before, &config), PVID_OK);
    next.trust.estimate = before.trust.estimate;
    next.trust.copy = before.trust.copy;
    assert_memory_equal(&before, &next, sizeof next);
}

/* ---- what is refused ---- */

static void assert_refused(const uint8_t bytes[], size_t length, pvid_record_status status)
{
    const pvid_record_status found = load(bytes, length);
    assert_true((found != PVID_RECORD_DONE) && ((status == PVID_RECORD_DONE) || (found == status)));
    assert_memory_equal(&next, &before, sizeof next);
}

static void start_another(void)
{
    (void)save(record);
    assert_int_equal(pvid_weak_init_f32(&next, &config), PVID_OK);
    before = next;
}

/* Every one and every two bits: 480 and 114 960 records. */
static void every_truncation_and_every_flip_is_refused(void **state)
{
    start_another();
    for (size_t length = 0; length < LENGTH; length++) {
        assert_refused(record, length, (length < 4u) ? PVID_RECORD_NONE : PVID_RECORD_CUT_SHORT);
    }
    for (size_t one = 0; one < 8u * LENGTH; one++) {
        memcpy(damaged, record, LENGTH);
        damaged[one / 8u] ^= (uint8_t)(1u << (one % 8u));
        const bool length = (one >= 48u) && (one < 64u);
        assert_refused(damaged, LENGTH,
                       (one < 32u) ? PVID_RECORD_NONE : (length ? PVID_RECORD_DONE : PVID_RECORD_DAMAGED));
        for (size_t other = one + 1u; other < 8u * LENGTH; other++) {
            damaged[other / 8u] ^= (uint8_t)(1u << (other % 8u));
            assert_int_not_equal(load(damaged, LENGTH), PVID_RECORD_DONE);
            damaged[other / 8u] ^= (uint8_t)(1u << (other % 8u));
        }
    }
    assert_memory_equal(&next, &before, sizeof next);
    assert_int_equal(load(record, LENGTH), PVID_RECORD_DONE);
}

static void whole_records_of_others_name_their_reason(void **state)
{
    start_another();
    const struct {
        size_t at;
        uint32_t word;
        pvid_record_status status;
    } field[] = {
        {4, 0x003C0402u, PVID_RECORD_OTHER_FORMAT},
        {4, 0x003C0301u, PVID_RECORD_OTHER_MECHANISM}, /* three parameters */
        {8, MECHANISM + 1u, PVID_RECORD_OTHER_MECHANISM},
        {12, 0x7FC00000u, PVID_RECORD_IMPLAUSIBLE}, /* NaN */
        {12, 0xFF800000u, PVID_RECORD_IMPLAUSIBLE}, /* -infinity */
        {12, 0x41A00001u, PVID_RECORD_IMPLAUSIBLE}, /* above 20, its upper bound */
        {12, 0x3DCCCCCCu, PVID_RECORD_IMPLAUSIBLE}, /* below 0.1, its lower one */
        {16, 0x00000000u, PVID_RECORD_IMPLAUSIBLE},
        {16, 0xBF800000u, PVID_RECORD_IMPLAUSIBLE},
        {16, 0x7F800000u, PVID_RECORD_IMPLAUSIBLE},
    };
    for (size_t i = 0; i < sizeof field / sizeof field[0]; i++) {
        forge(field[i].at, field[i].word);
        assert_refused(damaged, LENGTH, field[i].status);
    }
    assert_int_equal(pvid_record_load_weak_f32(&next, NULL, MECHANISM, record, LENGTH), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_load_weak_f32(&next, &config, MECHANISM, NULL, LENGTH), PVID_RECORD_NOT_READY);
    assert_int_equal(pvid_record_load_weak_f32(NULL, &config, MECHANISM, record, LENGTH), PVID_RECORD_NOT_READY);
    const pvid_weak_design_f32 another = design;
    pvid_weak_config_f32 other = config;
    other.design = &another;
    assert_int_equal(pvid_record_load_weak_f32(&next, &other, MECHANISM, record, LENGTH), PVID_RECORD_NOT_READY);
    assert_memory_equal(&next, &before, sizeof next);
    static const pvid_weak_f32 cleared;
    config.trust.se_max = -1.0f; /* init refuses it */
    assert_int_equal(load(record, LENGTH), PVID_RECORD_NOT_READY);
    assert_memory_equal(&next, &cleared, sizeof next);
}

/* ---- fixed point ---- */

static void save_fixed(void)
{
    fixed.trust.estimate.standing.state = PVID_STANDING_VALID;
    fixed.trust.mark.number[0] = 1u;
    fixed.trust.mark.number[1] = 1u;
    pvid_record_writer writer = {0, 0, 0};
    pvid_record_status status = PVID_RECORD_MORE;
    while (status == PVID_RECORD_MORE) {
        status = pvid_record_save_weak_q31(&fixed, &writer, MECHANISM, record, LENGTH);
    }
    assert_int_equal(status, PVID_RECORD_DONE);
}

static void integers_of_any_format_are_written_as_the_nearest_binary32(void **state)
{
    uint32_t generator = 7u;
    assert_int_equal(pvid_weak_init_q31(&fixed, &kapitza_config_q31), PVID_OK);
    for (int round = 0; round < 2000; round++) {
        for (size_t a = 0; a < 4u; a++) {
            generator = (generator * 1664525u) + 1013904223u;
            const int32_t x = (int32_t)(generator >> (1u + (uint32_t)(round % 31)));
            fixed.trust.estimate.p[a] = (a == 3u) ? -x : x;
            fixed.trust.estimate.se[a] = (round == 0) ? INT32_MAX : x;
            fixed.estimator.settings.p_bits[a] = (int8_t)((int32_t)(generator % 129u) - 64);
        }
        save_fixed();
        for (size_t a = 0, at = 12; a < 4u; at += 8u + (2u * (3u - a)), a++) {
            const double exact = ldexp((double)fixed.trust.estimate.p[a], -fixed.estimator.settings.p_bits[a]);
            const int32_t se = fixed.trust.estimate.se[a];
            const double error = ldexp((se > 0) ? (double)se : 1.0, -fixed.estimator.settings.p_bits[a]);
            assert_true(fabs((double)pvid_get_f32(&record[at]) - exact) <= fabs(exact) * ldexp(1.0, -24));
            assert_true(fabs((double)pvid_get_f32(&record[at + 4u]) - error) <= error * ldexp(1.0, -24));
        }
    }
}

/* All but the last 24 bits of a value come back; of the other core's records too, which have the same bytes. */
static void a_record_is_the_start_in_fixed_point(void **state)
{
    const pvid_weak_config_q31 *given = &kapitza_config_q31;
    for (int32_t round = 1; round < 200; round++) {
        assert_int_equal(pvid_weak_init_q31(&fixed, given), PVID_OK);
        assert_int_equal(pvid_weak_init_q31(&next_fixed, given), PVID_OK);
        for (size_t a = 0; a < 4u; a++) {
            const int64_t room = (int64_t)given->estimator.upper[a] - given->estimator.lower[a];
            fixed.trust.estimate.p[a] = (int32_t)(given->estimator.lower[a] + ((room * round) / 200));
            fixed.trust.estimate.se[a] = (round % 3 == 0) ? (round % 2) : (given->estimator.start_sd[a] / (2 * round));
            for (size_t b = 0; b < a; b++) {
                fixed.trust.estimate.correlation[a][b] = (round - 100) * (int32_t)((a + b) << 20);
                fixed.trust.estimate.correlation[b][a] = fixed.trust.estimate.correlation[a][b];
            }
        }
        save_fixed();
        assert_int_equal(pvid_record_load_weak_q31(&next_fixed, given, MECHANISM, record, LENGTH), PVID_RECORD_DONE);
        for (size_t a = 0; a < 4u; a++) {
            const double p = (double)fixed.trust.estimate.p[a];
            assert_true(fabs((double)next_fixed.estimator.p[a] - p) <= 0.5 + (fabs(p) * ldexp(1.0, -24)));
            const double se = fmax((double)fixed.trust.estimate.se[a], 1.0); /* 0: less than a count */
            assert_true(fabs((double)next_fixed.trust.copy.se[a] - se) <= 0.5 + (se * ldexp(1.0, -24)));
            for (size_t b = 0; b < 4u; b++) {
                const int32_t error = next_fixed.trust.copy.correlation[a][b] - fixed.trust.estimate.correlation[a][b];
                assert_true((error <= (1 << 14)) && (error >= -(1 << 14)));
            }
            assert_int_equal(next_fixed.estimator.settings.start_sd[a], given->estimator.start_sd[a]);
        }
    }
    static pvid_weak_q31 unchanged;
    unchanged = next_fixed;
    const uint32_t bad[][2] = {{12, 0x7F800000u}, {12, 0x7FC00000u}, {12, 0x4F800000u}, {12, 0x00000000u},
                               {12, 0xC2000000u}, {16, 0x00000000u}, {16, 0xBF800000u}, {16, 0x7F800000u}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        forge(bad[i][0], bad[i][1]);
        assert_int_equal(pvid_record_load_weak_q31(&next_fixed, given, MECHANISM, damaged, LENGTH),
                         PVID_RECORD_IMPLAUSIBLE);
        assert_memory_equal(&unchanged, &next_fixed, sizeof unchanged);
    }
    assert_int_equal(pvid_record_load_weak_q31(&next_fixed, given, MECHANISM + 1u, record, LENGTH),
                     PVID_RECORD_OTHER_MECHANISM);
    assert_memory_equal(&unchanged, &next_fixed, sizeof unchanged);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test_setup(the_layout_is_that_of_the_header, live),
    cmocka_unit_test_setup(a_publication_between_two_pieces_begins_again, live),
    cmocka_unit_test_setup(only_what_is_published_and_valid_is_saved, live),
    cmocka_unit_test_setup(the_values_are_the_start_of_the_next_life, live),
    cmocka_unit_test_setup(every_truncation_and_every_flip_is_refused, live),
    cmocka_unit_test_setup(whole_records_of_others_name_their_reason, live),
    cmocka_unit_test(integers_of_any_format_are_written_as_the_nearest_binary32),
    cmocka_unit_test(a_record_is_the_start_in_fixed_point),
};
RUN(tests)
