/* The frame codec: known bytes, every payload length, damage at every place. */
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

static void test_every_length_comes_through(void **state)
{
    uint8_t payload[PVID_LINK_MAX_PAYLOAD];
    uint8_t bytes[ROOM];
    pvid_link_decoder_init(&decoder);
    for (size_t length = 0; length <= PVID_LINK_MAX_PAYLOAD; length++) {
        for (size_t i = 0; i < length; i++) {
            payload[i] = (uint8_t)(((i * 7u) % 300u) + length); /* runs without 0 of 254 and more among them */
        }
        const pvid_link_frame frame = {PVID_SAMPLE, (uint16_t)length, 0xFFFFFFFFu, payload, length};
        pvid_link_frame out;
        const size_t n = pvid_link_encode(&frame, bytes, PVID_LINK_ENCODED_BYTES(length));
        assert_true((n > 0u) && (n <= PVID_LINK_ENCODED_BYTES(length)));
        assert_int_equal(feed(bytes, n, &out), 1u);
        assert_int_equal(out.sequence, length);
        assert_int_equal(out.tick, 0xFFFFFFFFu);
        assert_int_equal(out.length, length);
        assert_memory_equal(out.payload, payload, length);
    }
    assert_int_equal(decoder.counters.frames, PVID_LINK_MAX_PAYLOAD + 1u);
    assert_int_equal(decoder.counters.missing, 0u);
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

static void test_a_flipped_bit_anywhere_loses_one_frame(void **state)
{
    static const uint8_t payload[40] = {1, 0, 2, 0, 0, 3};
    uint8_t bytes[ROOM];
    const pvid_link_frame frame = {PVID_SAMPLE, 1u, 9u, payload, sizeof payload};
    const size_t n = pvid_link_encode(&frame, bytes, sizeof bytes);
    for (size_t bit = 0; bit < (8u * n); bit++) {
        pvid_link_frame out;
        pvid_link_decoder_init(&decoder);
        bytes[bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
        assert_int_equal(feed(bytes, n, &out), 0u);
        bytes[bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
        (void)feed((const uint8_t *)"", 1, &out); /* the 0 may be what was hit */
        assert_int_equal(feed(bytes, n, &out), 1u);
        assert_true((decoder.counters.malformed + decoder.counters.bad_crc) >= 1u);
    }
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
    cmocka_unit_test(test_every_length_comes_through),
    cmocka_unit_test(test_too_large_frame_is_not_written),
    cmocka_unit_test(test_a_flipped_bit_anywhere_loses_one_frame),
    cmocka_unit_test(test_missing_frames_are_counted_and_a_restart_is_none),
    cmocka_unit_test(test_endless_garbage_is_one_loss),
};
RUN(tests)
