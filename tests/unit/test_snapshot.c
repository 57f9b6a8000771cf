/* Restoring an identifier refuses what is not its own, and power may fail at any byte of a save. That a restored one
 * continues bit for bit, and that each field and table entry counts, is shown of either core in
 * tests/core/test_snapshot_weak.py and test_weak_snapshot_q31.py. */
#include "test.h"

#include "first_order.h"
#include "kapitza_plant_q31.h"
#include "number/fingerprint_numbers_f32.h"
#include "solve/settings_q31.h"
#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "pvid/snapshot_weak_q31.h"

#define ROOM PVID_SNAPSHOT_WEAK_F32

static pvid_weak_f32 identifier;
static pvid_weak_f32 before;
static pvid_weak_design_f32 design;
static uint8_t image[ROOM];
static uint8_t again[ROOM];

static pvid_weak_config_f32 weak_config(void)
{
    design = design_of(&mechanism);
    return config_of(&design);
}

static void run(pvid_weak_f32 *self, first_order *rig, int ticks)
{
    for (int i = 0; i < ticks; i++) {
        float sample[2];
        next_sample(rig, sample);
        (void)pvid_weak_step_f32(self, sample);
    }
}

static size_t save(const pvid_weak_config_f32 *config, uint32_t generation, uint8_t to[])
{
    return pvid_snapshot_save_weak_f32(&identifier, config, generation, to, ROOM);
}

/* ---- refusals ---- */

static void start_and_save(const pvid_weak_config_f32 *config)
{
    assert_int_equal(pvid_weak_init_f32(&identifier, config), PVID_OK);
    first_order rig = {.generator = 1u};
    run(&identifier, &rig, 3 * HOP);
    assert_int_equal(save(config, 5, image), PVID_SNAPSHOT_WEAK_F32);
    memcpy(&before, &identifier, sizeof before);
}

static pvid_snapshot_status restore(const pvid_weak_config_f32 *config, const uint8_t from[], size_t n)
{
    const pvid_snapshot_status status = pvid_snapshot_restore_weak_f32(&identifier, config, from, n);
    assert_memory_equal(&identifier, &before, sizeof before);
    return status;
}

/* A bit of every byte: which one goes round. */
static void every_damaged_byte_is_seen_and_nothing_is_changed(void **state)
{
    const pvid_weak_config_f32 config = weak_config();
    start_and_save(&config);
    for (size_t at = 0; at < PVID_SNAPSHOT_WEAK_F32; at += (at < PVID_SNAPSHOT_HEADER) ? 1u : ONE_IN) {
        const uint8_t flip = (uint8_t)(1u << (at % 8u));
        image[at] = (uint8_t)(image[at] ^ flip);
        const pvid_snapshot_status status = restore(&config, image, PVID_SNAPSHOT_WEAK_F32);
        const bool magic = at < 4u;
        const bool length = (at >= 4u) && (at < 8u);
        assert_true((status == PVID_SNAPSHOT_DAMAGED) || (magic && (status == PVID_SNAPSHOT_NONE)) ||
                    (length && (status == PVID_SNAPSHOT_CUT_SHORT)));
        image[at] = (uint8_t)(image[at] ^ flip);
    }
    assert_int_equal(restore(&config, image, PVID_SNAPSHOT_WEAK_F32), PVID_SNAPSHOT_RESTORED);
}

static void every_length_that_is_too_short_is_refused(void **state)
{
    const pvid_weak_config_f32 config = weak_config();
    start_and_save(&config);
    for (size_t n = 0; n < PVID_SNAPSHOT_WEAK_F32; n += (n < (PVID_SNAPSHOT_HEADER + 4u)) ? 1u : ONE_IN) {
        const pvid_snapshot_status expected =
            (n < PVID_SNAPSHOT_HEADER + 4u) ? PVID_SNAPSHOT_NONE : PVID_SNAPSHOT_CUT_SHORT;
        assert_int_equal(restore(&config, image, n), expected);
        assert_int_equal(pvid_snapshot_save_weak_f32(&identifier, &config, 1, again, n), 0);
    }
}

/* Writes a word of the header and the checksum that goes with it. */
static void forge(size_t at, uint32_t word)
{
    pvid_put_u32(&image[at], word);
    pvid_put_u32(&image[PVID_SNAPSHOT_WEAK_F32 - 4u], pvid_crc32(0u, image, PVID_SNAPSHOT_WEAK_F32 - 4u));
}

static void snapshot_of_another_object_names_its_kind(void **state)
{
    const struct {
        size_t at;
        pvid_snapshot_status status;
    } field[] = {
        {8, PVID_SNAPSHOT_OTHER_VERSION}, {12, PVID_SNAPSHOT_OTHER_KIND},   {16, PVID_SNAPSHOT_OTHER_LAYOUT},
        {20, PVID_SNAPSHOT_OTHER_MODEL},  {24, PVID_SNAPSHOT_OTHER_DESIGN}, {28, PVID_SNAPSHOT_OTHER_CONFIG},
    };
    const pvid_weak_config_f32 config = weak_config();
    start_and_save(&config);
    for (size_t i = 0; i < sizeof field / sizeof field[0]; i++) {
        const uint32_t word = pvid_get_u32(&image[field[i].at]);
        forge(field[i].at, word + 1u);
        assert_int_equal(restore(&config, image, PVID_SNAPSHOT_WEAK_F32), field[i].status);
        forge(field[i].at, word);
        assert_int_equal(restore(&config, image, PVID_SNAPSHOT_WEAK_F32), PVID_SNAPSHOT_RESTORED);
    }
    forge(4, 12u); /* says that it is shorter than its own header */
    assert_int_equal(restore(&config, image, PVID_SNAPSHOT_WEAK_F32), PVID_SNAPSHOT_DAMAGED);
}

static void a_snapshot_of_the_other_core_is_of_another_kind(void **state)
{
    static pvid_weak_q31 fixed;
    static uint8_t of_fixed[PVID_SNAPSHOT_WEAK_Q31];
    const pvid_weak_config_f32 config = weak_config();
    start_and_save(&config);
    assert_int_equal(pvid_weak_init_q31(&fixed, &kapitza_config_q31), PVID_OK);
    const size_t n = pvid_snapshot_save_weak_q31(&fixed, &kapitza_config_q31, 1, of_fixed, sizeof of_fixed);
    assert_int_equal(restore(&config, of_fixed, n), PVID_SNAPSHOT_OTHER_KIND);
    assert_int_equal(pvid_snapshot_restore_weak_q31(&fixed, &kapitza_config_q31, image, sizeof image),
                     PVID_SNAPSHOT_OTHER_KIND);
    assert_int_equal(restore(&config, image, sizeof image), PVID_SNAPSHOT_RESTORED);
}

/* ---- two slots ---- */

static uint8_t slot[2][PVID_SNAPSHOT_WEAK_F32];

static void the_format_of_rows_counts(void **state)
{
    pvid_estimator_config_q31 one;
    memset(&one, 0, sizeof one);
    pvid_estimator_config_q31 other = one;
    other.y_bits = 3;
    assert_int_not_equal(pvid_fingerprint_estimator_q31(1u, &one, 2, 3),
                         pvid_fingerprint_estimator_q31(1u, &other, 2, 3));
    other.y_bits = 0;
    for (int8_t i = 0; i < 4; i++) { /* of as many as there are theta */
        other.n_bits[i] = 3;
        assert_int_equal(
            pvid_fingerprint_estimator_q31(1u, &one, 3, 3) == pvid_fingerprint_estimator_q31(1u, &other, 3, 3), i == 3);
        other.n_bits[i] = 0;
    }
}

static void slots_are_used_in_turn(void **state)
{
    const pvid_weak_config_f32 config = weak_config();
    start_and_save(&config);
    memset(slot, 0xFF, sizeof slot);
    pvid_snapshot_choice choice = pvid_snapshot_choose(slot[0], slot[1], sizeof slot[0]);
    assert_int_equal(choice.newest, -1);
    assert_int_equal(choice.next, 0);
    for (uint32_t generation = 1; generation < 6u; generation++) {
        assert_int_equal(choice.generation, generation);
        const uint8_t written = choice.next;
        assert_int_equal(
            pvid_snapshot_save_weak_f32(&identifier, &config, choice.generation, slot[written], sizeof slot[0]),
            sizeof slot[0]);
        choice = pvid_snapshot_choose(slot[0], slot[1], sizeof slot[0]);
        assert_int_equal(choice.newest, written);
        assert_int_equal(choice.next, 1 - written);
    }
}

static void generations_go_round(void **state)
{
    const pvid_weak_config_f32 config = weak_config();
    start_and_save(&config);
    for (uint32_t older = UINT32_MAX - 2u; older != 2u; older++) {
        for (int place = 0; place < 2; place++) {
            (void)pvid_snapshot_save_weak_f32(&identifier, &config, older, slot[place], sizeof slot[0]);
            (void)pvid_snapshot_save_weak_f32(&identifier, &config, older + 1u, slot[1 - place], sizeof slot[0]);
            const pvid_snapshot_choice choice = pvid_snapshot_choose(slot[0], slot[1], sizeof slot[0]);
            assert_int_equal(choice.newest, 1 - place);
            assert_int_equal(choice.next, place);
            assert_int_equal(choice.generation, (uint32_t)(older + 2u));
        }
    }
}

/* Power fails after any number of bytes of a save into either slot, over an older snapshot or over erased flash. Which
 * slot it is matters to no byte: slots_are_used_in_turn and generations_go_round have both as the newest. */
static void a_power_cut_at_any_byte_leaves_the_older_snapshot(void **state)
{
    const pvid_weak_config_f32 config = weak_config();
    assert_int_equal(pvid_weak_init_f32(&identifier, &config), PVID_OK);
    first_order rig = {.generator = 1u};
    static uint8_t generation[3][PVID_SNAPSHOT_WEAK_F32];
    for (uint32_t g = 0; g < 3u; g++) {
        run(&identifier, &rig, 2 * HOP);
        (void)pvid_snapshot_save_weak_f32(&identifier, &config, g + 1u, generation[g], sizeof generation[g]);
    }
    const size_t n = sizeof slot[0];
    for (int place = 0; place < 2; place++) { /* the slot that is written to, the first one over an older snapshot */
        memcpy(slot[1 - place], generation[1], n);
        if (place == 0) {
            memcpy(slot[place], generation[0], n);
        } else {
            memset(slot[place], 0xFF, n);
        }
        /* Complete already before its last bytes are written where those are the ones of the older snapshot. */
        for (size_t cut = 0; (cut < n) && (memcmp(&slot[place][cut], &generation[2][cut], n - cut) != 0); cut++) {
            if ((cut % ONE_IN) == 0u) {
                const pvid_snapshot_choice choice = pvid_snapshot_choose(slot[0], slot[1], n);
                assert_int_equal(choice.newest, 1 - place);
                assert_int_equal(choice.next, place);
                assert_int_equal(choice.generation, 3);
            }
            slot[place][cut] = generation[2][cut];
        }
        memcpy(slot[place], generation[2], n);
        assert_int_equal(pvid_snapshot_choose(slot[0], slot[1], n).newest, place);
    }
}

static void every_entry_of_a_list_counts_in_a_fingerprint(void **state)
{
    float values[5] = {1.0f, 2.0f, 3.0f, 4.0f, 5.0f};
    const uint32_t hash = pvid_fingerprint_floats(7u, values, 4);
    for (size_t i = 0; i < 5u; i++) {
        values[i] += 1.0f;
        assert_int_equal(pvid_fingerprint_floats(7u, values, 4) == hash, i == 4u);
        values[i] -= 1.0f;
    }
    assert_int_equal(pvid_fingerprint_floats(7u, values, 0), 7u);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(every_damaged_byte_is_seen_and_nothing_is_changed),
    cmocka_unit_test(every_length_that_is_too_short_is_refused),
    cmocka_unit_test(snapshot_of_another_object_names_its_kind),
    cmocka_unit_test(a_snapshot_of_the_other_core_is_of_another_kind),
    cmocka_unit_test(the_format_of_rows_counts),
    cmocka_unit_test(slots_are_used_in_turn),
    cmocka_unit_test(generations_go_round),
    cmocka_unit_test(a_power_cut_at_any_byte_leaves_the_older_snapshot),
    cmocka_unit_test(every_entry_of_a_list_counts_in_a_fingerprint),
};
RUN(tests)
