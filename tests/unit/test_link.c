/* The frame codec: what does not fit, what is missing. Every length and damage anywhere: tests/link/test_link.py, for
 * both sides. */
#include "test.h"

#include "link.h"

#define ROOM PVID_LINK_ENCODED_BYTES(PVID_LINK_MAX_PAYLOAD)

static pvid_link_decoder decoder;

static uint32_t feed(const uint8_t bytes[], size_t n, pvid_link_frame *frame)
{
    uint32_t frames = 0;
    for (size_t i = 0; i < n; i++) {
        frames += pvid_link_decode(&decoder, bytes[i], frame) ? 1u : 0u;
    }
    return frames;
}

static void test_too_large_frame_is_not_written(void **state)
{
    uint8_t bytes[ROOM + 8u];
    static const uint8_t payload[PVID_LINK_MAX_PAYLOAD + 1];
    memset(bytes, 0xA5, sizeof bytes);
    const pvid_link_frame longer = {PVID_SAMPLE, 0u, 0u, payload, PVID_LINK_MAX_PAYLOAD + 1u};
    assert_int_equal(pvid_link_encode(&longer, bytes, sizeof bytes), 0u);
    const pvid_link_frame fits = {PVID_SAMPLE, 0u, 0u, payload, 100u};
    assert_int_equal(pvid_link_encode(&fits, bytes, PVID_LINK_ENCODED_BYTES(100u) - 1u), 0u);
    assert_int_equal(bytes[0], 0xA5);
}

static void test_missing_frames_are_counted_and_a_restart_is_none(void **state)
{
    static const uint16_t sequence[] = {65534u, 65535u, 0u, 3u, 4u, 0u, 1u};
    uint8_t bytes[ROOM];
    pvid_link_decoder_init(&decoder);
    for (size_t i = 0; i < (sizeof sequence / sizeof sequence[0]); i++) {
        pvid_link_frame out;
        const pvid_link_frame frame = {PVID_HASH, sequence[i], 0u, bytes, 0u};
        uint8_t encoded[PVID_LINK_ENCODED_BYTES(0u)];
        assert_int_equal(feed(encoded, pvid_link_encode(&frame, encoded, sizeof encoded), &out), 1u);
    }
    assert_int_equal(decoder.counters.missing, 2u);
}

static void test_endless_garbage_is_one_loss(void **state)
{
    pvid_link_frame out;
    pvid_link_decoder_init(&decoder);
    for (size_t i = 0; i < 100000u; i++) {
        assert_false(pvid_link_decode(&decoder, 0x55u, &out));
    }
    assert_false(pvid_link_decode(&decoder, 0u, &out));
    assert_int_equal(decoder.counters.malformed, 1u);
}

static const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_too_large_frame_is_not_written),
    cmocka_unit_test(test_missing_frames_are_counted_and_a_restart_is_none),
    cmocka_unit_test(test_endless_garbage_is_one_loss),
};
RUN(tests)
